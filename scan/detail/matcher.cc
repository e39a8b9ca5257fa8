#include "scan/detail/matcher.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/LU>

#include "math/median.h"
#include "scan/detail/guard.h"
#include "scan/detail/match_kernel.h"
#include "scan/detail/rows.h"
#include "scan/detail/smooth.h"

namespace crosstie::scan::detail {
namespace {

constexpr int kMaxCells = 8;    // steps from cell to cell on the way to the right place
constexpr int kLeastSize = 16;  // pixels of an image that batches ask for

/// A plane's values at the four pixels of a cell.
struct Cell {
  double v00, v10, v01, v11;

  Cell(const std::vector<float>& plane, std::size_t at, std::size_t width)
      : v00(plane[at]), v10(plane[at + 1]), v01(plane[at + width]), v11(plane[at + width + 1]) {}
  [[nodiscard]] double at(double u, double v) const {
    return (1.0 - v) * ((1.0 - u) * v00 + u * v10) + v * ((1.0 - u) * v01 + u * v11);
  }
  [[nodiscard]] Eigen::RowVector2d slope(double u, double v) const {
    return {(1.0 - v) * (v10 - v00) + v * (v11 - v01), (1.0 - u) * (v01 - v00) + u * (v11 - v10)};
  }
};

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

/// Right pixels by both coordinates.
class Matcher::Table {
 public:
  Table(const MatchTarget& target, const std::vector<float>& a, const std::vector<float>& b, double step_a, double step_b)
      : step_a_(step_a), step_b_(step_b) {
    float a_max = -1e30F, b_max = -1e30F;
    a_min_ = b_min_ = 1e30F;
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (!target.good[i] || std::isnan(b[i])) continue;
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
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (target.good[i] && !std::isnan(b[i])) pixels_[cell(column(a[i]), row(b[i]))] = static_cast<std::int32_t>(i);
    }
  }

  /// A right pixel with nearly these coordinates, -1: there is none.
  [[nodiscard]] std::int32_t near(float a, float b) const {
    constexpr int kReach = 2;
    const int c = column(a);
    const int r = row(b);
    if (c < -kReach || c >= columns_ + kReach || r < -kReach || r >= rows_ + kReach) return -1;
    for (int reach = 0; reach <= kReach; ++reach) {
      for (int dr = -reach; dr <= reach; ++dr) {
        for (int dc = -reach; dc <= reach; ++dc) {
          if (std::max(std::abs(dr), std::abs(dc)) != reach || c + dc < 0 || c + dc >= columns_ || r + dr < 0 ||
              r + dr >= rows_)
            continue;
          const std::int32_t pixel = pixels_[cell(c + dc, r + dr)];
          if (pixel >= 0) return pixel;
        }
      }
    }
    return -1;
  }

 private:
  [[nodiscard]] int column(float a) const { return index((static_cast<double>(a) - static_cast<double>(a_min_)) / step_a_); }
  [[nodiscard]] int row(float b) const { return index((static_cast<double>(b) - static_cast<double>(b_min_)) / step_b_); }
  [[nodiscard]] static int index(double at) { return static_cast<int>(std::clamp(std::floor(at), -10.0, 1e5)); }
  [[nodiscard]] std::size_t cell(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(column);
  }

  double step_a_, step_b_;
  float a_min_ = 0.0F, b_min_ = 0.0F;
  int columns_ = 0, rows_ = 0;
  std::vector<std::int32_t> pixels_;
};

/// A place in the right image.
struct Matcher::Place {
  std::size_t cell = 0;  ///< index of its upper left pixel
  double u = 0.0, v = 0.0;
  Eigen::RowVector2d by_a = Eigen::RowVector2d::Zero();  ///< slopes of the coordinates' smooth planes there
  Eigen::RowVector2d by_b = Eigen::RowVector2d::Zero();
};

double slope_along_curves(const MatchTarget& target) {
  constexpr int kSampleEvery = 5;
  std::vector<double> slopes;
  const auto w = static_cast<std::size_t>(target.width);
  for (int y = 0; y + 1 < target.height; y += kSampleEvery) {
    for (int x = 0; x + 1 < target.width; x += kSampleEvery) {
      const auto at = static_cast<std::size_t>(y) * w + static_cast<std::size_t>(x);
      if (!target.good[at] || !target.good[at + 1] || !target.good[at + w] || !target.good[at + w + 1]) continue;
      const Cell a(target.first->turns, at, w);
      const Cell cell_x(target.x_px, at, w);
      const Cell cell_y(target.y_px, at, w);
      Eigen::Matrix2d rectified;
      rectified << cell_x.slope(0.5, 0.5), cell_y.slope(0.5, 0.5);
      const double slope = a.slope(0.5, 0.5).dot(Eigen::Vector2d(rectified(1, 1), -rectified(1, 0)) / rectified.determinant());
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

Matcher::Matcher(const MatchTarget& target, const MatchOptions& options)
    : width_(static_cast<std::size_t>(target.width)),
      height_(static_cast<std::size_t>(target.height)),
      target_(target),
      options_(options) {
  const double step =
      target.second == nullptr ? 1.0 : std::max(1e-6, median_slope(*target.second, target.width, target.height));
  table_ = std::make_unique<Table>(target, target.first_smooth, second_plane(), std::abs(target.slope), step);
}

Matcher::~Matcher() = default;

const std::vector<float>& Matcher::second_plane() const {
  return target_.second != nullptr ? target_.second_smooth : target_.y_px;
}

MatchOutcome Matcher::judged(double off_px, double off_sigma_px) const {
  const double limit = options_.max_epipolar_px + options_.max_epipolar_sigmas * off_sigma_px;
  return std::abs(off_px) > limit ? MatchOutcome::kOffCurve : MatchOutcome::kMatched;
}

Match Matcher::find(const LeftPixel& pixel) const {
  Match match;
  const std::int32_t start = table_->near(pixel.a, pixel.b);
  Place place;
  if (start < 0 || !walk(static_cast<std::size_t>(start), pixel.a, pixel.b, place)) return match;
  const Cell cell_x(target_.x_px, place.cell, width_);
  const Cell cell_y(target_.y_px, place.cell, width_);
  Eigen::Matrix2d rectified;  // d (x, y) rectified / d (u, v)
  rectified << cell_x.slope(place.u, place.v), cell_y.slope(place.u, place.v);
  const double determinant = rectified.determinant();
  if (!(std::abs(determinant) > 1e-6)) return match;
  const Eigen::Vector2d along =
      Eigen::Vector2d(rectified(1, 1), -rectified(1, 0)) / determinant;  // px of the image per px of the curve
  const double slope = place.by_a.dot(along);
  if (slope * target_.slope < options_.min_slope * target_.slope * target_.slope) return match;
  const double missing_a = static_cast<double>(pixel.a) - value_at(target_.first->turns, target_.first_smooth, place);
  const double variance_a = static_cast<double>(pixel.sigma_a) * pixel.sigma_a + interpolated_variance(*target_.first, place);
  match.place_px = {static_cast<double>(place.cell % width_) + place.u, static_cast<double>(place.cell / width_) + place.v};
  match.x_px = cell_x.at(place.u, place.v);
  if (target_.second == nullptr) {
    match.x_px += missing_a / slope;
    match.sigma_px = std::sqrt(variance_a) / std::abs(slope);
    match.outcome = MatchOutcome::kMatched;
    return match;
  }
  Eigen::Matrix2d phases;
  phases << place.by_a, place.by_b;
  if (!(std::abs(phases.determinant()) > 1e-12)) return match;
  const double missing_b = static_cast<double>(pixel.b) - value_at(target_.second->turns, target_.second_smooth, place);
  const double variance_b = static_cast<double>(pixel.sigma_b) * pixel.sigma_b + interpolated_variance(*target_.second, place);
  const Eigen::Matrix2d by_phases = rectified * phases.inverse();
  const Eigen::Matrix2d cov = by_phases * Eigen::Vector2d(variance_a, variance_b).asDiagonal() * by_phases.transpose();
  const Eigen::Vector2d rest = by_phases * Eigen::Vector2d(missing_a, missing_b);
  match.off_px = cell_y.at(place.u, place.v) + rest.y() - static_cast<double>(pixel.curve_px);
  match.off_sigma_px = std::sqrt(cov(1, 1));
  // Of all places on the curve the likeliest.
  match.x_px += rest.x() - cov(0, 1) / cov(1, 1) * match.off_px;
  match.sigma_px = std::sqrt(std::max(0.0, cov(0, 0) - cov(0, 1) * cov(0, 1) / cov(1, 1)));
  match.outcome = judged(match.off_px, match.off_sigma_px);
  return match;
}

void Matcher::find_row(std::span<const LeftPixel> pixels, std::span<Match> matches) const {
  MatchPlanes planes;
  planes.a_smooth = target_.first_smooth.data();
  planes.b_smooth = second_plane().data();
  planes.a_raw = target_.first->turns.data();
  planes.a_sigma = target_.first->sigma_turns.data();
  if (target_.second != nullptr) {
    planes.b_raw = target_.second->turns.data();
    planes.b_sigma = target_.second->sigma_turns.data();
  }
  planes.x_px = target_.x_px.data();
  planes.y_px = target_.y_px.data();
  planes.width = target_.width;
  planes.height = target_.height;
  planes.slope = static_cast<float>(target_.slope);
  planes.min_slope = static_cast<float>(options_.min_slope);
  const bool batches = target_.width >= kLeastSize && target_.height >= kLeastSize;
  Line line;
  MatchBatch batch;
  for (std::size_t from = 0; from < pixels.size(); from += MatchBatch::kSize) {
    const std::span<const LeftPixel> some = pixels.subspan(from, std::min(MatchBatch::kSize, pixels.size() - from));
    for (std::size_t i = 0; i < some.size(); ++i) {
      batch.a[i] = some[i].a;
      batch.b[i] = some[i].b;
      batch.a_sigma[i] = some[i].sigma_a;
      batch.b_sigma[i] = some[i].sigma_b;
      batch.curve_px[i] = some[i].curve_px;
      const Eigen::Vector2d place = line.at(some[i].column);
      batch.column[i] = static_cast<float>(place.x());
      batch.row[i] = static_cast<float>(place.y());
    }
    if (batches && line.known()) {
      match_batch(planes, batch);
    } else {
      batch.found.fill(0);
    }
    for (std::size_t i = 0; i < some.size(); ++i) {
      Match& match = matches[from + i];
      if (!batch.found[i]) {
        match = find(some[i]);
        continue;
      }
      match.place_px = {batch.column[i], batch.row[i]};
      match.x_px = static_cast<double>(target_.x_px[static_cast<std::size_t>(batch.cell[i])]) + batch.beside_px[i];
      match.sigma_px = batch.sigma_px[i];
      match.off_px = batch.off_px[i];
      match.off_sigma_px = batch.off_sigma_px[i];
      match.outcome = target_.second == nullptr ? MatchOutcome::kMatched : judged(match.off_px, match.off_sigma_px);
    }
    line.fit(some, matches.subspan(from, some.size()));
  }
}

/// Between pixels: linear, less what a curve falls short of its chord, by the bending of the plane with less noise.
double Matcher::value_at(const std::vector<float>& plane, const std::vector<float>& smooth, const Place& place) const {
  const double linear = Cell(plane, place.cell, width_).at(place.u, place.v);
  // Over so many pixels that its noise is a hundredth of a pixel's.
  const auto bend = [&](std::size_t along, std::size_t across) -> double {
    constexpr std::size_t kReach = 3;  // pixels to either side of the cell, along it
    double sum = 0.0;
    for (const std::size_t at : {place.cell, place.cell + across}) {
      sum += static_cast<double>(smooth[at + (kReach + 1) * along] - smooth[at + along] - smooth[at] +
                                 smooth[at - kReach * along]);
    }
    return std::isnan(sum) ? 0.0 : 0.5 * sum / (kReach * (kReach + 1));  // of two lines the mean
  };
  const std::size_t column = place.cell % width_;
  const std::size_t row = place.cell / width_;
  constexpr std::size_t kMargin = 4;
  if (column < kMargin || row < kMargin || column + kMargin >= width_ || row + kMargin >= height_) return linear;
  return linear - 0.5 * (place.u * (1.0 - place.u) * bend(1, width_) + place.v * (1.0 - place.v) * bend(width_, 1));
}

/// From a pixel to the cell in which both coordinates are met.
bool Matcher::walk(std::size_t start, float a, float b, Place& place) const {
  constexpr double kSlack = 1e-3;
  auto x = static_cast<std::ptrdiff_t>(start % width_);
  auto y = static_cast<std::ptrdiff_t>(start / width_);
  double u = 0.5, v = 0.5;
  for (int step = 0; step < kMaxCells; ++step) {
    if (x < 0 || y < 0 || x + 1 >= static_cast<std::ptrdiff_t>(width_) || y + 1 >= static_cast<std::ptrdiff_t>(height_))
      return false;
    const std::size_t at = static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x);
    if (!target_.good[at] || !target_.good[at + 1] || !target_.good[at + width_] || !target_.good[at + width_ + 1]) {
      if (step > 0) return false;
      // The start is the cell's lower or right pixel.
      if (x > 0 && target_.good[at - 1]) --x;
      if (y > 0 && target_.good[at - width_]) --y;
      if (static_cast<std::size_t>(y) * width_ + static_cast<std::size_t>(x) == at) return false;
      continue;
    }
    const Cell cell_a(target_.first_smooth, at, width_);
    const Cell cell_b(second_plane(), at, width_);
    Eigen::RowVector2d da, db;
    for (int newton = 0; newton < 3; ++newton) {
      da = cell_a.slope(u, v);
      db = cell_b.slope(u, v);
      const double determinant = da.x() * db.y() - da.y() * db.x();
      if (!(std::abs(determinant) > 1e-12)) return false;
      const double ra = static_cast<double>(a) - cell_a.at(u, v);
      const double rb = static_cast<double>(b) - cell_b.at(u, v);
      const double du = (ra * db.y() - rb * da.y()) / determinant;
      const double dv = (rb * da.x() - ra * db.x()) / determinant;
      u = std::clamp(u + du, -20.0, 20.0);
      v = std::clamp(v + dv, -20.0, 20.0);
      if (std::abs(du) + std::abs(dv) < 1e-4) break;
    }
    if (u >= -kSlack && u <= 1.0 + kSlack && v >= -kSlack && v <= 1.0 + kSlack) {
      place = {at, u, v, da, db};
      return true;
    }
    const double move_x = std::floor(u);
    const double move_y = std::floor(v);
    x += static_cast<std::ptrdiff_t>(move_x);
    y += static_cast<std::ptrdiff_t>(move_y);
    u -= move_x;
    v -= move_y;
  }
  return false;
}

double Matcher::interpolated_variance(const base::PhasePlane& plane, const Place& place) const {
  const std::array<std::pair<std::size_t, double>, 4> parts = {{{place.cell, (1.0 - place.u) * (1.0 - place.v)},
                                                                {place.cell + 1, place.u * (1.0 - place.v)},
                                                                {place.cell + width_, (1.0 - place.u) * place.v},
                                                                {place.cell + width_ + 1, place.u * place.v}}};
  double sum = 0.0;
  for (const auto& [pixel, weight] : parts) sum += std::pow(weight * static_cast<double>(plane.sigma_turns[pixel]), 2);
  return sum;
}

}  // namespace crosstie::scan::detail
