#include "edge/detail/form.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/QR>

#include "math/distributions.h"
#include "math/median.h"

namespace crosstie::edge::detail {
namespace {

constexpr double kChance = 0.01;  // of one rim without a form, as for rejections elsewhere
constexpr std::size_t kMostPoints =
    250;  // of which the process is estimated: every so many of a denser rim follow the same one
constexpr std::size_t kLeastPoints = 8;
constexpr double kLeastSigma = 0.02;  // of the rms deviation: less is nothing
constexpr double kMostSigma = 20.0;
constexpr double kGolden = 0.6180339887498949;
constexpr int kGoldenSteps = 14;
constexpr double kLengthStep = 1.6;  // from one length to the next
constexpr double kLongest = 0.5;     // of the rim: over a longer way a form is hardly told from another size

/// Distance of points along the rim, as FormComponent has it: by the chord every correlation stays one round a closed rim.
double distance_mm(const base::EdgeCurve& rim, std::size_t i, std::size_t k) {
  const double way = std::abs(rim.points[i].s_mm - rim.points[k].s_mm);
  constexpr double kPi = std::numbers::pi;
  return rim.closed ? std::abs(rim.length_mm / kPi * std::sin(kPi * way / rim.length_mm)) : way;
}

/// The deviations in one direction.
struct Direction {
  Eigen::VectorXd off_mm;   ///< with what the points share in it
  Eigen::MatrixXd basis;    ///< orthonormal, of the derivatives by the unknowns
  Eigen::MatrixXd cov_mm2;  ///< own and shared
  Eigen::MatrixXd distances_mm;
};

Direction direction_of(const base::EdgeCurve& rim, const NominalProblem& problem, const NominalState& state,
                       const NominalProblem::Linear& linear, Eigen::Index row) {
  const std::size_t stride = (linear.points.size() + kMostPoints - 1) / kMostPoints;
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < linear.points.size(); k += stride) chosen.push_back(k);
  const auto n = static_cast<Eigen::Index>(chosen.size());
  const auto free = static_cast<Eigen::Index>(problem.free_count());
  const Eigen::Index causes = linear.jacobian.cols() - free;
  Eigen::MatrixXd by_unknowns(n, free), shared(n, causes);
  Direction direction{Eigen::VectorXd(n), {}, Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd(n, n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::size_t k = chosen[static_cast<std::size_t>(i)];
    const Eigen::Index at = 2 * static_cast<Eigen::Index>(k) + row;
    by_unknowns.row(i) = linear.jacobian.row(at).head(free);
    shared.row(i) = linear.jacobian.row(at).tail(causes);
    direction.off_mm(i) = linear.off_mm(at);
    if (causes > 0) direction.off_mm(i) -= shared.row(i).dot(state.shared);
    direction.cov_mm2(i, i) = linear.cov_mm2[k](row, row);
    for (Eigen::Index j = 0; j < n; ++j)
      direction.distances_mm(i, j) = distance_mm(rim, linear.points[k], linear.points[chosen[static_cast<std::size_t>(j)]]);
  }
  direction.cov_mm2 += shared * shared.transpose();
  // Not all unknowns show in one direction; columns to one scale, for the rank.
  for (Eigen::Index c = 0; c < free; ++c) {
    const double norm = by_unknowns.col(c).norm();
    if (norm > 0.0) by_unknowns.col(c) /= norm;
  }
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(by_unknowns);
  qr.setThreshold(1e-6);
  const Eigen::MatrixXd q = qr.householderQ() * Eigen::MatrixXd::Identity(n, qr.rank());
  direction.basis = q;
  return direction;
}

/// -2 log of the restricted likelihood, without constants.
double minus_two_log(const Direction& direction, double variance_mm2, const Eigen::MatrixXd& correlations) {
  const Eigen::MatrixXd cov = direction.cov_mm2 + variance_mm2 * correlations;
  const Eigen::LLT<Eigen::MatrixXd> root(cov);
  if (root.info() != Eigen::Success) return HUGE_VAL;
  const Eigen::MatrixXd a = root.matrixL().solve(direction.basis);
  const Eigen::VectorXd r = root.matrixL().solve(direction.off_mm);
  const Eigen::LLT<Eigen::MatrixXd> normal(a.transpose() * a);
  if (normal.info() != Eigen::Success) return HUGE_VAL;
  const Eigen::VectorXd right = a.transpose() * r;
  const auto log_of = [](const Eigen::LLT<Eigen::MatrixXd>& llt) {
    return 2.0 * llt.matrixLLT().diagonal().array().log().sum();
  };
  return log_of(root) + log_of(normal) + r.squaredNorm() - right.dot(normal.solve(right));
}

/// The variance that is best for given correlations, by golden section of its logarithm; the criterion there.
FormComponent::Part best_variance(const Direction& direction, double length_mm, bool smooth, double rms_mm, double& least) {
  const FormComponent unit{{{1.0, length_mm, smooth}}};
  const Eigen::MatrixXd correlations = direction.distances_mm.unaryExpr([&](double way) { return unit.cov_mm2(way); });
  const auto at = [&](double log_sigma) { return minus_two_log(direction, std::exp(2.0 * log_sigma), correlations); };
  double low = std::log(kLeastSigma * rms_mm), high = std::log(kMostSigma * rms_mm);
  double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
  double at_a = at(a), at_b = at(b);
  for (int step = 0; step < kGoldenSteps; ++step) {
    if (at_a < at_b) {
      high = b, b = a, at_b = at_a;
      at_a = at(a = high - kGolden * (high - low));
    } else {
      low = a, a = b, at_a = at_b;
      at_b = at(b = low + kGolden * (high - low));
    }
  }
  least = std::min(at_a, at_b);
  return {std::exp(2.0 * (at_a < at_b ? a : b)), length_mm, smooth};
}

FormComponent component_of(const Direction& direction, double length_mm, bool contradicts) {
  const auto n = direction.off_mm.size();
  if (n < static_cast<Eigen::Index>(kLeastPoints) || n <= direction.basis.cols() + 2) return {};
  const double rms_mm = std::sqrt(direction.off_mm.squaredNorm() / static_cast<double>(n));
  if (!(rms_mm > 0.0)) return {};
  std::vector<double> steps;
  for (Eigen::Index i = 0; i + 1 < n; ++i) steps.push_back(direction.distances_mm(i, i + 1));
  const double spacing_mm = math::median(steps);
  FormComponent all;
  std::vector<double> criteria;
  const auto add = [&](double length, bool smooth) {
    all.parts.push_back(best_variance(direction, length, smooth, rms_mm, criteria.emplace_back()));
  };
  add(0.0, false);
  if (spacing_mm > 0.0) {
    for (double length = 0.5 * spacing_mm; length <= kLongest * length_mm; length *= kLengthStep) add(length, false);
    for (double length = 2.0 * spacing_mm; length <= kLongest * length_mm; length *= kLengthStep) add(length, true);
  }
  const double without = minus_two_log(direction, 0.0, direction.distances_mm);
  const double least = *std::min_element(criteria.begin(), criteria.end());
  const double gain = without - least;
  if (!(gain > (contradicts ? 0.0 : math::chi_square_quantile(1.0 - kChance, 2.0)))) return {};
  double sum = 0.0;
  for (std::size_t i = 0; i < criteria.size(); ++i) {
    const double share = std::exp(-0.5 * (criteria[i] - least));
    all.parts[i].variance_mm2 *= share;
    sum += share;
  }
  for (FormComponent::Part& part : all.parts) part.variance_mm2 /= sum;
  return all;
}

}  // namespace

RimForm form_of(const base::EdgeCurve& rim, const NominalProblem& problem, const NominalState& state, bool contradicts) {
  const auto linear = problem.linear(state);
  if (!linear) return {};
  RimForm form;
  form.across = component_of(direction_of(rim, problem, state, *linear, 0), rim.length_mm, contradicts);
  form.along_normal = component_of(direction_of(rim, problem, state, *linear, 1), rim.length_mm, contradicts);
  return form;
}

base::EdgeCurve with_form(const base::EdgeCurve& rim, const RimForm& form) {
  base::EdgeCurve result = rim;
  for (base::EdgePoint& point : result.points) {
    // Along the rim it does no harm: distances are across it.
    const Eigen::Matrix3d along_normal = point.normal * point.normal.transpose();
    point.cov_mm2 +=
        form.across.cov_mm2(0.0) * (Eigen::Matrix3d::Identity() - along_normal) + form.along_normal.cov_mm2(0.0) * along_normal;
  }
  return result;
}

std::optional<Eigen::MatrixXd> covariance_with_form(const base::EdgeCurve& rim_with_form, const NominalProblem& problem,
                                                    const NominalState& state, const RimForm& form,
                                                    const Eigen::MatrixXd& cofactor) {
  const auto linear = problem.linear(state);
  if (!linear) return std::nullopt;
  const auto free = static_cast<Eigen::Index>(problem.free_count());
  const auto n = static_cast<Eigen::Index>(linear->points.size());
  // The unknowns by each point's u and v.
  Eigen::MatrixXd by_off(free, 2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Matrix2d weight = linear->cov_mm2[static_cast<std::size_t>(i)].inverse();
    by_off.middleCols<2>(2 * i) = cofactor.topRows(free) * linear->jacobian.middleRows<2>(2 * i).transpose() * weight;
  }
  Eigen::MatrixXd covariance = cofactor.topLeftCorner(free, free);
  for (int row = 0; row < 2; ++row) {
    const FormComponent& component = row == 0 ? form.across : form.along_normal;
    if (component.parts.empty()) continue;
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto of = by_off.col(2 * i + row);
      if (rim_with_form.closed) {
        covariance -= component.cov_mm2(0.0) * of * of.transpose();
        continue;
      }
      for (Eigen::Index k = 0; k < i; ++k) {
        const double distance = distance_mm(rim_with_form, linear->points[static_cast<std::size_t>(i)],
                                            linear->points[static_cast<std::size_t>(k)]);
        const Eigen::MatrixXd product = component.cov_mm2(distance) * of * by_off.col(2 * k + row).transpose();
        covariance += product + product.transpose();
      }
    }
  }
  return covariance;
}

}  // namespace crosstie::edge::detail
