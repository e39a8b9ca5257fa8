#include "markers/detail/cover_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <numbers>

#include "markers/detail/blur_kernel.h"

namespace crosstie::markers::detail {
namespace {

constexpr double kReach = 4.5;  // standard deviations of the Gaussian that are looked at

/// What covers a cell in part counts as if it did so evenly: cells of 1 px would move small dots by 0.005 px, of 1/2 px by 0.0006,
/// of 1/3 px by 0.0003. Much blurred dots are larger ones.
int cells_for(double blur_px) { return blur_px < 1.5 ? 3 : 2; }

/// Gaussian and its first two derivatives at the cells around a pixel's centre, one after the other.
struct Kernel {
  int first;  ///< cell, counted from the pixel's first one
  std::size_t taps;
  std::vector<float> weights;
};

Kernel kernel_of(double sigma_px, int cells) {
  const double middle = 0.5 * cells - 0.5;  // of the pixel in cells
  const double reach = kReach * sigma_px * cells;
  const int first = static_cast<int>(std::ceil(middle - reach));
  const auto taps = static_cast<std::size_t>(static_cast<int>(std::floor(middle + reach)) - first + 1);
  Kernel kernel{first, taps, std::vector<float>(kBlurOrders * taps)};
  const double scale = 1.0 / (sigma_px * std::sqrt(2.0 * std::numbers::pi) * cells);
  for (std::size_t k = 0; k < taps; ++k) {
    const double t = (middle - first - static_cast<double>(k)) / (cells * sigma_px);  // from the cell to the pixel
    const double bell = scale * std::exp(-0.5 * t * t);
    kernel.weights[k] = static_cast<float>(bell);
    kernel.weights[taps + k] = static_cast<float>(-t / sigma_px * bell);
    kernel.weights[2 * taps + k] = static_cast<float>((t * t - 1.0) / (sigma_px * sigma_px) * bell);
  }
  return kernel;
}

}  // namespace

CoverImage::CoverImage(const Window& window, double blur_px) : window_(window), cells_(cells_for(blur_px)) {
  kernel_px_ = std::sqrt(std::max(blur_px * blur_px - 1.0 / (12.0 * cells_ * cells_), 0.02));
  margin_ = static_cast<int>(std::ceil(kReach * kernel_px_)) + 1;
  stride_ = static_cast<std::ptrdiff_t>(cells_) * (window.width + 2 * margin_) + 2;
  change_.assign(static_cast<std::size_t>(stride_ * cells_ * (window.height + 2 * margin_)), 0.0F);
}

void CoverImage::add(std::span<const Eigen::Vector2d> corners) {
  const Eigen::Vector2d first(window_.left - margin_ - 0.5, window_.top - margin_ - 0.5);
  Eigen::Vector2d from = cells_ * (corners.back() - first);
  for (const Eigen::Vector2d& corner : corners) {
    const Eigen::Vector2d to = cells_ * (corner - first);
    add_edge(from, to);
    from = to;
  }
}

/// In cells from the grid's corner. In each row that it passes, the edge covers what lies to the right of it: the cells that it
/// crosses in part, all others beyond as a whole.
void CoverImage::add_edge(Eigen::Vector2d from, Eigen::Vector2d to) {
  if (from.y() == to.y()) return;
  // Clockwise in the image (y down), the left border runs upwards.
  const double sign = from.y() > to.y() ? 1.0 : -1.0;
  if (sign > 0.0) std::swap(from, to);
  const double rows = static_cast<double>(cells_) * (window_.height + 2 * margin_);
  const double columns = static_cast<double>(stride_) - 2.0;
  const double slope = (to.x() - from.x()) / (to.y() - from.y());
  const double begin = std::max(from.y(), 0.0);
  const double end = std::min(to.y(), rows);
  for (int row = static_cast<int>(begin); row < end; ++row) {
    const double y0 = std::max(begin, static_cast<double>(row));
    const double y1 = std::min(end, row + 1.0);
    const double height = y1 - y0;
    if (height <= 0.0) continue;
    double x0 = std::clamp(from.x() + slope * (y0 - from.y()), 0.0, columns);
    double x1 = std::clamp(from.x() + slope * (y1 - from.y()), 0.0, columns);
    if (x0 > x1) std::swap(x0, x1);
    float* const cells = change_.data() + row * stride_;
    const int i0 = static_cast<int>(x0);
    const int i1 = static_cast<int>(x1);
    if (i0 == i1) {
      const double covered = 1.0 - 0.5 * (x0 + x1 - 2.0 * i0);  // of the cell, to the right
      cells[i0] += static_cast<float>(sign * height * covered);
      cells[i0 + 1] += static_cast<float>(sign * height * (1.0 - covered));
      continue;
    }
    const double per_x = height / (x1 - x0);
    double before = 0.0;  // cover of the cell before
    for (int i = i0; i <= i1; ++i) {
      // The edge's part within this cell covers it by a trapezium, the part before by the whole width.
      const double a = std::max(x0, static_cast<double>(i));
      const double b = std::min(x1, i + 1.0);
      const double cover = per_x * ((a - x0) + (b - a) * (1.0 - 0.5 * (a + b - 2.0 * i)));
      cells[i] += static_cast<float>(sign * (cover - before));
      before = cover;
    }
    cells[i1 + 1] += static_cast<float>(sign * (height - before));
  }
}

BlurredCover CoverImage::blurred() const {
  const Kernel kernel = kernel_of(kernel_px_, cells_);
  const std::size_t taps = kernel.taps;
  const auto width = static_cast<std::size_t>(window_.width);
  const auto height = static_cast<std::size_t>(window_.height);
  const auto cells = static_cast<std::size_t>(cells_);
  const std::size_t stride = (width + kBlurPadding - 1) / kBlurPadding * kBlurPadding;
  const std::size_t rows = cells * (height + 2 * static_cast<std::size_t>(margin_));
  // Every cells-th cell of a row lies beside the next, so that the pixels' sums read them one after the other.
  const std::size_t per_phase = static_cast<std::size_t>(stride_) / cells + kBlurPadding + 2;
  std::vector<float> cover(cells * per_phase, 0.0F);
  std::vector<const float*> taps_at(taps);
  const auto first = static_cast<std::size_t>(margin_ * cells_ + kernel.first);
  for (std::size_t t = 0; t < taps; ++t) taps_at[t] = cover.data() + (first + t) % cells * per_phase + (first + t) / cells;
  std::array<std::vector<float>, kBlurOrders> across;  // blurred along the rows
  for (auto& values : across) values.assign(stride * rows, 0.0F);
  for (std::size_t row = 0; row < rows; ++row) {
    const float* const change = change_.data() + static_cast<std::ptrdiff_t>(row) * stride_;
    if (std::all_of(change, change + stride_, [](float value) { return value == 0.0F; })) continue;
    float sum = 0.0F;
    const auto count = static_cast<std::size_t>(stride_);
    for (std::size_t i = 0, phase = 0, at = 0; i < count; ++i) {
      sum += change[i];
      cover[phase * per_phase + at] = sum;
      if (++phase == cells) {
        phase = 0;
        ++at;
      }
    }
    float* const out[] = {across[0].data() + row * stride, across[1].data() + row * stride, across[2].data() + row * stride};
    weigh_rows(taps_at.data(), kernel.weights.data(), taps, stride, kBlurOrders, out);
  }
  BlurredCover result{window_, stride, {}, {}, {}, {}, {}, {}};
  for (auto* values : {&result.value, &result.x, &result.y, &result.xx, &result.xy, &result.yy})
    values->resize(stride * height);
  for (std::size_t y = 0; y < height; ++y) {
    const auto down = [&](std::size_t order, std::initializer_list<std::vector<float>*> results) {
      std::array<float*, kBlurOrders> out{};
      std::size_t orders = 0;
      for (std::vector<float>* values : results) out[orders++] = values->data() + y * stride;
      const auto top = static_cast<std::size_t>((static_cast<int>(y) + margin_) * cells_ + kernel.first);
      for (std::size_t t = 0; t < taps; ++t) taps_at[t] = across[order].data() + (top + t) * stride;
      weigh_rows(taps_at.data(), kernel.weights.data(), taps, stride, orders, out.data());
    };
    down(0, {&result.value, &result.y, &result.yy});
    down(1, {&result.x, &result.xy});
    down(2, {&result.xx});
  }
  return result;
}

}  // namespace crosstie::markers::detail
