#include "bundle/detail/sphere_pairs.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <string>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <Eigen/Eigenvalues>

#include "math/rigid_alignment.h"

namespace crosstie::bundle::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kSigmas = 8.0;        // a contradiction that no chance makes
constexpr double kLeast_mm = 0.1;      // smaller ones are the adjustment's business
constexpr std::size_t kAllOrders = 7;  // balls up to which all orders are tried

/// A ball in both frames.
struct Ball {
  Vector3d a = Vector3d::Zero();  ///< probed
  Vector3d b = Vector3d::Zero();  ///< listed, grown
  double sigma_a = 0.0;           ///< largest of a coordinate
  double sigma_b = 0.0;
};

double tolerance_mm(const Ball& i, const Ball& j) {
  const double square = i.sigma_a * i.sigma_a + j.sigma_a * j.sigma_a + i.sigma_b * i.sigma_b + j.sigma_b * j.sigma_b;
  return std::max(kLeast_mm, kSigmas * std::sqrt(square));
}

/// How many of the distances contradict where ball i of the list was probed as number order[i].
int contradictions(const std::vector<Ball>& balls, const std::vector<std::size_t>& order) {
  int count = 0;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double probed = (balls[order[i]].a - balls[order[j]].a).norm();
      count += std::abs(probed - (balls[i].b - balls[j].b).norm()) > tolerance_mm(balls[i], balls[j]) ? 1 : 0;
    }
  }
  return count;
}

double largest_sigma(const Matrix3d& cov) { return std::sqrt(std::max(0.0, cov.diagonal().maxCoeff())); }

/// The order in which the distances agree, where that as given does not: empty if there is none, or more than one.
std::vector<std::size_t> right_order(const std::vector<Ball>& balls) {
  std::vector<std::size_t> order(balls.size());
  std::iota(order.begin(), order.end(), 0U);
  std::vector<std::vector<std::size_t>> good;
  if (balls.size() <= kAllOrders) {
    while (std::next_permutation(order.begin(), order.end())) {
      if (contradictions(balls, order) == 0) good.push_back(order);
    }
  } else {
    for (std::size_t i = 0; i < balls.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        std::swap(order[i], order[j]);
        if (contradictions(balls, order) == 0) good.push_back(order);
        std::swap(order[i], order[j]);
      }
    }
  }
  return good.size() == 1 ? good.front() : std::vector<std::size_t>{};
}

Result<> check_units(const std::vector<Ball>& balls) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < balls.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) ratios.push_back((balls[i].a - balls[j].a).norm() / (balls[i].b - balls[j].b).norm());
  }
  std::nth_element(ratios.begin(), ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2), ratios.end());
  const double ratio = ratios[ratios.size() / 2];
  const auto near = [&](double value) { return std::abs(ratio / value - 1.0) < 0.01; };
  const char* unit = near(25.4) || near(1.0 / 25.4) ? "inches" : near(1000.0) || near(0.001) ? "metres" : nullptr;
  if (unit == nullptr) return {};
  return fail(
      ErrorCode::kBadInput,
      fmt::format("the distances between the probed spheres are {:.5g} times those of the list: one of the two is in {}", ratio,
                  unit));
}

Result<> check_diameters(const base::Cross& cross, const std::vector<base::ProbedSphere>& probed, SpherePairs& result) {
  std::vector<double> wrong;
  int compared = 0;
  for (SpherePair& pair : result.pairs) {
    const base::ProbedSphere& ball = probed[static_cast<std::size_t>(pair.probed)];
    const double listed = cross.spheres[static_cast<std::size_t>(pair.reference)].diameter_mm;
    if (!ball.diameter_mm || !(listed > 0.0)) continue;
    ++compared;
    const double difference = *ball.diameter_mm - listed;
    if (std::abs(difference) <= std::max(kLeast_mm, kSigmas * ball.diameter_sigma_mm)) continue;
    wrong.push_back(difference);
    pair.active = false;
    pair.reason = fmt::format("its probed diameter of {:.3f} mm is not the {:.3f} mm of the list", *ball.diameter_mm, listed);
  }
  if (wrong.size() > 1 && static_cast<int>(wrong.size()) == compared) {
    const auto [least, most] = std::minmax_element(wrong.begin(), wrong.end());
    if (*most - *least < 2.0 * kLeast_mm) {
      return fail(
          ErrorCode::kBadInput,
          fmt::format(
              "the probed diameters of all spheres differ from the list by {:+.3f} mm: check the diameter of the stylus, "
              "and whether the list holds diameters or radii",
              *least));
    }
    return fail(ErrorCode::kBadInput,
                "no sphere was probed with the diameter of its list: these are other spheres, or their ids are "
                "swapped");
  }
  return {};
}

Result<> check_masks(const std::vector<base::ProbedSphere>& probed, SpherePairs& result) {
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Vector3d centre = Vector3d::Zero();
  std::vector<const SpherePair*> active;
  for (const SpherePair& pair : result.pairs) {
    if (!pair.active) continue;
    active.push_back(&pair);
    centre += probed[static_cast<std::size_t>(pair.probed)].centre_mm;
  }
  centre /= static_cast<double>(active.size());
  double extent = 0.0;
  for (const SpherePair* pair : active) {
    extent = std::max(extent, (probed[static_cast<std::size_t>(pair->probed)].centre_mm - centre).norm());
  }
  int counting = 0;
  std::string masks;
  for (const SpherePair* pair : active) {
    const base::ProbedSphere& ball = probed[static_cast<std::size_t>(pair->probed)];
    Eigen::Matrix<double, 3, 6> rows;
    rows << -base::skew((ball.centre_mm - centre) / extent), Matrix3d::Identity();
    std::string letters;
    for (int axis = 0; axis < 3; ++axis) {
      if (!ball.axes[static_cast<std::size_t>(axis)]) continue;
      normal += rows.row(axis).transpose() * rows.row(axis);
      letters += "XYZ"[axis];
      ++counting;
    }
    if (letters != "XYZ")
      masks += fmt::format("{}{} of sphere {}", masks.empty() ? "" : ", ", letters.empty() ? "none" : letters, pair->id);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(normal);
  if (counting < 6 || eigen.eigenvalues()(0) < 1e-6 * eigen.eigenvalues()(5)) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format(
            "the coordinates of the spheres that count ({}) leave the machine frame free to move: 3-2-1 needs three of one "
            "axis, two of another and one of the third, on spheres that are not in one line",
            masks.empty() ? "all" : masks));
  }
  result.datum = masks.empty() ? fmt::format("best fit of {} spheres", active.size())
                               : fmt::format("{} spheres, of which only {} count{}", active.size(), masks,
                                             counting == 6 ? " (minimal: 6 coordinates)" : "");
  return {};
}

}  // namespace

Result<SpherePairs> pair_spheres(const base::Cross& cross, const std::vector<base::ProbedSphere>& probed) {
  SpherePairs result;
  std::set<int> known;
  for (std::size_t p = 0; p < probed.size(); ++p) {
    const base::ProbedSphere& ball = probed[p];
    const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(ball.cov_mm2);
    if (!ball.centre_mm.allFinite() || !ball.cov_mm2.allFinite() || !(eigen.eigenvalues()(0) > 0.0) ||
        !known.insert(ball.id).second) {
      return fail(
          ErrorCode::kBadInput,
          fmt::format("probed sphere {}: it is given twice, or its centre is not finite, or its sigmas are not positive",
                      ball.id));
    }
    const auto reference =
        std::find_if(cross.spheres.begin(), cross.spheres.end(), [&](const auto& s) { return s.id == ball.id; });
    if (reference == cross.spheres.end()) {
      result.warnings.push_back({"sphere_not_listed", fmt::format("{}", ball.id),
                                 fmt::format("sphere {} was probed, but the list of the cross does not hold it", ball.id)});
      continue;
    }
    result.pairs.push_back({ball.id, static_cast<int>(reference - cross.spheres.begin()), static_cast<int>(p)});
  }
  std::sort(result.pairs.begin(), result.pairs.end(), [](const auto& a, const auto& b) { return a.id < b.id; });
  const auto too_few = [](std::size_t count) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        fmt::format(
            "{} of the cross's spheres can be used, the machine frame needs three that are not in one line: probe more, and "
            "compare their ids with the list's",
            count));
  };
  if (result.pairs.size() < 3) return too_few(result.pairs.size());

  const double grown = 1.0 + cross.growth();
  const auto ball_of = [&](const SpherePair& pair) {
    const base::ProbedSphere& a = probed[static_cast<std::size_t>(pair.probed)];
    const base::ReferenceSphere& b = cross.spheres[static_cast<std::size_t>(pair.reference)];
    Matrix3d cov = b.cov_mm2;
    if (cross.cov_mm2.size() != 0) {
      const auto at = static_cast<Eigen::Index>(3 * (cross.markers.size() + static_cast<std::size_t>(pair.reference)));
      cov = cross.cov_mm2.block<3, 3>(at, at);
    }
    return Ball{a.centre_mm, grown * b.centre_mm, largest_sigma(a.cov_mm2), largest_sigma(cov)};
  };
  std::vector<Ball> balls;
  for (const SpherePair& pair : result.pairs) balls.push_back(ball_of(pair));
  for (std::size_t i = 0; i < balls.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if ((balls[i].b - balls[j].b).norm() < 1.0) {
        return fail(ErrorCode::kBadInput,
                    fmt::format("spheres {} and {} of the list lie in the same place", result.pairs[j].id, result.pairs[i].id));
      }
    }
  }
  if (auto units = check_units(balls); !units) return fail(std::move(units));

  std::vector<std::size_t> as_given(balls.size());
  std::iota(as_given.begin(), as_given.end(), 0U);
  if (const int wrong = contradictions(balls, as_given); wrong > 0) {
    if (const auto order = right_order(balls); !order.empty()) {
      std::vector<int> moved;
      for (std::size_t i = 0; i < order.size(); ++i) {
        if (order[i] != i) moved.push_back(result.pairs[i].id);
      }
      return fail(ErrorCode::kBadInput,
                  fmt::format("spheres {} are swapped: their distances agree with the list only when their ids change places",
                              fmt::join(moved, ", ")));
    }
  }
  if (auto checked = check_diameters(cross, probed, result); !checked) return fail(std::move(checked));

  // One ball at a time, the one without which least contradicts, is set aside.
  for (;;) {
    std::vector<std::size_t> at;
    std::vector<Ball> left;
    for (std::size_t i = 0; i < result.pairs.size(); ++i) {
      if (!result.pairs[i].active) continue;
      at.push_back(i);
      left.push_back(balls[i]);
    }
    if (left.size() < 3) return too_few(left.size());
    std::vector<std::size_t> order(left.size());
    std::iota(order.begin(), order.end(), 0U);
    const int wrong = contradictions(left, order);
    if (wrong == 0) break;
    double worst_mm = 0.0;
    std::pair<int, int> worst;
    for (std::size_t i = 0; i < left.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const double off = (left[i].a - left[j].a).norm() - (left[i].b - left[j].b).norm();
        if (std::abs(off) <= std::abs(worst_mm)) continue;
        worst_mm = off;
        worst = {result.pairs[at[j]].id, result.pairs[at[i]].id};
      }
    }
    std::size_t culprit = left.size();
    for (std::size_t i = 0; i < left.size() && left.size() > 3; ++i) {
      std::vector<Ball> others = left;
      others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
      std::vector<std::size_t> same(others.size());
      std::iota(same.begin(), same.end(), 0U);
      if (contradictions(others, same) == 0) culprit = culprit == left.size() ? i : left.size() + 1;
    }
    if (culprit >= left.size()) {
      return fail(
          ErrorCode::kBadInput,
          fmt::format(
              "the distance of spheres {} and {} as probed differs from the list by {:+.3f} mm: was the radius of ball and "
              "stylus taken into account, and are these the spheres of the list?",
              worst.first, worst.second, worst_mm));
    }
    SpherePair& pair = result.pairs[at[culprit]];
    pair.active = false;
    pair.reason = fmt::format("its distances to the others contradict the list by up to {:.3f} mm", std::abs(worst_mm));
  }

  std::vector<math::AlignmentPair> pairs;
  for (const SpherePair& pair : result.pairs) {
    if (!pair.active) continue;
    const Ball ball = ball_of(pair);
    pairs.push_back({ball.a, ball.b, probed[static_cast<std::size_t>(pair.probed)].cov_mm2,
                     Matrix3d(Matrix3d::Identity() * ball.sigma_b * ball.sigma_b)});
  }
  const auto fit = math::align(pairs);
  if (!fit) {
    return fail(fit.error().code,
                fit.error().code == ErrorCode::kNoUniqueSolution
                    ? std::string("the spheres lie on one line, the machine frame could turn about it: probe one beside "
                                  "the line")
                    : "spheres: " + fit.error().message);
  }
  result.machine_from_cross = fit->a_from_b;
  if (const auto scaled = math::align(pairs, {.with_scale = true}); scaled) {
    result.scale_ppm = 1e6 * (scaled->scale - 1.0);
    result.scale_sigma_ppm = 1e6 * std::sqrt(std::max(0.0, scaled->covariance(6, 6)));
  }
  if (auto masks = check_masks(probed, result); !masks) return fail(std::move(masks));
  return result;
}

}  // namespace crosstie::bundle::detail
