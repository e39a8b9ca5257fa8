#include "markers/detail/dot_pixels.h"

#include <algorithm>
#include <cmath>

namespace crosstie::markers::detail {
namespace {

/// Pixels [begin, end) of a row.
struct Span {
  int begin, end;
};

/// Those whose centres lie within rho of the ellipse, in the row `ey` below its centre; empty where the row does not meet it.
Span span_of(const Eigen::Matrix2d& shape, double centre_x, double ey, double rho) {
  const double p = shape(0, 1) * ey;
  const double discriminant = p * p - shape(0, 0) * (shape(1, 1) * ey * ey - rho * rho);
  if (!(discriminant > 0.0)) return {0, 0};
  const double middle = centre_x - p / shape(0, 0);
  const double half = std::sqrt(discriminant) / shape(0, 0);
  return {static_cast<int>(std::ceil(middle - half)), static_cast<int>(std::floor(middle + half)) + 1};
}

template <typename Sample>
void append(const Sample* row, Span span, int width, int step, float x0, float per_px, float y, PixelSet& set) {
  span.begin = std::max(span.begin, 0);
  span.end = std::min(span.end, width);
  if (span.begin >= span.end) return;
  const std::size_t from = set.used;
  const int count = (span.end - span.begin + step - 1) / step;
  set.used += static_cast<std::size_t>(count);
  if (set.x.size() < set.used) {
    const std::size_t size = 2 * set.used + 64;
    set.x.resize(size);
    set.y.resize(size);
    set.grey.resize(size);
  }
  float* const xs = set.x.data() + from;
  float* const ys = set.y.data() + from;
  float* const greys = set.grey.data() + from;
  for (int i = 0; i < count; ++i) {
    const int x = span.begin + i * step;
    xs[i] = (static_cast<float>(x) - x0) * per_px;
    ys[i] = y;
    greys[i] = static_cast<float>(row[x]);
  }
}

}  // namespace

void PixelSet::collect(const base::ImageView& image, const Ellipse& ellipse, double inner_rho, double outer_rho, int x_step,
                       int y_step) {
  used = 0;
  const Eigen::Matrix2d shape = ellipse.shape();
  const double half = outer_rho * ellipse.half_extent_px().y();
  const int top = std::max(0, static_cast<int>(std::ceil(ellipse.centre_px.y() - half)));
  const int bottom = std::min(image.height - 1, static_cast<int>(std::floor(ellipse.centre_px.y() + half)));
  // The origin is a whole pixel, so that offsets are exact in single precision.
  const auto x0 = static_cast<float>(origin_px.x());
  const auto per_px = static_cast<float>(1.0 / radius_px);
  for (int row = top; row <= bottom; row += y_step) {
    const double ey = row - ellipse.centre_px.y();
    const auto y_unit = static_cast<float>((row - origin_px.y()) / radius_px);
    const Span outer = span_of(shape, ellipse.centre_px.x(), ey, outer_rho);
    const Span inner = inner_rho > 0.0 ? span_of(shape, ellipse.centre_px.x(), ey, inner_rho) : Span{0, 0};
    const auto take = [&](const Span& span) {
      if (image.bits == 8) {
        append(image.row<std::uint8_t>(row), span, image.width, x_step, x0, per_px, y_unit, *this);
      } else {
        append(image.row<std::uint16_t>(row), span, image.width, x_step, x0, per_px, y_unit, *this);
      }
    };
    if (inner.begin < inner.end) {
      take({outer.begin, inner.begin});
      take({inner.end, outer.end});
    } else {
      take(outer);
    }
  }
  const std::size_t size = (used + kPixelPadding - 1) / kPixelPadding * kPixelPadding;
  for (auto* values : {&x, &y, &grey}) values->resize(std::max(size, used));
  for (std::size_t i = used; i < size; ++i) {
    x[i] = y[i] = 1.0F;
    grey[i] = 0.0F;
  }
  for (auto* values : {&weight, &limit2, &residual, &inside, &slope}) values->resize(size);
}

void PixelSet::evaluate(const DotModel& model) {
  evaluate_dot(model, x.data(), y.data(), grey.data(), x.size(), residual.data(), inside.data(), slope.data());
}

}  // namespace crosstie::markers::detail
