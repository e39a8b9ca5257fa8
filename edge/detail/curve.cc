#include "edge/detail/curve.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/core.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace crosstie::edge::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr int kKnots = 1440;
constexpr double kCorner_rad = 0.02;  // a change of direction between two lines that counts as one
constexpr double kDistinct = 1e-9;    // points nearer than this share of the extent are one

/// The direction about which a closed chain runs counter-clockwise; of an open one that in which it extends least.
Eigen::Vector3d plane_normal(const std::vector<Eigen::Vector3d>& points, bool closed) {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& p : points) centre += p / static_cast<double>(points.size());
  Eigen::Vector3d area = Eigen::Vector3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p = points[i] - centre;
    area += p.cross(points[(i + 1) % points.size()] - centre);
    scatter += p * p.transpose();
  }
  if (closed && area.norm() > 1e-6 * scatter.trace() / static_cast<double>(points.size())) return area.normalized();
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(scatter).eigenvectors().col(0);
}

Result<> check_sizes(const Nominal& nominal) {
  const std::vector<std::string> names = size_names(nominal.kind);
  if (nominal.size_mm.size() != names.size()) {
    return fail(ErrorCode::kBadInput,
                fmt::format("a nominal {} needs {} in mm, and {} values are given", name_of(nominal.kind),
                            names.size() == 1 ? names[0] : names[0] + " and " + names[1], nominal.size_mm.size()));
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (std::isfinite(nominal.size_mm[i]) && nominal.size_mm[i] > 0.0) continue;
    return fail(ErrorCode::kBadInput,
                fmt::format("the {} of the nominal {} is {} mm", names[i], name_of(nominal.kind), nominal.size_mm[i]));
  }
  if (nominal.kind == NominalKind::kOval && nominal.size_mm[0] < nominal.size_mm[1]) {
    return fail(ErrorCode::kBadInput, fmt::format("an oval of length {} mm is wider ({} mm) than long; the length comes first",
                                                  nominal.size_mm[0], nominal.size_mm[1]));
  }
  if (nominal.kind == NominalKind::kSuperellipse && !(nominal.exponent >= 2.0 && nominal.exponent <= 50.0)) {
    return fail(ErrorCode::kBadInput, fmt::format("a superellipse of exponent {}; from 2 to 50 is possible", nominal.exponent));
  }
  if (!nominal.saddle) return {};
  const Saddle& saddle = *nominal.saddle;
  if (!std::isfinite(saddle.radius_mm) || saddle.radius_mm == 0.0 ||
      !(std::abs(saddle.half_angle_rad) < std::numbers::pi / 4) || !std::isfinite(saddle.direction_rad)) {
    return fail(ErrorCode::kBadInput,
                fmt::format("a tower of radius {} mm and half angle {} rad; the radius is not 0, the angle below pi / 4",
                            saddle.radius_mm, saddle.half_angle_rad));
  }
  return {};
}

Result<> check_points(const Nominal& nominal) {
  const auto& points = nominal.points_mm;
  if (points.size() < 3) {
    return fail(ErrorCode::kBadInput, fmt::format("a nominal curve needs 3 points, and {} are given", points.size()));
  }
  if (!nominal.normals.empty() && nominal.normals.size() != points.size()) {
    return fail(ErrorCode::kBadInput, fmt::format("{} normals for {} points", nominal.normals.size(), points.size()));
  }
  double extent = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) return fail(ErrorCode::kBadInput, fmt::format("nominal point {} is not finite", i + 1));
    extent = std::max(extent, (points[i] - points[0]).norm());
  }
  for (std::size_t i = 0; i + (nominal.closed ? 0 : 1) < points.size(); ++i) {
    const std::size_t next = (i + 1) % points.size();
    if ((points[next] - points[i]).norm() > kDistinct * extent) continue;
    return fail(ErrorCode::kBadInput, fmt::format("nominal points {} and {} are in one place", i + 1, next + 1));
  }
  for (std::size_t i = 0; i < nominal.normals.size(); ++i) {
    if (nominal.normals[i].allFinite() && nominal.normals[i].norm() > 0.1) continue;
    return fail(ErrorCode::kBadInput, fmt::format("the normal of nominal point {} has no direction", i + 1));
  }
  return {};
}

}  // namespace

Result<Curve> Curve::make(const Nominal& nominal, bool with_lengths) {
  Curve curve;
  curve.nominal_ = nominal;
  if (nominal.kind == NominalKind::kPoints) {
    if (auto made = curve.make_list(with_lengths); !made) return fail(std::move(made));
    return curve;
  }
  if (auto good = check_sizes(nominal); !good) return fail(std::move(good));
  curve.nominal_.closed = true;
  std::vector<double> knots;
  for (int k = 0; k <= kKnots; ++k) knots.push_back(static_cast<double>(k) / kKnots);
  if (nominal.kind == NominalKind::kOval) {
    const double straight = nominal.size_mm[0] - nominal.size_mm[1];
    const double quarter = 0.25 * std::numbers::pi * nominal.size_mm[1];
    const double all = 4.0 * quarter + 2.0 * straight;
    for (const double s : {quarter, quarter + straight, 3.0 * quarter + straight, 3.0 * quarter + 2.0 * straight}) {
      knots.push_back(s / all);
    }
    std::sort(knots.begin(), knots.end());
    knots.erase(std::unique(knots.begin(), knots.end(), [](double a, double b) { return b - a < 1e-12; }), knots.end());
  }
  curve.make_tables(knots, with_lengths);
  for (const auto& p : curve.points_) {
    if (p.allFinite()) continue;
    return fail(
        ErrorCode::kBadInput,
        fmt::format("the nominal {} is wider than the tower of radius {} mm: its prism does not meet the tower all round",
                    name_of(nominal.kind), std::abs(nominal.saddle->radius_mm)));
  }
  return curve;
}

Result<> Curve::make_list(bool with_lengths) {
  if (auto good = check_points(nominal_); !good) return good;
  const auto& points = nominal_.points_mm;
  std::vector<double> chords = {0.0};
  for (std::size_t i = 0; i + (nominal_.closed ? 0 : 1) < points.size(); ++i) {
    chords.push_back(chords.back() + (points[(i + 1) % points.size()] - points[i]).norm());
  }
  plane_normal_ = plane_normal(points, nominal_.closed);
  if (const auto crossing = self_crossing(points, nominal_.closed, plane_normal_)) {
    return fail(ErrorCode::kBadInput, fmt::format("the nominal curve crosses itself: the lines after points {} and {}",
                                                  crossing->first + 1, crossing->second + 1));
  }
  spline_ = Spline(chords, points, nominal_.closed, !nominal_.spline);
  if (!nominal_.normals.empty()) {
    std::vector<Eigen::Vector3d> unit = nominal_.normals;
    for (auto& n : unit) n.normalize();
    normal_spline_ = Spline(chords, unit, nominal_.closed, true);
  }
  std::vector<double> knots;
  const double step = chords.back() / kKnots;
  std::vector<std::size_t> vertex_knots;
  for (std::size_t i = 0; i + 1 < chords.size(); ++i) {
    const int parts = std::max(1, static_cast<int>(std::ceil((chords[i + 1] - chords[i]) / step)));
    vertex_knots.push_back(knots.size());
    for (int k = 0; k < parts; ++k) knots.push_back(chords[i] + (chords[i + 1] - chords[i]) * k / parts);
  }
  knots.push_back(chords.back());
  make_tables(knots, with_lengths);
  if (nominal_.spline || !with_lengths) return {};
  for (std::size_t i = nominal_.closed ? 0 : 1; i < vertex_knots.size(); ++i) {
    const std::size_t before = (i + points.size() - 1) % points.size();
    const Eigen::Vector3d in = (points[i] - points[before]).normalized();
    const Eigen::Vector3d out = (points[(i + 1) % points.size()] - points[i]).normalized();
    if (in.dot(out) < std::cos(kCorner_rad)) corners_mm_.push_back(lengths_[vertex_knots[i]]);
  }
  return {};
}

void Curve::make_tables(const std::vector<double>& knots, bool with_lengths) {
  knots_ = knots;
  lengths_ = {0.0};
  for (std::size_t k = 0; k < knots_.size(); ++k) {
    points_.push_back(jet(knots_[k]).point);
    if (k > 0 && with_lengths) lengths_.push_back(lengths_.back() + arc(knots_[k - 1], knots_[k]));
  }
}

Jet Curve::list_jet(double t) const {
  const double end = spline_.knots().back();
  if (nominal_.closed) t -= end * std::floor(t / end);
  t = std::clamp(t, 0.0, end);
  const Spline::Value value = spline_.at(t);
  return {value.point, value.derivative, normal_spline_.empty() ? plane_normal_ : normal_spline_.at(t).point};
}

Jet Curve::jet(double t) const {
  return nominal_.kind == NominalKind::kPoints ? list_jet(t) : outline_jet(nominal_, nominal_.size_mm, t);
}

/// Gauss-Legendre, five places.
double Curve::arc(double t0, double t1) const {
  constexpr std::array<double, 3> kPlace = {0.0, 0.53846931010568309, 0.90617984593866399};
  constexpr std::array<double, 3> kWeight = {0.56888888888888889, 0.47862867049936647, 0.23692688505618909};
  const double middle = 0.5 * (t0 + t1);
  const double half = 0.5 * (t1 - t0);
  double sum = kWeight[0] * jet(middle).derivative.norm();
  for (std::size_t i = 1; i < kPlace.size(); ++i) {
    sum += kWeight[i] * (jet(middle - half * kPlace[i]).derivative.norm() + jet(middle + half * kPlace[i]).derivative.norm());
  }
  return half * sum;
}

std::size_t Curve::segment_of(double t) const {
  const auto above = std::upper_bound(knots_.begin() + 1, knots_.end() - 1, t);
  return static_cast<std::size_t>(above - knots_.begin()) - 1;
}

double Curve::length_at(double t) const {
  const double range = knots_.back();
  if (nominal_.closed) t -= range * std::floor(t / range);
  const std::size_t k = segment_of(t);
  return lengths_[k] + arc(knots_[k], t);
}

double Curve::parameter_at(double s_mm) const {
  const double all = lengths_.back();
  if (nominal_.closed) s_mm -= all * std::floor(s_mm / all);
  s_mm = std::clamp(s_mm, 0.0, all);
  const auto above = std::upper_bound(lengths_.begin() + 1, lengths_.end() - 1, s_mm);
  const auto k = static_cast<std::size_t>(above - lengths_.begin()) - 1;
  const double share = (s_mm - lengths_[k]) / (lengths_[k + 1] - lengths_[k]);
  double t = knots_[k] + share * (knots_[k + 1] - knots_[k]);
  for (int i = 0; i < 20; ++i) {
    const double error = lengths_[k] + arc(knots_[k], t) - s_mm;
    const double step = error / jet(t).derivative.norm();
    t = std::clamp(t - step, knots_[k], knots_[k + 1]);
    if (std::abs(error) < 1e-11 * (1.0 + all)) break;
  }
  return t;
}

Foot Curve::nearest(const Eigen::Vector3d& p) const {
  std::size_t best = 0;
  double least = (p - points_[0]).squaredNorm();
  for (std::size_t k = 1; k < points_.size(); ++k) {
    const double square = (p - points_[k]).squaredNorm();
    if (square < least) {
      least = square;
      best = k;
    }
  }
  const std::size_t intervals = knots_.size() - 1;
  std::vector<std::size_t> sides;
  if (best < intervals) sides.push_back(best);
  if (best > 0) sides.push_back(best - 1);
  if (nominal_.closed && best == 0) sides.push_back(intervals - 1);
  if (nominal_.closed && best == intervals) sides.push_back(0);
  Foot foot;
  foot.distance_mm = -1.0;
  for (const std::size_t k : sides) {
    // Gauss-Newton on (p - c(t)) c'(t) = 0: its error shrinks by distance times curvature in each step.
    double t = 0.5 * (knots_[k] + knots_[k + 1]);
    Jet there = jet(t);
    for (int i = 0; i < 40; ++i) {
      const double step = (p - there.point).dot(there.derivative) / there.derivative.squaredNorm();
      const double next = std::clamp(t + step, knots_[k], knots_[k + 1]);
      const double moved = std::abs(next - t);
      t = next;
      there = jet(t);
      if (moved < 1e-15 * knots_.back()) break;
    }
    const double distance = (p - there.point).norm();
    if (foot.distance_mm < 0.0 || distance < foot.distance_mm) foot = {t, distance, there};
  }
  return foot;
}

CurvePoint curve_point(const Curve& curve, double t) {
  const Jet jet = curve.jet(t);
  CurvePoint point;
  point.s_mm = curve.length_at(t);
  point.point_mm = jet.point;
  point.tangent = jet.derivative.normalized();
  point.normal = (jet.normal - jet.normal.dot(point.tangent) * point.tangent).normalized();
  return point;
}

}  // namespace crosstie::edge::detail
