#include "edge/tool_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/core.h>
#include <Eigen/Geometry>

#include "edge/detail/rim_filter.h"
#include "edge/nominal_fit.h"

namespace crosstie::edge {
namespace {

using base::ErrorCode;
using base::fail;
using base::PathSource;
using base::Result;
using base::ToolPath;
using base::ToolPathPoint;
using detail::RimFilter;
using detail::Smoothed;
using detail::Unmeasured;

constexpr double kCoarse_mm = 0.05;    // a chord's height that is worth a warning
constexpr double kMostLean_rad = 1.2;  // about 70 degrees
constexpr std::size_t kMostPoints = 1000000;

/// A place of the path before torch and time.
struct Node {
  double s_mm = 0.0;  ///< along the nominal
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< of the nominal
  Eigen::Vector3d inside = Eigen::Vector3d::Zero();   ///< u of the nominal
  Eigen::Vector3d nominal_tangent = Eigen::Vector3d::UnitX();
  Eigen::Vector2d correction = Eigen::Vector2d::Zero();
  Eigen::Vector2d variance = Eigen::Vector2d::Zero();
  Eigen::Vector2d tilt = Eigen::Vector2d::Zero();  ///< of the surface from that normal, towards inside and the tangent
  Eigen::Vector2d tilt_variance = Eigen::Vector2d::Zero();
  PathSource source = PathSource::kMeasured;
};

/// Places along the nominal: even steps and its corners, from the start on; of a closed one the start again at the end.
std::vector<double> places(const NominalCurve& nominal, const ToolPathOptions& options) {
  const double length = nominal.length_mm();
  const auto steps = static_cast<std::size_t>(std::max(1.0, std::ceil(length / options.step_mm)));
  const double start = nominal.closed() ? options.start_mm : 0.0;
  std::vector<double> ways;
  for (std::size_t i = 0; i <= steps; ++i) ways.push_back(length * static_cast<double>(i) / static_cast<double>(steps));
  for (const double corner : nominal.corners_mm()) {
    double way = corner - start;
    if (nominal.closed()) way -= length * std::floor(way / length);
    const auto nearest = std::min_element(ways.begin() + 1, ways.end() - 1,
                                          [&](double a, double b) { return std::abs(a - way) < std::abs(b - way); });
    if (nearest != ways.end() - 1 && std::abs(*nearest - way) < 0.25 * options.step_mm) {
      *nearest = way;
    } else if (way > 1e-9 && way < length - 1e-9) {
      ways.push_back(way);
    }
  }
  std::sort(ways.begin(), ways.end());
  for (double& way : ways) way += start;
  if (!options.counter_clockwise) {
    for (double& way : ways) way = 2.0 * start + (nominal.closed() ? 0.0 : length) - way;
  }
  return ways;
}

/// The gap that holds a place, and how far the place lies from its two ends.
struct InGap {
  const Unmeasured* gap = nullptr;
  double from_start = 0.0;
  double from_end = 0.0;
};

InGap gap_at(const std::vector<Unmeasured>& gaps, double s_mm, const NominalCurve& nominal) {
  const double length = nominal.length_mm();
  for (const Unmeasured& gap : gaps) {
    double way = s_mm - gap.from_mm;
    if (nominal.closed()) way -= length * std::floor(way / length);
    const double wide = gap.to_mm - gap.from_mm;
    const bool at_end = !nominal.closed() && ((s_mm <= 0.0 && gap.from_mm <= 0.0) || (s_mm >= length && gap.to_mm >= length));
    if ((way > 0.0 && way < wide) || at_end) return {&gap, way, wide - way};
  }
  return {};
}

/// 1 at the end of the gap, 0 a blend further in.
double fade(double way, double blend) { return way >= blend ? 0.0 : 0.5 * (1.0 + std::cos(std::numbers::pi * way / blend)); }

class PathMaker {
 public:
  PathMaker(const base::EdgeCurve& edge, const NominalCurve& nominal, const base::Pose& place, const base::Matrix6d& place_cov,
            const ToolPathOptions& options)
      : edge_(edge),
        nominal_(nominal),
        place_(place),
        place_cov_(place_cov),
        options_(options),
        off_(deviations(edge, nominal, place)) {}

  Result<ToolPath> make() {
    if (off_.points.size() < 3) {
      return fail(ErrorCode::kBadInput,
                  fmt::format("{} points of the rim lie beside the nominal path; nothing corrects it", off_.points.size()));
    }
    filter_.emplace(edge_, off_, nominal_.length_mm(), nominal_.closed(), options_.cutoff_mm, options_.tilt_cutoff_mm);
    gaps_ = filter_->gaps();
    if (auto good = check_gaps(); !good) return fail(std::move(good));
    path_.frame = edge_.frame;
    path_.closed = nominal_.closed();
    path_.bevel_rad = options_.bevel_rad;
    path_.lead_rad = options_.lead_rad;
    path_.standoff_mm = options_.standoff_mm;
    path_.offset_mm = options_.offset_mm;
    for (const double s : places(nominal_, options_)) {
      auto node = node_at(s);
      if (!node) return fail(std::move(node));
      nodes_.push_back(*std::move(node));
    }
    if (auto good = lay(); !good) return fail(std::move(good));
    if (auto good = check_way(); !good) return fail(std::move(good));
    name_gaps();
    warn();
    return std::move(path_);
  }

 private:
  Result<> check_gaps() const {
    for (const Unmeasured& gap : gaps_) {
      if (gap.to_mm - gap.from_mm <= options_.max_gap_mm) continue;
      return fail(
          ErrorCode::kBadInput,
          fmt::format("the rim has a gap of {:.1f} mm at {:.1f} mm along the nominal ({}); more than {} mm may not go by the "
                      "nominal alone: scan it, or allow a longer gap",
                      gap.to_mm - gap.from_mm, gap.from_mm, gap.reason, options_.max_gap_mm));
    }
    return {};
  }

  [[nodiscard]] double wrapped(double s_mm) const {
    return nominal_.closed() ? s_mm - nominal_.length_mm() * std::floor(s_mm / nominal_.length_mm()) : s_mm;
  }

  /// Variances along u and v of a place of the nominal itself, in the rim's frame.
  [[nodiscard]] Eigen::Vector2d place_variance(const Eigen::Vector3d& p, const Eigen::Vector3d& u,
                                               const Eigen::Vector3d& v) const {
    Eigen::Matrix<double, 3, 6> by_pose;
    by_pose << -base::skew(p), Eigen::Matrix3d::Identity();
    const Eigen::Matrix3d cov = by_pose * place_cov_ * by_pose.transpose();
    return {u.dot(cov * u), v.dot(cov * v)};
  }

  /// Of its normal's tilts towards u and the tangent: turns about the tangent and u.
  [[nodiscard]] Eigen::Vector2d place_tilt_variance(const Eigen::Vector3d& t, const Eigen::Vector3d& u) const {
    const Eigen::Matrix3d cov = place_cov_.topLeftCorner<3, 3>();
    return {t.dot(cov * t), u.dot(cov * u)};
  }

  Result<Node> node_at(double s) const {
    const CurvePoint at = nominal_.at(s);
    Node node;
    node.s_mm = wrapped(s);
    node.nominal_tangent = place_.rotation * at.tangent;
    node.normal = place_.rotation * at.normal;
    node.inside = node.normal.cross(node.nominal_tangent);
    const InGap in = gap_at(gaps_, node.s_mm, nominal_);
    const Eigen::Vector3d bare = place_ * at.point_mm;
    if (in.gap == nullptr) {
      const Smoothed here = filter_->at(node.s_mm);
      if (auto good = check(here, node.s_mm); !good) return fail(std::move(good));
      node.correction = here.uv_mm;
      node.variance = here.variance_mm2;
      node.tilt = here.tilt_rad;
      node.tilt_variance = here.tilt_variance_rad2;
    } else {
      const double blend = std::min(options_.blend_mm, 0.5 * (in.gap->to_mm - in.gap->from_mm));
      const Eigen::Vector2d nominal_variance = place_variance(bare, node.inside, node.normal) + filter_->mean_square_mm2();
      const Eigen::Vector2d nominal_tilts =
          place_tilt_variance(node.nominal_tangent, node.inside) + filter_->mean_square_tilt_rad2();
      node.variance = nominal_variance;
      node.tilt_variance = nominal_tilts;
      node.source = PathSource::kNominal;
      const bool at_open_end = !nominal_.closed() && (in.gap->from_mm <= 0.0 || in.gap->to_mm >= nominal_.length_mm());
      const auto from_end_of = [&](double end_mm, double way) {
        const double share = fade(way, blend);
        if (share <= 0.0) return;
        const Smoothed there = filter_->at(wrapped(end_mm));
        node.correction += share * there.uv_mm;
        node.variance += share * share * there.variance_mm2 - share * nominal_variance;
        node.tilt += share * there.tilt_rad;
        node.tilt_variance += share * share * there.tilt_variance_rad2 - share * nominal_tilts;
        node.source = PathSource::kBlend;
      };
      if (!(at_open_end && in.gap->from_mm <= 0.0)) from_end_of(in.gap->from_mm, in.from_start);
      if (!(at_open_end && in.gap->to_mm >= nominal_.length_mm())) from_end_of(in.gap->to_mm, in.from_end);
    }
    node.point = bare + node.correction(0) * node.inside + node.correction(1) * node.normal + options_.offset_mm * node.inside;
    return node;
  }

  Result<> check(const Smoothed& here, double s) const {
    const double most = here.uv_mm.cwiseAbs().maxCoeff();
    if (most > options_.max_correction_mm) {
      return fail(
          ErrorCode::kBadInput,
          fmt::format("the rim lies {:.2f} mm from the nominal path at {:.1f} mm along it; up to {} mm are corrected: the hole "
                      "is not where the nominal is, or has another shape",
                      most, s, options_.max_correction_mm));
    }
    const double steep = here.slope.cwiseAbs().maxCoeff();
    if (steep > options_.max_slope) {
      return fail(ErrorCode::kBadInput,
                  fmt::format("the rim leaves the nominal path by {:.3f} mm per mm at {:.1f} mm along it; up to {} are "
                              "followed: spatter, a shadow or a marker may have been taken for the rim",
                              steep, s, options_.max_slope));
    }
    return {};
  }

  /// Tangents, torch and time.
  Result<> lay() {
    const std::size_t n = nodes_.size();
    const double way_sign = options_.counter_clockwise ? 1.0 : -1.0;
    for (std::size_t i = 0; i < n; ++i) {
      const Node& node = nodes_[i];
      const std::size_t before = i > 0 ? i - 1 : (path_.closed ? n - 2 : 0);
      const std::size_t after = i + 1 < n ? i + 1 : (path_.closed ? 1 : n - 1);
      const Eigen::Vector3d chord = nodes_[after].point - nodes_[before].point;
      if (!(chord.dot(way_sign * node.nominal_tangent) > 0.0)) {
        return fail(ErrorCode::kBadInput,
                    fmt::format("the path folds at {:.1f} mm along the nominal: its offset of {} mm is larger than the "
                                "radius there",
                                node.s_mm, options_.offset_mm));
      }
      ToolPathPoint p;
      p.normal = (node.normal + node.tilt(0) * node.inside + node.tilt(1) * node.nominal_tangent).normalized();
      p.tangent = (chord - chord.dot(p.normal) * p.normal).normalized();
      const Eigen::Vector3d inside = way_sign * p.normal.cross(p.tangent);
      p.torch =
          std::cos(options_.lead_rad) * (std::cos(options_.bevel_rad) * p.normal + std::sin(options_.bevel_rad) * inside) +
          std::sin(options_.lead_rad) * p.tangent;
      p.point_mm = node.point + options_.standoff_mm * p.torch;
      p.correction_u_mm = node.correction(0);
      p.correction_v_mm = node.correction(1);
      p.sigma_u_mm = std::sqrt(std::max(0.0, node.variance(0)));
      p.sigma_v_mm = std::sqrt(std::max(0.0, node.variance(1)));
      p.sigma_torch_rad = node.tilt_variance.cwiseMax(0.0).cwiseSqrt();
      p.source = node.source;
      p.speed_mm_per_s = options_.speed_mm_per_s;
      if (i > 0) {
        const ToolPathPoint& last = path_.points.back();
        const double step = (p.point_mm - last.point_mm).norm();
        if (options_.max_turn_rad_per_s) {
          const Eigen::Matrix3d turn = p.frame_from_tool() * last.frame_from_tool().transpose();
          const double angle = Eigen::AngleAxisd(turn).angle();
          if (angle > 0.0) p.speed_mm_per_s = std::min(p.speed_mm_per_s, step * *options_.max_turn_rad_per_s / angle);
        }
        p.s_mm = last.s_mm + step;
        p.time_s = last.time_s + (step > 0.0 ? step / p.speed_mm_per_s : 0.0);
      }
      path_.points.push_back(p);
    }
    path_.length_mm = path_.points.back().s_mm;
    path_.duration_s = path_.points.back().time_s;
    return {};
  }

  Result<> check_way() const {
    for (std::size_t i = 0; options_.reach && i < path_.points.size(); ++i) {
      const ToolPathPoint& p = path_.points[i];
      for (const double retract : {0.0, options_.retract_mm}) {
        const Eigen::Vector3d tip = p.point_mm + retract * p.torch;
        const bool is_end = i == 0 || i + 1 == path_.points.size();
        if (retract > 0.0 && !is_end) continue;
        for (int axis = 0; axis < 3; ++axis) {
          if (tip(axis) >= options_.reach->low_mm(axis) && tip(axis) <= options_.reach->high_mm(axis)) continue;
          return fail(
              ErrorCode::kBadInput,
              fmt::format(
                  "the path leaves the machine's reach at {:.1f} mm along it{}: {} = {:.2f} mm, and {} to {} mm is possible",
                  p.s_mm, retract > 0.0 ? fmt::format(", retracted by {} mm", retract) : "", "xyz"[axis], tip(axis),
                  options_.reach->low_mm(axis), options_.reach->high_mm(axis)));
        }
      }
    }
    std::vector<Eigen::Vector3d> chain;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for (const ToolPathPoint& p : path_.points) {
      chain.push_back(p.point_mm);
      normal += p.normal;
    }
    if (path_.closed) chain.pop_back();
    if (const auto crossing = self_crossing(chain, path_.closed, normal.normalized())) {
      return fail(ErrorCode::kBadInput, fmt::format("the path crosses itself: at {:.1f} and {:.1f} mm along it",
                                                    path_.points[crossing->first].s_mm, path_.points[crossing->second].s_mm));
    }
    return {};
  }

  /// The gaps by the path's own arc length.
  void name_gaps() {
    std::size_t i = 0;
    while (i < path_.points.size()) {
      if (path_.points[i].source == PathSource::kMeasured) {
        ++i;
        continue;
      }
      const std::size_t first = i;
      const InGap in = gap_at(gaps_, nodes_[i].s_mm, nominal_);
      while (i < path_.points.size() && path_.points[i].source != PathSource::kMeasured &&
             gap_at(gaps_, nodes_[i].s_mm, nominal_).gap == in.gap)
        ++i;
      const double from = path_.points[first > 0 ? first - 1 : first].s_mm;
      const double to = path_.points[std::min(i, path_.points.size() - 1)].s_mm;
      path_.gaps.push_back({from, to - from, in.gap->reason});
      path_.warnings.push_back(
          {"gap", fmt::format("{:.1f} mm", from),
           fmt::format("{:.1f} mm of the path from there on go by the nominal: {}", to - from, in.gap->reason)});
    }
  }

  void warn() {
    if (filter_->cutoff_mm() > options_.cutoff_mm) {
      path_.warnings.push_back(
          {"wide_filter", "rim",
           fmt::format("the rim's points lie {:.2f} mm apart, so the path follows it by wavelengths of {:.1f} mm "
                       "and not of {} mm",
                       filter_->usual_spacing_mm(), filter_->cutoff_mm(), options_.cutoff_mm)});
    }
    double worst = 0.0;
    double where = 0.0;
    for (std::size_t i = 1; i < path_.points.size(); ++i) {
      const double corner = path_.points[i].tangent.dot(path_.points[i - 1].tangent);
      const double step = path_.points[i].s_mm - path_.points[i - 1].s_mm;
      const double height = step * std::acos(std::clamp(corner, -1.0, 1.0)) / 8.0;
      if (height > worst) {
        worst = height;
        where = path_.points[i].s_mm;
      }
    }
    if (worst > kCoarse_mm) {
      path_.warnings.push_back(
          {"coarse_step", fmt::format("{:.1f} mm", where),
           fmt::format("straight moves of {} mm leave the path by {:.2f} mm there; a smaller step follows it", options_.step_mm,
                       worst)});
    }
  }

  const base::EdgeCurve& edge_;
  const NominalCurve& nominal_;
  const base::Pose& place_;
  const base::Matrix6d& place_cov_;
  const ToolPathOptions& options_;
  EdgeDeviations off_;
  std::optional<RimFilter> filter_;
  std::vector<Unmeasured> gaps_;
  std::vector<Node> nodes_;
  ToolPath path_;
};

}  // namespace

Result<> ToolPathOptions::validate() const {
  const auto positive = [](const char* name, double value) -> Result<> {
    if (std::isfinite(value) && value > 0.0) return {};
    return fail(ErrorCode::kUsage, fmt::format("{} is {}; it is positive", name, value));
  };
  for (const auto& [name, value] : {std::pair{"step_mm", step_mm},
                                    {"cutoff_mm", cutoff_mm},
                                    {"tilt_cutoff_mm", tilt_cutoff_mm},
                                    {"max_correction_mm", max_correction_mm},
                                    {"max_slope", max_slope},
                                    {"blend_mm", blend_mm},
                                    {"speed_mm_per_s", speed_mm_per_s},
                                    {"max_turn_rad_per_s", max_turn_rad_per_s.value_or(1.0)}}) {
    if (auto good = positive(name, value); !good) return good;
  }
  if (!(max_gap_mm >= 0.0) || !(retract_mm >= 0.0))
    return fail(ErrorCode::kUsage, "max_gap_mm and retract_mm are not negative");
  for (const auto& [name, value] : {std::pair{"bevel", bevel_rad}, {"lead", lead_rad}}) {
    if (!(std::abs(value) <= kMostLean_rad))
      return fail(ErrorCode::kUsage, fmt::format("a {} of {} rad; up to {} is possible", name, value, kMostLean_rad));
  }
  if (!std::isfinite(standoff_mm) || !std::isfinite(offset_mm) || !std::isfinite(start_mm)) {
    return fail(ErrorCode::kUsage, "standoff_mm, offset_mm and start_mm are finite");
  }
  if (reach && !(reach->high_mm - reach->low_mm).allFinite()) return fail(ErrorCode::kUsage, "the reach is not finite");
  if (reach && !((reach->high_mm - reach->low_mm).minCoeff() > 0.0))
    return fail(ErrorCode::kUsage, "the reach is a box: low below high");
  return {};
}

Result<ToolPath> tool_path(const base::EdgeCurve& edge, const NominalCurve& nominal, const base::Pose& frame_from_hole,
                           const base::Matrix6d& place_cov, const ToolPathOptions& options) {
  if (auto good = options.validate(); !good) return fail(std::move(good));
  if (nominal.length_mm() / options.step_mm > static_cast<double>(kMostPoints)) {
    return fail(ErrorCode::kUsage, fmt::format("steps of {} mm make more than {} points", options.step_mm, kMostPoints));
  }
  return PathMaker(edge, nominal, frame_from_hole, place_cov, options).make();
}

}  // namespace crosstie::edge
