#include "math/variance_components.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include <Eigen/LU>

#include "math/cofactors.h"
#include "math/distributions.h"
#include "math/normal_equations.h"

namespace crosstie::math {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kExactRows = 100;
constexpr double kLeastFactor = 1e-12;  // of observations without any noise
constexpr double kLargestStep = 4.0;    // of the logarithm of a factor at once
constexpr double kNear = 2.0;           // v'Pv over redundancy at which all factors are near

/// Divides the rows of each group by the root of its factor.
WhitenedRows weighted(const WhitenedRows& rows, std::span<const int> component, const VectorXd& factors) {
  WhitenedRows result = rows;
  for (int g = 0; g < rows.group_count(); ++g) {
    const int c = component[static_cast<std::size_t>(g)];
    if (c < 0) continue;
    const double scale = 1.0 / std::sqrt(factors(c));
    result.residual(g) *= scale;
    for (std::size_t t = 0; t < rows.terms(g).size(); ++t) result.jacobian(g, t) *= scale;
  }
  return result;
}

/// J x of one group.
MatrixXd product(const WhitenedRows& rows, const Parameters& parameters, int g, const MatrixXd& x) {
  MatrixXd sum = MatrixXd::Zero(rows.group(g).rows, x.cols());
  const auto terms = rows.terms(g);
  for (std::size_t t = 0; t < terms.size(); ++t)
    sum += rows.jacobian(g, t) * x.middleRows(parameters.block(terms[t].block).offset, terms[t].size);
  return sum;
}

/// The groups of rows of each component.
std::vector<std::vector<int>> members_of(const WhitenedRows& rows, std::span<const int> component, int count) {
  std::vector<std::vector<int>> members(static_cast<std::size_t>(count));
  for (int g = 0; g < rows.group_count(); ++g) {
    const int c = component[static_cast<std::size_t>(g)];
    if (c >= 0) members[static_cast<std::size_t>(c)].push_back(g);
  }
  return members;
}

/// sum_j over the rows of each component of (M Z)_j^2, Z unit vectors or random signs on the rows of component `from`.
VectorXd traces(const WhitenedRows& rows, const NormalEquations& equations, std::span<const int> component,
                const std::vector<std::vector<int>>& members, int from, int probes) {
  const Parameters& parameters = equations.parameters();
  const std::vector<int>& groups = members[static_cast<std::size_t>(from)];
  int size = 0;
  for (const int g : groups) size += rows.group(g).rows;
  const bool exact = size <= std::max(kExactRows, probes);
  const int columns = exact ? size : probes;
  std::mt19937_64 random(static_cast<std::uint64_t>(from) + 1);
  MatrixXd z = MatrixXd::Zero(size, columns);
  if (exact) {
    z.setIdentity();
  } else {
    for (double& value : z.reshaped()) value = (random() >> 63U) != 0 ? 1.0 : -1.0;
  }
  MatrixXd right = MatrixXd::Zero(parameters.size(), columns);
  int at = 0;
  for (const int g : groups) {
    const auto part = z.middleRows(at, rows.group(g).rows);
    const auto terms = rows.terms(g);
    for (std::size_t t = 0; t < terms.size(); ++t) {
      right.middleRows(parameters.block(terms[t].block).offset, terms[t].size) += rows.jacobian(g, t).transpose() * part;
    }
    at += rows.group(g).rows;
  }
  const MatrixXd x = equations.solve(right);
  VectorXd sums = VectorXd::Zero(static_cast<Eigen::Index>(members.size()));
  for (int g = 0; g < rows.group_count(); ++g) {
    const int c = component[static_cast<std::size_t>(g)];
    if (c >= 0 && c != from) sums(c) += product(rows, parameters, g, x).squaredNorm();
  }
  return exact ? sums : VectorXd(sums / columns);
}

/// S over the estimated components, its row sums r_i less what is shared with rows that are not in question.
MatrixXd information(const WhitenedRows& rows, const NormalEquations& equations, std::span<const int> component,
                     const std::vector<std::vector<int>>& members, const VectorXd& redundancy, int probes) {
  const auto count = static_cast<int>(members.size());
  // Rows that are not in question, as one more component: M is idempotent, so that all traces of a row of S add up to r_i.
  std::vector<int> all(component.begin(), component.end());
  for (int& c : all) c = c < 0 ? count : c;
  std::vector<std::vector<int>> with_rest = members;
  with_rest.emplace_back();
  MatrixXd s = MatrixXd::Zero(count, count + 1);
  for (int i = 0; i < count; ++i) {
    if (!members[static_cast<std::size_t>(i)].empty())
      s.row(i) = traces(rows, equations, all, with_rest, i, probes).transpose();
  }
  MatrixXd result = s.leftCols(count);
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < i; ++j) {
      // Of two estimates the one from fewer rows is exact, or as good.
      const bool first = members[static_cast<std::size_t>(i)].size() <= members[static_cast<std::size_t>(j)].size();
      result(i, j) = result(j, i) = first ? s(i, j) : s(j, i);
    }
  }
  for (int i = 0; i < count; ++i) result(i, i) = redundancy(i) - (result.row(i).sum() - result(i, i)) - s(i, count);
  return result;
}

}  // namespace

double VarianceFactor::low(double p) const { return factor * dof / chi_square_quantile(1.0 - p, dof); }
double VarianceFactor::high(double p) const { return factor * dof / chi_square_quantile(p, dof); }
double VarianceFactor::probability_if_one() const { return estimated ? chi_square_two_sided(factor * dof, dof) : 1.0; }

Result<std::vector<VarianceFactor>> variance_components(const Parameters& parameters, const WhitenedRows& rows,
                                                        const MatrixXd& null_space, std::span<const int> component, int count,
                                                        const VarianceComponentOptions& options) {
  std::vector<int> active(component.begin(), component.end());
  std::vector<VarianceFactor> result(static_cast<std::size_t>(count));
  for (int g = 0; g < rows.group_count(); ++g) {
    const int c = active[static_cast<std::size_t>(g)];
    if (c >= 0) result[static_cast<std::size_t>(c)].observations += rows.group(g).rows;
  }
  VectorXd factors = VectorXd::Ones(count);
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    const WhitenedRows at = weighted(rows, active, factors);
    const auto equations = NormalEquations::make(parameters, at, null_space);
    if (!equations) return tl::unexpected(equations.error());
    const VectorXd step = equations->step();
    const std::vector<MatrixXd> cofactors = residual_cofactors(*equations, at);
    VectorXd redundancy = VectorXd::Zero(count);
    VectorXd square = VectorXd::Zero(count);
    for (int g = 0; g < at.group_count(); ++g) {
      const int c = component[static_cast<std::size_t>(g)];
      if (c < 0) continue;
      redundancy(c) += cofactors[static_cast<std::size_t>(g)].trace();
      square(c) += (at.residual(g) + product(at, parameters, g, step)).squaredNorm();
    }
    // What has too little control is taken as stated, from the start or once the others' weights leave it none.
    bool dropped = false;
    for (int c = 0; c < count; ++c) {
      VarianceFactor& of = result[static_cast<std::size_t>(c)];
      of.redundancy = redundancy(c);
      const bool taken = iteration == 0 || std::find(active.begin(), active.end(), c) != active.end();
      of.estimated = taken && of.observations > 0 && redundancy(c) >= options.least_redundancy;
      if (of.estimated) continue;
      for (int& a : active) {
        if (a != c) continue;
        a = -1;
        dropped = true;
      }
      of.factor = factors(c) = 1.0;
    }
    if (dropped && iteration > 0) continue;
    std::vector<Eigen::Index> free;
    for (int c = 0; c < count; ++c) {
      if (std::find(active.begin(), active.end(), c) != active.end()) free.push_back(c);
    }
    if (free.empty()) return result;
    std::vector<int> local(active.size(), -1);
    for (std::size_t g = 0; g < active.size(); ++g) {
      const auto found = std::find(free.begin(), free.end(), active[g]);
      if (found != free.end()) local[g] = static_cast<int>(found - free.begin());
    }
    const VectorXd r = redundancy(free);
    const VectorXd q = square(free);
    const MatrixXd s =
        information(at, *equations, local, members_of(at, local, static_cast<int>(free.size())), r, options.probes);
    const Eigen::FullPivLU<MatrixXd> lu(s);
    // Far from the estimate Foerstner's step; near it Helmert's, S (log change) = q - r, which keeps factors positive.
    const VectorXd ratio = q.cwiseQuotient(r);
    const bool near = ratio.maxCoeff() < kNear && ratio.minCoeff() > 1.0 / kNear && lu.isInvertible();
    const VectorXd change = near ? VectorXd(lu.solve(q - r)) : VectorXd(ratio.cwiseMax(1e-100).array().log());
    double largest = 0.0;
    for (Eigen::Index i = 0; i < change.size(); ++i) {
      double& factor = factors(free[static_cast<std::size_t>(i)]);
      const double before = factor;
      factor = std::max(kLeastFactor, factor * std::exp(std::clamp(change(i), -kLargestStep, kLargestStep)));
      largest = std::max(largest, std::abs(factor / before - 1.0));
    }
    if (largest > options.tolerance) continue;
    const MatrixXd covariance = 2.0 * lu.inverse();
    for (std::size_t i = 0; i < free.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      VarianceFactor& of = result[static_cast<std::size_t>(free[i])];
      of.factor = factors(free[i]);
      // Never better known than from residuals that serve this group alone.
      const double relative = std::max(covariance(k, k), 2.0 / r(k));
      of.dof = 2.0 / relative;
      of.sigma = of.factor * std::sqrt(relative);
    }
    return result;
  }
  return fail(ErrorCode::kNoUniqueSolution,
              "the variance components do not settle: the residuals hardly tell the groups of observations apart");
}

}  // namespace crosstie::math
