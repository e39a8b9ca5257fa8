#include "scan/detail/matcher.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/LU>

#include "math/median.h"
#include "scan/detail/guard.h"
#include "scan/detail/rows.h"
#include "scan/detail/smooth.h"

namespace crosstie::scan::detail {
namespace {

/// Pixels to either side over which phases are averaged so that their slope is known to a tenth.
int smoothing_radius(const MatchTarget& target) {
  constexpr int kSampleEvery = 7;
  constexpr int kMost = 6;
  std::vector<float> sigmas;
  for (int y = 0; y < target.height; y += kSampleEvery) {
    for (int x = 0; x < target.width; x += kSampleEvery) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(target.width) + static_cast<std::size_t>(x);
      if (target.good[at]) sigmas.push_back(target.first->sigma_turns[at]);
    }
  }
  // Means about neighbours share all pixels but two columns: their difference has the sigma sqrt(2 (2 r + 1)) sigma / (2 r + 1)^2.
  const double ratio = math::median(sigmas) / std::abs(target.slope);
  int radius = 0;
  while (radius < kMost && std::numbers::sqrt2 * ratio / std::pow(2.0 * radius + 1.0, 1.5) > 0.1) ++radius;
  return radius;
}

/// Where the places of a row lie, from those of a batch: a line over the columns.
class Line {
 public:
  void fit(std::span<const LeftPixel> pixels, std::span<const Match> matches) {
    known_ = false;
    const auto found = [](const Match& match) { return match.outcome != MatchOutcome::kNone; };
    const auto first = std::find_if(matches.begin(), matches.end(), found) - matches.begin();
    const auto last = static_cast<std::ptrdiff_t>(matches.size()) - 1 -
                      (std::find_if(matches.rbegin(), matches.rend(), found) - matches.rbegin());
    if (last - first < kLeastSpan) return;
    const Match& one = matches[static_cast<std::size_t>(first)];
    const Match& other = matches[static_cast<std::size_t>(last)];
    from_ = pixels[static_cast<std::size_t>(last)].column;
    place_px_ = other.place_px;
    by_column_ = (other.place_px - one.place_px) / (from_ - pixels[static_cast<std::size_t>(first)].column);
    known_ = true;
  }

  [[nodiscard]] bool known() const { return known_; }
  [[nodiscard]] Eigen::Vector2d at(int column) const { return place_px_ + (column - from_) * by_column_; }

 private:
  static constexpr std::ptrdiff_t kLeastSpan = 4;  // pixels: over fewer, their noise is a large part of the slope
  bool known_ = false;
  int from_ = 0;
  Eigen::Vector2d place_px_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d by_column_ = Eigen::Vector2d::Zero();
};

}  // namespace

/// Right pixels by both coordinates, those at the upper left of a cell where matches may lie.
class Matcher::Table {
 public:
  Table(const MatchTarget& target, const std::vector<float>& b, double step_b)
      : width_(target.width), step_a_(std::abs(target.slope)), step_b_(step_b) {
    const std::vector<float>& a = target.first_smooth;
    const auto w = static_cast<std::size_t>(target.width);
    float a_max = -1e30F, b_max = -1e30F;
    a_min_ = b_min_ = 1e30F;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (!target.good[i]) continue;
      a_min_ = std::min(a_min_, a[i]);
      a_max = std::max(a_max, a[i]);
      b_min_ = std::min(b_min_, b[i]);
      b_max = std::max(b_max, b[i]);
    }
    if (a_max < a_min_) return;
    constexpr double kMost = 8192.0;
    step_a_ = std::max(step_a_, static_cast<double>(a_max - a_min_) / kMost);
    step_b_ = std::max(step_b_, static_cast<double>(b_max - b_min_) / kMost);
    columns_ = static_cast<int>(static_cast<double>(a_max - a_min_) / step_a_) + 1;
    rows_ = static_cast<int>(static_cast<double>(b_max - b_min_) / step_b_) + 1;
    pixels_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_), -1);
    for (std::size_t i = 0; i + w + 1 < a.size(); ++i) {
      const bool is_cell = target.good[i] && target.good[i + 1] && target.good[i + w] && target.good[i + w + 1];
      if (is_cell && (i + 1) % w != 0) pixels_[cell(column(a[i]), row(b[i]))] = static_cast<std::int32_t>(i);
    }
  }

  /// The middle of a cell with nearly these coordinates, beside the image where there is none.
  [[nodiscard]] Eigen::Vector2d near(float a, float b) const {
    constexpr int kReach = 2;
    const int c = column(a);
    const int r = row(b);
    if (c < -kReach || c >= columns_ + kReach || r < -kReach || r >= rows_ + kReach) return kNowhere_px;
    for (int reach = 0; reach <= kReach; ++reach) {
      for (int dr = -reach; dr <= reach; ++dr) {
        for (int dc = -reach; dc <= reach; ++dc) {
          if (std::max(std::abs(dr), std::abs(dc)) != reach || c + dc < 0 || c + dc >= columns_ || r + dr < 0 ||
              r + dr >= rows_)
            continue;
          const std::int32_t pixel = pixels_[cell(c + dc, r + dr)];
          if (pixel >= 0) return {pixel % width_ + 0.5, pixel / width_ + 0.5};
        }
      }
    }
    return kNowhere_px;
  }

 private:
  [[nodiscard]] int column(float a) const { return index((static_cast<double>(a) - static_cast<double>(a_min_)) / step_a_); }
  [[nodiscard]] int row(float b) const { return index((static_cast<double>(b) - static_cast<double>(b_min_)) / step_b_); }
  [[nodiscard]] static int index(double at) { return static_cast<int>(std::clamp(std::floor(at), -10.0, 1e5)); }
  [[nodiscard]] std::size_t cell(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  }

  inline static const Eigen::Vector2d kNowhere_px = Eigen::Vector2d::Constant(-1.0);
  int width_;
  double step_a_, step_b_;
  float a_min_ = 0.0F, b_min_ = 0.0F;
  int columns_ = 0, rows_ = 0;
  std::vector<std::int32_t> pixels_;
};

double slope_along_curves(const MatchTarget& target) {
  constexpr int kSampleEvery = 5;
  std::vector<double> slopes;
  const auto w = static_cast<std::size_t>(target.width);
  for (int y = 0; y + 1 < target.height; y += kSampleEvery) {
    for (int x = 0; x + 1 < target.width; x += kSampleEvery) {
      const auto at = static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x);
      if (!target.good[at] || !target.good[at + 1] || !target.good[at + w] || !target.good[at + w + 1]) continue;
      // In the middle of the cell of four pixels.
      const auto by_pixel = [&](std::span<const float> plane) -> Eigen::Vector2d {
        const double rising = static_cast<double>(plane[at + w + 1]) - plane[at];
        const double falling = static_cast<double>(plane[at + 1]) - plane[at + w];
        return {0.5 * (rising + falling), 0.5 * (rising - falling)};
      };
      Eigen::Matrix2d rectified;
      rectified << by_pixel(target.x_px).transpose(), by_pixel(target.y_px).transpose();
      const Eigen::Vector2d along = Eigen::Vector2d(rectified(1, 1), -rectified(1, 0)) / rectified.determinant();
      const double slope = by_pixel(target.first->turns).dot(along);
      if (std::isfinite(slope)) slopes.push_back(slope);
    }
  }
  return math::median(slopes);
}

void smooth_phases(MatchTarget& target, int threads) {
  const int radius = smoothing_radius(target);
  const auto smooth = [&](const base::PhasePlane& plane) {
    std::vector<float> result = box_mean(plane.turns, target.good, target.width, target.height, radius, threads);
    over_rows(target.height, threads, [&](int first, int last) {
      const auto w = static_cast<std::size_t>(target.width);
      for (std::size_t i = static_cast<std::size_t>(first) * w; i < static_cast<std::size_t>(last) * w; ++i) {
        if (!target.good[i]) result[i] = std::numeric_limits<float>::quiet_NaN();
      }
    });
    return result;
  };
  target.first_smooth = smooth(*target.first);
  if (target.second != nullptr) target.second_smooth = smooth(*target.second);
}

Matcher::Matcher(const MatchTarget& target, const MatchOptions& options) : target_(target), options_(options) {
  planes_.a_smooth = target.first_smooth.data();
  planes_.a_raw = target.first->turns.data();
  planes_.a_sigma = target.first->sigma_turns.data();
  const std::vector<float>& second = target.second != nullptr ? target.second_smooth : target.y_px;
  planes_.b_smooth = second.data();
  double second_step = 1.0;
  if (target.second != nullptr) {
    planes_.b_raw = target.second->turns.data();
    planes_.b_sigma = target.second->sigma_turns.data();
    second_step = std::max(1e-6, median_slope(*target.second, target.width, target.height));
  }
  planes_.x_px = target.x_px.data();
  planes_.y_px = target.y_px.data();
  planes_.width = target.width;
  planes_.height = target.height;
  planes_.slope = static_cast<float>(target.slope);
  planes_.min_slope = static_cast<float>(options.min_slope);
  table_ = std::make_unique<Table>(target, second, second_step);
}

Matcher::~Matcher() = default;

void Matcher::find_row(std::span<const LeftPixel> pixels, std::span<Match> matches) const {
  Line line;
  for (std::size_t from = 0; from < pixels.size(); from += MatchBatch::kSize) {
    const std::size_t count = std::min(MatchBatch::kSize, pixels.size() - from);
    const auto some = pixels.subspan(from, count);
    const auto found = matches.subspan(from, count);
    std::fill(found.begin(), found.end(), Match{});
    bool all = line.known() && find_from(some, found, [&](const LeftPixel& pixel) { return line.at(pixel.column); });
    if (!all) find_from(some, found, [&](const LeftPixel& pixel) { return table_->near(pixel.a, pixel.b); });
    line.fit(some, found);
  }
}

template <typename Start>
bool Matcher::find_from(std::span<const LeftPixel> pixels, std::span<Match> matches, const Start& start) const {
  MatchBatch batch;
  batch.column.fill(-1.0F);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (matches[i].outcome != MatchOutcome::kNone) continue;
    const Eigen::Vector2d place = start(pixels[i]);
    batch.column[i] = static_cast<float>(place.x());
    batch.row[i] = static_cast<float>(place.y());
    batch.a[i] = pixels[i].a;
    batch.b[i] = pixels[i].b;
    batch.a_sigma[i] = pixels[i].sigma_a;
    batch.b_sigma[i] = pixels[i].sigma_b;
    batch.curve_px[i] = pixels[i].curve_px;
  }
  match_batch(planes_, batch);
  bool all = true;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    Match& match = matches[i];
    if (match.outcome != MatchOutcome::kNone) continue;
    all = all && batch.found[i];
    if (!batch.found[i]) continue;
    match.place_px = {batch.column[i], batch.row[i]};
    match.x_px = static_cast<double>(target_.x_px[static_cast<std::size_t>(batch.cell[i])]) + batch.beside_px[i];
    match.sigma_px = batch.sigma_px[i];
    match.off_px = batch.off_px[i];
    const double limit = options_.max_epipolar_px + options_.max_epipolar_sigmas * static_cast<double>(batch.off_sigma_px[i]);
    const bool off = target_.second != nullptr && std::abs(match.off_px) > limit;
    match.outcome = off ? MatchOutcome::kOffCurve : MatchOutcome::kMatched;
  }
  return all;
}

}  // namespace crosstie::scan::detail
