#include "edge/nominal.h"

#include <algorithm>
#include <numeric>

#include <Eigen/Geometry>

#include "edge/detail/curve.h"

namespace crosstie::edge {
namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

bool cross_each_other(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c, const Eigen::Vector2d& d) {
  const double c_side = cross(b - a, c - a);
  const double d_side = cross(b - a, d - a);
  const double a_side = cross(d - c, a - c);
  const double b_side = cross(d - c, b - c);
  return c_side * d_side < 0.0 && a_side * b_side < 0.0;
}

}  // namespace

std::string_view name_of(NominalKind kind) {
  switch (kind) {
    case NominalKind::kCircle:
      return "circle";
    case NominalKind::kEllipse:
      return "ellipse";
    case NominalKind::kOval:
      return "oval";
    case NominalKind::kSuperellipse:
      return "superellipse";
    case NominalKind::kPoints:
      return "points";
  }
  return "";
}

std::optional<NominalKind> outline_of(std::string_view name) {
  for (const NominalKind kind : {NominalKind::kCircle, NominalKind::kEllipse, NominalKind::kOval, NominalKind::kSuperellipse}) {
    if (name == name_of(kind)) return kind;
  }
  return std::nullopt;
}

std::vector<std::string> size_names(NominalKind kind) {
  if (kind == NominalKind::kPoints) return {};
  if (kind == NominalKind::kCircle) return {"diameter"};
  return {"length", "width"};
}

base::Result<NominalCurve> NominalCurve::make(const Nominal& nominal) {
  auto curve = detail::Curve::make(nominal);
  if (!curve) return base::fail(std::move(curve));
  return NominalCurve(std::make_shared<const detail::Curve>(*std::move(curve)));
}

double NominalCurve::length_mm() const { return curve_->length_mm(); }
bool NominalCurve::closed() const { return curve_->closed(); }
const std::vector<double>& NominalCurve::corners_mm() const { return curve_->corners_mm(); }

CurvePoint NominalCurve::at(double s_mm) const { return detail::curve_point(*curve_, curve_->parameter_at(s_mm)); }

CurvePoint NominalCurve::nearest(const Eigen::Vector3d& p_in_hole) const {
  return detail::curve_point(*curve_, curve_->nearest(p_in_hole).t);
}

Nominal mirrored(const Nominal& nominal) {
  Nominal other = nominal;
  for (auto* list : {&other.points_mm, &other.normals}) {
    for (auto& p : *list) p.y() = -p.y();
    std::reverse(list->begin(), list->end());  // it still runs counter-clockwise
  }
  if (other.saddle) other.saddle->direction_rad = -other.saddle->direction_rad;
  return other;
}

std::optional<std::pair<std::size_t, std::size_t>> self_crossing(const std::vector<Eigen::Vector3d>& points_mm, bool closed,
                                                                 const Eigen::Vector3d& normal) {
  const Eigen::Vector3d e1 = normal.unitOrthogonal();
  const Eigen::Vector3d e2 = normal.cross(e1);
  std::vector<Eigen::Vector2d> flat;
  for (const auto& p : points_mm) flat.emplace_back(e1.dot(p), e2.dot(p));
  const std::size_t n = flat.size();
  const std::size_t segments = closed ? n : n - 1;
  std::vector<std::size_t> order(segments);
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto low = [&](std::size_t i) { return std::min(flat[i].x(), flat[(i + 1) % n].x()); };
  const auto high = [&](std::size_t i) { return std::max(flat[i].x(), flat[(i + 1) % n].x()); };
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return low(a) < low(b); });
  for (std::size_t a = 0; a < segments; ++a) {
    for (std::size_t b = a + 1; b < segments && low(order[b]) <= high(order[a]); ++b) {
      const std::size_t i = std::min(order[a], order[b]);
      const std::size_t j = std::max(order[a], order[b]);
      if (j == i + 1 || (closed && i == 0 && j == segments - 1)) continue;
      if (cross_each_other(flat[i], flat[(i + 1) % n], flat[j], flat[(j + 1) % n])) return std::pair{i, j};
    }
  }
  return std::nullopt;
}

}  // namespace crosstie::edge
