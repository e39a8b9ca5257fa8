#include "scan/match.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <fmt/format.h>
#include <Eigen/LU>

#include "base/parallel.h"
#include "math/median.h"
#include "scan/detail/guard.h"
#include "scan/detail/rectification.h"
#include "scan/detail/rectified_map.h"
#include "scan/detail/rows.h"
#include "scan/detail/smooth.h"

namespace crosstie::scan {
namespace {

using base::ErrorCode;
using base::fail;
using base::PhaseMap;
using base::PhasePlane;
using base::Result;

constexpr float kNowhere = std::numeric_limits<float>::quiet_NaN();
constexpr int kRowsPerTask = 16;
constexpr int kMaxCells = 8;  // steps from cell to cell on the way to the right place

/// Two coordinates of each right pixel by which left pixels find it: a phase, and the other phase or the epipolar curve.
struct Target {
  const PhasePlane* first = nullptr;
  const PhasePlane* second = nullptr;  ///< null: the curve
  std::vector<float>
      first_smooth;  ///< the phases with less noise: they tell where to look and how phases change there, while the
  std::vector<float> second_smooth;  ///< raw ones tell where the place is
  std::vector<float> x_px;           ///< rectified, times the focal length
  std::vector<float> y_px;
  std::vector<char> good;
  std::vector<char> long_row, long_column;  ///< whether all pixels are good from kBendReach before to one more behind, along it
  double slope = 0.0;                       ///< median change of the first phase over a pixel along the curves, with its sign
};

constexpr int kBendReach = 3;

/// Fills long_row and long_column.
void mark_long(Target& target, int width, int height, int threads) {
  const auto w = static_cast<std::size_t>(width);
  target.long_row.assign(target.good.size(), 0);
  target.long_column.assign(target.good.size(), 0);
  detail::over_rows(height, threads, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      const std::size_t at = static_cast<std::size_t>(y) * w;
      const char* good = &target.good[at];
      for (std::size_t x = kBendReach; x + kBendReach + 1 < w; ++x) {
        const char* g = good + x;
        target.long_row[at + x] = static_cast<char>(g[-3] & g[-2] & g[-1] & g[0] & g[1] & g[2] & g[3] & g[4]);
      }
      if (y < kBendReach || y + kBendReach + 1 >= height) continue;
      for (std::size_t x = 0; x < w; ++x) {
        const char* g = good + x;
        const auto d = static_cast<std::ptrdiff_t>(w);
        target.long_column[at + x] =
            static_cast<char>(g[-3 * d] & g[-2 * d] & g[-d] & g[0] & g[d] & g[2 * d] & g[3 * d] & g[4 * d]);
      }
    }
  });
  static_assert(kBendReach == 3);
}

/// Right pixels by both coordinates.
class Table {
 public:
  Table(const Target& target, const std::vector<float>& a, const std::vector<float>& b, double step_a, double step_b)
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
    const int c = column(a);
    const int r = row(b);
    for (int reach = 0; reach <= 2; ++reach) {
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

/// A place in the right image.
struct Place {
  std::size_t cell = 0;  ///< index of its upper left pixel
  double u = 0.0, v = 0.0;
  Eigen::RowVector2d by_a = Eigen::RowVector2d::Zero();  ///< slopes of the coordinates' planes there
  Eigen::RowVector2d by_b = Eigen::RowVector2d::Zero();
};

/// Where the next left pixel of a row may have its place: as far on from the last one as that from the one before.
class Guess {
 public:
  [[nodiscard]] bool known() const { return places_ > 1; }
  [[nodiscard]] Eigen::Vector2d next() const { return 2.0 * last_ - before_; }
  void add(const Eigen::Vector2d& place) {
    before_ = last_;
    last_ = place;
    ++places_;
  }
  void forget() { places_ = 0; }

 private:
  Eigen::Vector2d last_ = Eigen::Vector2d::Zero();
  Eigen::Vector2d before_ = Eigen::Vector2d::Zero();
  int places_ = 0;
};

struct Match {
  double x_px = 0.0;      ///< rectified
  double sigma_px = 0.0;  ///< of x_px
  double off_px = 0.0;    ///< rectified y minus the curve's
  double off_sigma_px = 0.0;
};

enum class Outcome { kMatched, kNone, kOffCurve };

class Matcher {
 public:
  Matcher(const PhaseMap& map, const Target& target, const MatchOptions& options)
      : width_(static_cast<std::size_t>(map.width)),
        height_(static_cast<std::size_t>(map.height)),
        target_(target),
        options_(options),
        table_(target, target.first_smooth, second_plane(), std::abs(target.slope), second_step(map)) {}

  /// The place with the coordinates (a, b) and what it says of the left pixel whose curve is y_px. `guess` is that of the pixel's row.
  [[nodiscard]] Outcome find(float a, float sigma_a, float b, float sigma_b, float y_px, Guess& guess, Match& match) const {
    Place place;
    if (!guess.known() || !walk(guess.next(), a, b, place)) {
      guess.forget();
      const std::int32_t start = table_.near(a, b);
      if (start < 0) return Outcome::kNone;
      const auto pixel = static_cast<std::size_t>(start);
      const Eigen::Vector2d middle(static_cast<double>(pixel % width_) + 0.5, static_cast<double>(pixel / width_) + 0.5);
      if (!walk(middle, a, b, place)) return Outcome::kNone;
    }
    guess.add({static_cast<double>(place.cell % width_) + place.u, static_cast<double>(place.cell / width_) + place.v});
    const Cell cell_x(target_.x_px, place.cell, width_);
    const Cell cell_y(target_.y_px, place.cell, width_);
    Eigen::Matrix2d rectified;  // d (x, y) rectified / d (u, v)
    rectified << cell_x.slope(place.u, place.v), cell_y.slope(place.u, place.v);
    const double determinant = rectified.determinant();
    if (!(std::abs(determinant) > 1e-6)) return Outcome::kNone;
    const Eigen::Vector2d along =
        Eigen::Vector2d(rectified(1, 1), -rectified(1, 0)) / determinant;  // px of the image per px of the curve
    const double slope = place.by_a.dot(along);
    if (slope * target_.slope < options_.min_slope * target_.slope * target_.slope) return Outcome::kNone;
    const double missing_a = static_cast<double>(a) - value_at(target_.first->turns, target_.first_smooth, place);
    const double variance_a = static_cast<double>(sigma_a) * sigma_a + interpolated_variance(*target_.first, place);
    match.x_px = cell_x.at(place.u, place.v);
    if (target_.second == nullptr) {
      match.x_px += missing_a / slope;
      match.sigma_px = std::sqrt(variance_a) / std::abs(slope);
      return Outcome::kMatched;
    }
    Eigen::Matrix2d phases;
    phases << place.by_a, place.by_b;
    if (!(std::abs(phases.determinant()) > 1e-12)) return Outcome::kNone;
    const double missing_b = static_cast<double>(b) - value_at(target_.second->turns, target_.second_smooth, place);
    const double variance_b = static_cast<double>(sigma_b) * sigma_b + interpolated_variance(*target_.second, place);
    const Eigen::Matrix2d by_phases = rectified * phases.inverse();
    const Eigen::Matrix2d cov = by_phases * Eigen::Vector2d(variance_a, variance_b).asDiagonal() * by_phases.transpose();
    const Eigen::Vector2d rest = by_phases * Eigen::Vector2d(missing_a, missing_b);
    match.off_px = cell_y.at(place.u, place.v) + rest.y() - static_cast<double>(y_px);
    match.off_sigma_px = std::sqrt(cov(1, 1));
    // Of all places on the curve the likeliest.
    match.x_px += rest.x() - cov(0, 1) / cov(1, 1) * match.off_px;
    match.sigma_px = std::sqrt(std::max(0.0, cov(0, 0) - cov(0, 1) * cov(0, 1) / cov(1, 1)));
    return std::abs(match.off_px) > options_.max_epipolar_px + options_.max_epipolar_sigmas * match.off_sigma_px
               ? Outcome::kOffCurve
               : Outcome::kMatched;
  }

 private:
  /// Between pixels: linear, less what a curve falls short of its chord, by the bending of the plane with less noise.
  [[nodiscard]] double value_at(const std::vector<float>& plane, const std::vector<float>& smooth, const Place& place) const {
    const double linear = Cell(plane, place.cell, width_).at(place.u, place.v);
    // Over so many pixels that its noise is a hundredth of a pixel's.
    const auto bend = [&](const std::vector<char>& whole, std::size_t along, std::size_t across) -> double {
      constexpr double kArms = kBendReach * (kBendReach + 1);
      if (!whole[place.cell] || !whole[place.cell + across]) return 0.0;
      double sum = 0.0;
      for (const std::size_t at : {place.cell, place.cell + across}) {
        sum += static_cast<double>(smooth[at + (kBendReach + 1) * along] - smooth[at + along] - smooth[at] +
                                   smooth[at - kBendReach * along]);
      }
      return 0.5 * sum / kArms;  // of two lines the mean
    };
    return linear - 0.5 * (place.u * (1.0 - place.u) * bend(target_.long_row, 1, width_) +
                           place.v * (1.0 - place.v) * bend(target_.long_column, width_, 1));
  }

  [[nodiscard]] const std::vector<float>& second_plane() const {
    return target_.second != nullptr ? target_.second_smooth : target_.y_px;
  }
  [[nodiscard]] double second_step(const PhaseMap& map) const {
    return target_.second != nullptr ? std::max(1e-6, detail::median_slope(*target_.second, map.width, map.height)) : 1.0;
  }

  /// From a place to the cell in which both coordinates are met.
  [[nodiscard]] bool walk(const Eigen::Vector2d& start, float a, float b, Place& place) const {
    constexpr double kSlack = 1e-3;
    auto x = static_cast<std::ptrdiff_t>(std::floor(start.x()));
    auto y = static_cast<std::ptrdiff_t>(std::floor(start.y()));
    double u = start.x() - static_cast<double>(x);
    double v = start.y() - static_cast<double>(y);
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

  [[nodiscard]] double interpolated_variance(const PhasePlane& plane, const Place& place) const {
    const std::array<std::pair<std::size_t, double>, 4> parts = {{{place.cell, (1.0 - place.u) * (1.0 - place.v)},
                                                                  {place.cell + 1, place.u * (1.0 - place.v)},
                                                                  {place.cell + width_, (1.0 - place.u) * place.v},
                                                                  {place.cell + width_ + 1, place.u * place.v}}};
    double sum = 0.0;
    for (const auto& [pixel, weight] : parts) sum += std::pow(weight * static_cast<double>(plane.sigma_turns[pixel]), 2);
    return sum;
  }

  std::size_t width_;
  std::size_t height_;
  const Target& target_;
  const MatchOptions& options_;
  Table table_;
};

/// Median change of a plane along the epipolar curves, with the sign of most.
double slope_along_curves(const PhasePlane& plane, const Target& target, int width, int height) {
  constexpr int kSampleEvery = 5;
  std::vector<double> slopes;
  for (int y = 0; y + 1 < height; y += kSampleEvery) {
    for (int x = 0; x + 1 < width; x += kSampleEvery) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      const auto w = static_cast<std::size_t>(width);
      if (!target.good[at] || !target.good[at + 1] || !target.good[at + w] || !target.good[at + w + 1]) continue;
      const Cell a(plane.turns, at, w);
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

/// Pixels to either side over which phases are averaged so that their slope is known to a tenth.
int smoothing_radius(const PhasePlane& plane, const Target& target, int width, int height) {
  constexpr int kSampleEvery = 7;
  constexpr int kMost = 6;
  std::vector<float> sigmas;
  for (int y = 0; y < height; y += kSampleEvery) {
    for (int x = 0; x < width; x += kSampleEvery) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
      if (target.good[at]) sigmas.push_back(plane.sigma_turns[at]);
    }
  }
  // Means about neighbours share all pixels but two columns: their difference has the sigma sqrt(2 (2 r + 1)) sigma / (2 r + 1)^2.
  const double ratio = math::median(sigmas) / std::abs(target.slope);
  int radius = 0;
  while (radius < kMost && std::numbers::sqrt2 * ratio / std::pow(2.0 * radius + 1.0, 1.5) > 0.1) ++radius;
  return radius;
}

Result<> check(const PhaseMap& left, const PhaseMap& right, const base::Head& head) {
  for (const auto& [map, camera, name] : {std::tuple{&left, &head.left, "left"}, std::tuple{&right, &head.right, "right"}}) {
    if (map->width != camera->width_px() || map->height != camera->height_px()) {
      return fail(ErrorCode::kBadInput, fmt::format("the {} images have {} x {} px, the {} camera {} x {}", name, map->width,
                                                    map->height, name, camera->width_px(), camera->height_px()));
    }
  }
  if (left.x.has_value() != right.x.has_value() || left.y.has_value() != right.y.has_value() || (!left.x && !left.y)) {
    return fail(ErrorCode::kBadInput, "the two cameras' phases are of different directions");
  }
  return {};
}

/// Signed median and 1.4826 times the median absolute deviation from it, of a sample of the pixels.
std::pair<double, double> median_and_mad(const std::vector<float>& plane) {
  constexpr std::size_t kSample = 200000;
  std::vector<float> values;
  for (std::size_t i = 0; i < plane.size(); i += 1 + plane.size() / kSample) {
    if (!std::isnan(plane[i])) values.push_back(plane[i]);
  }
  const double median = math::median(values);
  for (float& v : values) v = std::abs(v - static_cast<float>(median));
  return {median, 1.4826 * math::median(values)};
}

}  // namespace

Result<> MatchOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "matching options: " + what); };
  if (!(min_depth_mm >= 0.0 && max_depth_mm > min_depth_mm)) return bad("the depths must be 0 <= min < max");
  if (!(min_slope > 0.0 && min_slope < 1.0)) return bad(fmt::format("min_slope is {}, not in (0, 1)", min_slope));
  if (!(max_epipolar_sigmas > 0.0 && max_epipolar_px >= 0.0))
    return bad("the limits of the epipolar distance must be positive");
  if (guard_px < 0 || guard_px > 100) return bad(fmt::format("guard_px is {}, not in 0..100", guard_px));
  return {};
}

Result<DepthMap> match(const PhaseMap& left, const PhaseMap& right, const base::Head& head, const MatchOptions& options,
                       const base::Progress& progress) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  if (auto ok = check(left, right, head); !ok) return fail(std::move(ok));
  const auto frame = detail::rectify(head.right_from_left);
  if (!frame) return tl::unexpected(frame.error());
  const auto left_map = detail::RectifiedMap::make(head.left, frame->rectified_from_left, options.threads);
  if (!left_map) return tl::unexpected(left_map.error());
  const auto right_map = detail::RectifiedMap::make(head.right, frame->rectified_from_right, options.threads);
  if (!right_map) return tl::unexpected(right_map.error());
  const double focal_px = head.right.focal_px().mean();

  Target target;
  const bool x_first = left.x.has_value();
  target.first = x_first ? &*right.x : &*right.y;
  target.second = right.x && right.y ? &*right.y : nullptr;
  const PhasePlane& first = x_first ? *left.x : *left.y;
  const PhasePlane* second = left.x && left.y ? &*left.y : nullptr;
  target.good = detail::guarded_pixels(right, options.guard_px, options.guard_creases, options.threads);
  target.x_px.resize(right.status.size());
  target.y_px.resize(right.status.size());
  const auto right_width = static_cast<std::size_t>(right.width);
  auto done = base::parallel_for(static_cast<std::size_t>(right.height), options.threads, "rays", progress,
                                 [&](std::size_t y) -> Result<> {
                                   float* x_px = &target.x_px[y * right_width];
                                   float* y_px = &target.y_px[y * right_width];
                                   right_map->row(static_cast<int>(y), x_px, y_px);
                                   for (std::size_t x = 0; x < right_width; ++x) {
                                     x_px[x] *= static_cast<float>(focal_px);
                                     y_px[x] *= static_cast<float>(focal_px);
                                   }
                                   return {};
                                 });
  if (!done) return fail(std::move(done));
  for (std::size_t i = 0; i < target.good.size(); ++i) target.good[i] = target.good[i] && !std::isnan(target.x_px[i]);
  target.slope = slope_along_curves(*target.first, target, right.width, right.height);
  if (!(std::abs(target.slope) > 0.1 * detail::median_slope(*target.first, right.width, right.height))) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format("the fringes of the axis {} run along the line from camera to camera and tell no depth; turn them by 90 "
                    "degrees, or show both directions",
                    base::axis_name(target.first->axis)));
  }

  const int radius = smoothing_radius(*target.first, target, right.width, right.height);
  target.first_smooth = detail::box_mean(target.first->turns, target.good, right.width, right.height, radius, options.threads);
  if (target.second != nullptr) {
    target.second_smooth =
        detail::box_mean(target.second->turns, target.good, right.width, right.height, radius, options.threads);
  }

  mark_long(target, right.width, right.height, options.threads);
  const Matcher matcher(right, target, options);
  const std::vector<char> good = detail::guarded_pixels(left, options.guard_px, options.guard_creases, options.threads);
  DepthMap map;
  map.width = left.width;
  map.height = left.height;
  const std::size_t pixels = left.status.size();
  map.depth_mm.assign(pixels, kNowhere);
  map.sigma_mm.assign(pixels, kNowhere);
  if (second != nullptr) map.epipolar_px.assign(pixels, kNowhere);
  struct Counts {
    std::int64_t points = 0, guarded = 0, unmatched = 0, off_curve = 0;
  };
  const auto tasks = static_cast<std::size_t>((left.height + kRowsPerTask - 1) / kRowsPerTask);
  std::vector<Counts> counts(tasks);
  const Eigen::Matrix3d left_from_rectified = frame->rectified_from_left.transpose();
  done = base::parallel_for(tasks, options.threads, "matches", progress, [&](std::size_t task) -> Result<> {
    std::vector<float> x_row(static_cast<std::size_t>(left.width));
    std::vector<float> y_row(static_cast<std::size_t>(left.width));
    const int from = static_cast<int>(task) * kRowsPerTask;
    Counts& count = counts[task];
    for (int y = from; y < std::min(left.height, from + kRowsPerTask); ++y) {
      left_map->row(y, x_row.data(), y_row.data());
      Guess guess;
      for (int x = 0; x < left.width; ++x) {
        const std::size_t at = left.at(x, y);
        if (left.status[at] != base::PhaseStatus::kValid) continue;
        if (!good[at]) {
          ++count.guarded;
          continue;
        }
        const auto column = static_cast<std::size_t>(x);
        const float y_px = y_row[column] * static_cast<float>(focal_px);
        Match found;
        const Outcome outcome =
            matcher.find(first.turns[at], first.sigma_turns[at], second != nullptr ? second->turns[at] : y_px,
                         second != nullptr ? second->sigma_turns[at] : 0.0F, y_px, guess, found);
        if (outcome != Outcome::kMatched) {
          ++(outcome == Outcome::kNone ? count.unmatched : count.off_curve);
          if (outcome == Outcome::kOffCurve) map.epipolar_px[at] = static_cast<float>(found.off_px);
          continue;
        }
        const double disparity = static_cast<double>(x_row[column]) - found.x_px / focal_px;
        const double depth = frame->baseline_mm / disparity;  // in the rectified frame
        const Eigen::Vector3d direction(x_row[column], y_row[column], 1.0);
        const double z = (left_from_rectified * direction).z() * depth;
        if (!(disparity > 0.0) || z < options.min_depth_mm || z > options.max_depth_mm) {
          ++count.unmatched;
          continue;
        }
        map.depth_mm[at] = static_cast<float>(z);
        map.sigma_mm[at] =
            static_cast<float>(depth * depth / frame->baseline_mm * found.sigma_px / focal_px * direction.norm());
        if (second != nullptr) map.epipolar_px[at] = static_cast<float>(found.off_px);
        ++count.points;
      }
    }
    return {};
  });
  if (!done) return fail(std::move(done));
  for (const Counts& count : counts) {
    map.points += count.points;
    map.guarded += count.guarded;
    map.unmatched += count.unmatched;
    map.off_curve += count.off_curve;
  }
  std::tie(map.epipolar_median_px, map.epipolar_mad_px) = median_and_mad(map.epipolar_px);
  return map;
}

}  // namespace crosstie::scan
