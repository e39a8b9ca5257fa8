#include "verify/repeatability.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "base/pose.h"
#include "math/distributions.h"
#include "math/rigid_alignment.h"
#include "math/shape_fit.h"

namespace crosstie::verify {
namespace {

using base::ErrorCode;
using base::fail;
using base::RepeatedGroup;
using base::RepeatedQuantity;
using base::Result;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double kTail = 0.025;           // of a two-sided interval of 95 %
constexpr std::size_t kRunsThatTell = 5;  // how quantities go together

/// Probability, two-sided, of square = s^2 / sigma^2 with the degrees of freedom of both.
double probability(double square, double dof, double sigma_dof) {
  if (!(sigma_dof > 0.0)) return math::chi_square_two_sided(square * dof, dof);
  const double below = math::f_cdf(square, dof, sigma_dof);
  return 2.0 * std::min(below, 1.0 - below);
}

void fill(RepeatedQuantity& quantity, double sigma_dof) {
  const auto n = static_cast<double>(quantity.values.size());
  double sum = 0.0;
  for (const double value : quantity.values) sum += value;
  quantity.mean = sum / n;
  double squares = 0.0;
  for (const double value : quantity.values) squares += std::pow(value - quantity.mean, 2);
  const double dof = n - 1.0;
  quantity.sd = std::sqrt(squares / dof);
  quantity.sd_low = std::sqrt(squares / math::chi_square_quantile(1.0 - kTail, dof));
  quantity.sd_high = std::sqrt(squares / math::chi_square_quantile(kTail, dof));
  double predicted = 0.0;
  for (const double sigma : quantity.sigmas) predicted += sigma * sigma / n;
  quantity.predicted = std::sqrt(predicted);
  if (!(quantity.predicted > 0.0)) return;
  quantity.ratio = quantity.sd / quantity.predicted;
  quantity.p = probability(quantity.ratio * quantity.ratio, dof, sigma_dof);
}

/// (tr R)^2 / tr R^2 of the correlations R: how many independent quantities they are worth. Those without variance count for none.
double worth_of(const MatrixXd& covariance) {
  double trace = 0.0;
  double squares = 0.0;
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    if (!(covariance(i, i) > 0.0)) continue;
    trace += 1.0;
    for (Eigen::Index k = 0; k < covariance.cols(); ++k) {
      if (covariance(k, k) > 0.0) squares += covariance(i, k) * covariance(i, k) / (covariance(i, i) * covariance(k, k));
    }
  }
  return trace > 0.0 ? trace * trace / squares : 1.0;
}

/// The points' covariance as a matrix over the common ids.
MatrixXd covariance_of(const RepeatedPoints& run, const std::vector<std::size_t>& common) {
  const auto size = static_cast<Eigen::Index>(3 * common.size());
  MatrixXd result = MatrixXd::Zero(size, size);
  for (std::size_t a = 0; a < common.size(); ++a) {
    const auto to = static_cast<Eigen::Index>(3 * a);
    if (run.cov_mm2.size() == 0) {
      const auto& own = run.points.points[common[a]].cov_mm2;
      if (own) result.block<3, 3>(to, to) = *own;
      continue;
    }
    for (std::size_t b = 0; b < common.size(); ++b) {
      result.block<3, 3>(to, static_cast<Eigen::Index>(3 * b)) =
          run.cov_mm2.block<3, 3>(static_cast<Eigen::Index>(3 * common[a]), static_cast<Eigen::Index>(3 * common[b]));
    }
  }
  return result;
}

/// M = I - J (J'J)^-1 J' of a rigid fit with equal weights at these places.
MatrixXd after_fit(const std::vector<Vector3d>& places) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& p : places) mean += p / static_cast<double>(places.size());
  const auto size = static_cast<Eigen::Index>(3 * places.size());
  MatrixXd j(size, 6);
  for (std::size_t i = 0; i < places.size(); ++i)
    j.middleRows<3>(static_cast<Eigen::Index>(3 * i)) << -base::skew(places[i] - mean), Eigen::Matrix3d::Identity();
  return MatrixXd::Identity(size, size) - j * (j.transpose() * j).ldlt().solve(j.transpose());
}

/// A rim as radius and height over the angle about an axis.
struct Polar {
  std::vector<double> angle;
  std::vector<double> radius;
  std::vector<double> height;
  std::vector<double> radius_sigma;
  std::vector<double> height_sigma;
  std::vector<Vector3d> point;
};

Polar polar_of(const RepeatedRim& rim, const Vector3d& centre, const Vector3d& axis) {
  const Vector3d e1 = axis.unitOrthogonal();
  const Vector3d e2 = axis.cross(e1);
  std::vector<std::pair<double, const base::EdgePoint*>> order;
  for (const base::EdgePoint& p : rim.points) {
    const Vector3d off = p.point_mm - centre;
    order.emplace_back(std::atan2(off.dot(e2), off.dot(e1)), &p);
  }
  std::sort(order.begin(), order.end());
  Polar polar;
  const std::size_t n = order.size();
  for (std::size_t i = 0; i < n; ++i) {
    const auto& [angle, p] = order[i];
    const Vector3d off = p->point_mm - centre;
    const double height = off.dot(axis);
    const Vector3d radial = (off - height * axis).normalized();
    Vector3d along = p->tangent;
    if (along.isZero(0.0)) {  // a table of points without tangents: by the neighbours
      constexpr std::size_t kNeighbour = 3;
      along = order[(i + kNeighbour) % n].second->point_mm - order[(i + n - kNeighbour % n) % n].second->point_mm;
    }
    const Vector3d across = p->normal.cross(along).normalized();
    polar.angle.push_back(angle);
    polar.radius.push_back((off - height * axis).norm());
    polar.height.push_back(height);
    polar.radius_sigma.push_back(p->sigma_u_mm / std::max(0.1, std::abs(across.dot(radial))));
    polar.height_sigma.push_back(p->sigma_v_mm);
    polar.point.push_back(p->point_mm);
  }
  return polar;
}

/// Values of a rim at an angle between its two neighbouring points; nothing in a gap.
std::optional<std::array<double, 4>> at_angle(const Polar& polar, double angle, double max_gap_mm) {
  const std::size_t n = polar.angle.size();
  const auto above =
      static_cast<std::size_t>(std::upper_bound(polar.angle.begin(), polar.angle.end(), angle) - polar.angle.begin());
  const std::size_t i = (above + n - 1) % n;
  const std::size_t k = above % n;
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const double width = std::remainder(polar.angle[k] - polar.angle[i] - std::numbers::pi, kTurn) + std::numbers::pi;
  const double part = std::remainder(angle - polar.angle[i] - std::numbers::pi, kTurn) + std::numbers::pi;
  if (!((polar.point[k] - polar.point[i]).norm() <= max_gap_mm) || !(width > 0.0) || part > width) return std::nullopt;
  const double t = part / width;
  const auto between = [&](const std::vector<double>& values) { return (1.0 - t) * values[i] + t * values[k]; };
  // Neighbours err together more than not: no smaller sigma is claimed for the mean of two.
  return std::array<double, 4>{between(polar.radius), between(polar.height), between(polar.radius_sigma),
                               between(polar.height_sigma)};
}

}  // namespace

Result<RepeatedGroup> repeat_group(std::string name, std::vector<RepeatedQuantity> quantities, double sigma_dof,
                                   const MatrixXd& predicted_cov) {
  RepeatedGroup group;
  group.name = std::move(name);
  if (quantities.empty()) return fail(ErrorCode::kBadInput, group.name + ": nothing that all runs have");
  const std::size_t n = quantities.front().values.size();
  for (RepeatedQuantity& quantity : quantities) {
    if (quantity.values.size() != n || n < 2 || (!quantity.sigmas.empty() && quantity.sigmas.size() != n))
      return fail(ErrorCode::kBadInput, fmt::format("{}: {} values, two or more are needed, and as many of each quantity",
                                                    quantity.name, quantity.values.size()));
    fill(quantity, sigma_dof);
    group.sd += quantity.sd * quantity.sd;
    group.predicted += quantity.predicted * quantity.predicted;
  }
  const auto q = static_cast<double>(quantities.size());
  group.sd = std::sqrt(group.sd / q);
  group.predicted = std::sqrt(group.predicted / q);
  group.quantities = std::move(quantities);
  std::vector<const RepeatedQuantity*> known;
  for (const RepeatedQuantity& quantity : group.quantities) {
    if (quantity.predicted > 0.0) known.push_back(&quantity);
  }
  if (known.empty()) return group;
  MatrixXd z(static_cast<Eigen::Index>(n), static_cast<Eigen::Index>(known.size()));
  for (std::size_t k = 0; k < known.size(); ++k) {
    for (std::size_t i = 0; i < n; ++i) {
      z(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) =
          (known[k]->values[i] - known[k]->mean) / known[k]->predicted;
    }
  }
  const double runs = static_cast<double>(n) - 1.0;
  const MatrixXd gram = z * z.transpose() / runs;
  const double trace = gram.trace();
  const double square = trace / static_cast<double>(known.size());
  group.ratio = std::sqrt(square);
  group.dof = runs;
  if (predicted_cov.size() > 0) {
    group.dof = runs * worth_of(predicted_cov);
  } else if (n >= kRunsThatTell) {
    const double traces = runs * runs / ((runs - 1.0) * (runs + 2.0)) * (gram.squaredNorm() - trace * trace / runs);
    const double most = runs * static_cast<double>(known.size());
    group.dof = std::clamp(traces > 0.0 ? 0.5 * runs * trace * trace / traces : most, runs, most);
  }
  group.ratio_low = std::sqrt(square * group.dof / math::chi_square_quantile(1.0 - kTail, group.dof));
  group.ratio_high = std::sqrt(square * group.dof / math::chi_square_quantile(kTail, group.dof));
  group.p = probability(square, group.dof, sigma_dof);
  return group;
}

Result<RepeatedGroup> repeat_points(const std::vector<RepeatedPoints>& runs, bool align) {
  if (runs.size() < 2) return fail(ErrorCode::kBadInput, "two runs or more are needed");
  std::vector<int> ids;
  for (const base::ReferencePoint& point : runs.front().points.points) {
    const bool everywhere = point.has_own_id && std::all_of(runs.begin(), runs.end(), [&](const RepeatedPoints& run) {
                              const auto* found = run.points.find(point.id);
                              return found != nullptr && found->has_own_id;
                            });
    if (everywhere) ids.push_back(point.id);
  }
  if (ids.empty() || (align && ids.size() < 3))
    return fail(ErrorCode::kNoUniqueSolution, fmt::format("{} points are common to all runs, three are needed", ids.size()));
  std::vector<std::vector<std::size_t>> places(runs.size());
  std::vector<std::vector<Vector3d>> xyz(runs.size());
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (const int id : ids) {
      const auto* found = runs[r].points.find(id);
      places[r].push_back(static_cast<std::size_t>(found - runs[r].points.points.data()));
      xyz[r].push_back(found->xyz_mm);
    }
  }
  std::vector<Eigen::Quaterniond> turns(runs.size(), Eigen::Quaterniond::Identity());
  if (align) {
    std::vector<Vector3d> mean = xyz.front();
    for (int round = 0; round < 5; ++round) {
      std::vector<Vector3d> next(ids.size(), Vector3d::Zero());
      for (std::size_t r = 0; r < runs.size(); ++r) {
        std::vector<math::AlignmentPair> pairs(ids.size());
        for (std::size_t i = 0; i < ids.size(); ++i) {
          pairs[i].a_mm = mean[i];
          pairs[i].b_mm = xyz[r][i];
        }
        const auto fit = math::align(pairs, {.with_scale = false, .weighted = false});
        if (!fit) return fail(fit.error().code, fmt::format("{}: {}", runs[r].run, fit.error().message));
        for (std::size_t i = 0; i < ids.size(); ++i) {
          xyz[r][i] = fit->a_from_b * xyz[r][i];
          next[i] += xyz[r][i] / static_cast<double>(runs.size());
        }
        turns[r] = fit->a_from_b.rotation * turns[r];
      }
      mean = std::move(next);
    }
  }
  std::vector<RepeatedQuantity> quantities;
  for (const int id : ids) {
    for (const char axis : {'x', 'y', 'z'}) quantities.push_back({.name = fmt::format("point {} {}", id, axis)});
  }
  MatrixXd mean_cov =
      MatrixXd::Zero(static_cast<Eigen::Index>(quantities.size()), static_cast<Eigen::Index>(quantities.size()));
  for (std::size_t r = 0; r < runs.size(); ++r) {
    MatrixXd covariance = covariance_of(runs[r], places[r]);
    if (align) {
      const Eigen::Matrix3d turn = turns[r].toRotationMatrix();
      for (Eigen::Index a = 0; a < covariance.rows(); a += 3) {
        for (Eigen::Index b = 0; b < covariance.cols(); b += 3)
          covariance.block<3, 3>(a, b) = (turn * covariance.block<3, 3>(a, b) * turn.transpose()).eval();
      }
      const MatrixXd m = after_fit(xyz[r]);
      covariance = m * covariance * m;
    }
    mean_cov += covariance / static_cast<double>(runs.size());
    for (std::size_t k = 0; k < quantities.size(); ++k) {
      const auto at = static_cast<Eigen::Index>(k);
      quantities[k].values.push_back(xyz[r][k / 3](at % 3));
      quantities[k].sigmas.push_back(std::sqrt(std::max(0.0, covariance(at, at))));
    }
  }
  auto group = repeat_group("points", std::move(quantities), 0.0, mean_cov);
  if (!group) return group;
  group->about =
      align ? "each run laid onto the mean of all by a rigid fit with equal weights, whose six parameters are taken out of the "
              "predicted sigmas"
            : "coordinates as they stand, in one frame";
  return group;
}

Result<std::vector<RepeatedGroup>> repeat_rims(const std::vector<RepeatedRim>& runs, int places, double max_gap_mm) {
  if (runs.size() < 2) return fail(ErrorCode::kBadInput, "two runs or more are needed");
  std::vector<Vector3d> all;
  for (const RepeatedRim& run : runs) {
    if (run.points.size() < 3) return fail(ErrorCode::kBadInput, run.run + ": a rim of less than three points");
    for (const base::EdgePoint& p : run.points) all.push_back(p.point_mm);
  }
  const auto plane = math::fit_plane(all);
  if (!plane) return tl::unexpected(plane.error());
  const auto circle = math::fit_circle(all);
  const Vector3d centre = circle ? circle->shape.centre_mm : plane->shape.point_mm;
  const Vector3d axis = plane->shape.normal;
  std::vector<Polar> polars;
  for (const RepeatedRim& run : runs) polars.push_back(polar_of(run, centre, axis));
  std::vector<RepeatedQuantity> radial;
  std::vector<RepeatedQuantity> normal;
  for (int k = 0; k < places; ++k) {
    const double degrees = 360.0 * k / places - 180.0;
    RepeatedQuantity r{.name = fmt::format("rim {:.0f} deg, radial", degrees)};
    RepeatedQuantity h{.name = fmt::format("rim {:.0f} deg, normal", degrees)};
    bool everywhere = true;
    for (const Polar& polar : polars) {
      const auto at = at_angle(polar, degrees * std::numbers::pi / 180.0, max_gap_mm);
      everywhere = everywhere && at;
      if (!everywhere) break;
      r.values.push_back((*at)[0]);
      h.values.push_back((*at)[1]);
      r.sigmas.push_back((*at)[2]);
      h.sigmas.push_back((*at)[3]);
    }
    if (!everywhere) continue;
    radial.push_back(std::move(r));
    normal.push_back(std::move(h));
  }
  constexpr std::size_t kLeast = 8;
  if (radial.size() < kLeast)
    return fail(ErrorCode::kNoUniqueSolution,
                fmt::format("the rims have {} of {} angles in common, {} are needed", radial.size(), places, kLeast));
  std::vector<RepeatedGroup> groups;
  for (auto& [name, quantities] :
       {std::pair<const char*, std::vector<RepeatedQuantity>&>{"rim, radial", radial}, {"rim, normal", normal}}) {
    auto group = repeat_group(name, std::move(quantities));
    if (!group) return fail(std::move(group));
    group->about = fmt::format("at equal angles about ({:.1f}, {:.1f}, {:.1f}) mm, the runs in one frame", centre.x(),
                               centre.y(), centre.z());
    groups.push_back(*std::move(group));
  }
  return groups;
}

}  // namespace crosstie::verify
