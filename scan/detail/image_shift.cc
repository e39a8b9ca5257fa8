#include "scan/detail/image_shift.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "base/parallel.h"
#include "scan/detail/surface_kernel.h"

namespace crosstie::scan::detail {
namespace {

constexpr double kLeastLight = 0.02;    // of the white level: parts with less hold nothing
constexpr double kSaturated = 0.98;     // of the white level
constexpr int kLeastPixels = 200;       // of a part
constexpr double kChangedRatio = 3.0;   // of the residuals to the noise
constexpr double kChangedShare = 0.03;  // and to the light

}  // namespace

ImageShift::ImageShift(int width, int height)
    : width_(width),
      height_(height),
      rows_(std::max(1, static_cast<int>(std::lround(static_cast<double>(kColumns) * height / width)))),
      sums_(static_cast<std::size_t>(kColumns) * static_cast<std::size_t>(rows_)) {}

template <typename Sample>
void ImageShift::add_part(const base::ImageView& earlier, const base::ImageView& later, int column, int row,
                          double read_variance, double shot_variance) {
  const int left = std::max(1, column * width_ / kColumns);
  const int right = std::min(width_ - 1, (column + 1) * width_ / kColumns);
  const int top = std::max(1, row * height_ / rows_);
  const int bottom = std::min(height_ - 1, (row + 1) * height_ / rows_);
  const double limit = kSaturated * earlier.white_level;
  // Large images: every other row and more, since parts hold more pixels than are needed.
  constexpr int kEnough = 10000;
  const int every = std::max(1, (right - left) * (bottom - top) / kEnough);
  ShiftSums part;
  for (int y = top; y < bottom; y += every) {
    const auto rows = [&](const base::ImageView& image) {
      return ThreeRows<Sample>{image.row<Sample>(y - 1), image.row<Sample>(y), image.row<Sample>(y + 1)};
    };
    add_shift_sums(rows(earlier), rows(later), static_cast<std::size_t>(left), static_cast<std::size_t>(right), limit, part);
  }
  // By -gradient / 4 of both images' mean, level, 1.
  Eigen::Matrix4d normal;
  normal << part.xx / 16.0, part.xy / 16.0, -part.xh / 4.0, -part.x / 4.0,  //
      part.xy / 16.0, part.yy / 16.0, -part.yh / 4.0, -part.y / 4.0,        //
      -part.xh / 4.0, -part.yh / 4.0, part.hh, part.h,                      //
      -part.x / 4.0, -part.y / 4.0, part.h, part.count;
  const Eigen::Vector4d pull(-part.dx / 4.0, -part.dy / 4.0, part.dh, part.d);
  const double squares = part.dd, count = part.count;
  Sums& sums = sums_[static_cast<std::size_t>(row) * kColumns + static_cast<std::size_t>(column)];
  if (count < kLeastPixels) return;
  const double light = part.h / count;
  if (light < kLeastLight * earlier.white_level) return;
  sums.lit = true;
  // Gain and offset are eliminated; a ten-millionth of a level keeps a flat part from having no solution.
  const Eigen::Matrix2d others = normal.bottomRightCorner<2, 2>() + 1e-7 * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d coupling = normal.topRightCorner<2, 2>() * others.inverse();
  const Eigen::Matrix2d information = normal.topLeftCorner<2, 2>() - coupling * normal.bottomLeftCorner<2, 2>();
  const Eigen::Vector2d reduced = pull.head<2>() - coupling * pull.tail<2>();
  Eigen::Matrix4d damped = normal;
  damped.diagonal().array() += 1e-7;
  const double rest = std::max(0.0, squares - pull.dot(damped.ldlt().solve(pull))) / (count - 4.0);
  const double noise = 2.0 * (read_variance + shot_variance * light);
  sums.changed = sums.changed || (rest > kChangedRatio * kChangedRatio * noise && std::sqrt(rest) > kChangedShare * light);
  const double variance = std::max(rest, 1e-6);
  sums.information += information / variance;
  sums.pull += reduced / variance;
}

base::Result<> ImageShift::add(const base::ImageView& earlier, const base::ImageView& later, double read_variance,
                               double shot_variance, int threads) {
  return base::parallel_for(sums_.size(), threads, "stillness", {}, [&](std::size_t part) -> base::Result<> {
    const auto column = static_cast<int>(part % kColumns);
    const auto row = static_cast<int>(part / kColumns);
    if (earlier.bits == 8) {
      add_part<std::uint8_t>(earlier, later, column, row, read_variance, shot_variance);
    } else {
      add_part<std::uint16_t>(earlier, later, column, row, read_variance, shot_variance);
    }
    return {};
  });
}

ImageShift::Part ImageShift::solve(const Sums& sums) {
  Part part;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(sums.information);
  for (int i = 0; i < 2; ++i) {
    const double value = axes.eigenvalues()(i);
    if (!(value > 1.0 / (kSharp_px * kSharp_px))) continue;
    const double along = axes.eigenvectors().col(i).dot(sums.pull) / value;
    part.shift_px += along * axes.eigenvectors().col(i);
    part.statistic += along * along * value;
    part.told = true;
  }
  if (part.statistic > 0.0) part.sigma_px = part.shift_px.norm() / std::sqrt(part.statistic);
  return part;
}

std::vector<ImageShift::Part> ImageShift::parts() const {
  std::vector<Part> result;
  for (const Sums& sums : sums_) result.push_back(solve(sums));
  return result;
}

ImageShift::Part ImageShift::whole() const {
  Sums all;
  for (const Sums& sums : sums_) {
    all.information += sums.information;
    all.pull += sums.pull;
  }
  return solve(all);
}

double ImageShift::changed() const {
  const auto lit = std::count_if(sums_.begin(), sums_.end(), [](const Sums& sums) { return sums.lit; });
  const auto changed = std::count_if(sums_.begin(), sums_.end(), [](const Sums& sums) { return sums.changed; });
  return lit > 0 ? static_cast<double>(changed) / static_cast<double>(lit) : 0.0;
}

}  // namespace crosstie::scan::detail
