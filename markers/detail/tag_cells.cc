#include "markers/detail/tag_cells.h"

#include <algorithm>
#include <optional>
#include <vector>

#include <Eigen/Cholesky>

namespace crosstie::markers::detail {
namespace {

constexpr int kSamples = 4;            // along each side of a cell
constexpr double kSampledShare = 0.5;  // of a cell's width: the middle

/// Mean grey level of the middle of a cell; nothing where it lies outside of the image.
std::optional<double> level_of(const Sampler& image, const TagFrame& frame, int x, int y) {
  double sum = 0.0;
  for (int j = 0; j < kSamples; ++j) {
    for (int i = 0; i < kSamples; ++i) {
      const auto at = [](int k) { return 0.5 + kSampledShare * ((k + 0.5) / kSamples - 0.5); };
      const Eigen::Vector2d p = frame.pixel({x + at(i), y + at(j)});
      if (!image.inside(p.x(), p.y())) return std::nullopt;
      sum += image.bilinear(p.x(), p.y());
    }
  }
  return sum / (kSamples * kSamples);
}

/// A level that changes linearly over the tag, by least squares.
class Plane {
 public:
  void add(int x, int y, double level) {
    const Eigen::Vector3d row(1.0, x, y);
    normal_ += row * row.transpose();
    right_ += level * row;
  }
  void solve() { coefficients_ = normal_.ldlt().solve(right_); }
  [[nodiscard]] double at(int x, int y) const { return coefficients_.dot(Eigen::Vector3d(1.0, x, y)); }

 private:
  Eigen::Matrix3d normal_ = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d coefficients_ = Eigen::Vector3d::Zero();
};

}  // namespace

TagReading read_cells(const Sampler& image, const TagPattern& pattern, const TagFrame& frame) {
  TagReading reading;
  const int cells = pattern.layout.total_cells;
  std::vector<double> levels;
  Plane black, white;
  for (int y = 0; y < cells; ++y) {
    for (int x = 0; x < cells; ++x) {
      const int cell = pattern.layout.at(x, y);
      const std::optional<double> level = cell == TagLayout::kFree ? 0.0 : level_of(image, frame, x, y);
      if (!level) {
        reading.cut = true;
        return reading;
      }
      levels.push_back(*level);
      if (cell == TagLayout::kBlack || cell == TagLayout::kWhite) (pattern.tone(x, y) > 0.5 ? white : black).add(x, y, *level);
    }
  }
  black.solve();
  white.solve();
  reading.contrast = white.at(cells / 2, cells / 2) - black.at(cells / 2, cells / 2);
  reading.margin = reading.border_margin = 1.0;
  for (int y = 0; y < cells; ++y) {
    for (int x = 0; x < cells; ++x) {
      const int cell = pattern.layout.at(x, y);
      if (cell == TagLayout::kFree) continue;
      const double low = black.at(x, y);
      const double contrast = white.at(x, y) - low;
      const double value = contrast > 0.0 ? (levels[static_cast<std::size_t>(y * cells + x)] - low) / contrast : 0.5;
      const double margin = (2.0 * value - 1.0) * (2.0 * pattern.tone(x, y) - 1.0);
      double& smallest = cell >= 0 ? reading.margin : reading.border_margin;
      smallest = std::min(smallest, margin);
    }
  }
  return reading;
}

}  // namespace crosstie::markers::detail
