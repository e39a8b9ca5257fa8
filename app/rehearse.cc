// Draws of a scene against the sigmas that were planned for it.

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "app/scene_plan.h"
#include "base/parallel.h"
#include "bundle/adjust.h"
#include "bundle/commission.h"
#include "fixtures/machine.h"
#include "math/distributions.h"

namespace crosstie::app {
namespace {

using base::fail;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using fixtures::Scene;

/// e' C^+ e over the directions that C knows, and their number.
struct Square {
  std::string name;
  double value = 0.0;
  int dof = 0;
};

Square square_of(std::string name, const VectorXd& error, const MatrixXd& cov) {
  const VectorXd sigma = cov.diagonal().cwiseMax(0.0).cwiseSqrt();
  const VectorXd scale = (sigma.array() > 0.0).select(sigma.cwiseMax(1e-300).cwiseInverse(), 0.0);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scale.asDiagonal() * cov * scale.asDiagonal());
  const VectorXd turned = eigen.eigenvectors().transpose() * scale.cwiseProduct(error);
  Square square{std::move(name)};
  constexpr double kKnown = 1e-9;  // of the scaled covariance's largest eigenvalue
  for (Index i = 0; i < turned.size(); ++i) {
    if (eigen.eigenvalues()(i) < kKnown * eigen.eigenvalues()(turned.size() - 1)) continue;
    square.value += turned(i) * turned(i) / eigen.eigenvalues()(i);
    ++square.dof;
  }
  return square;
}

void add_rig(const Scene& made, const base::Pose& found, const base::Matrix6d& cov, const char* name,
             std::vector<Square>& squares) {
  squares.push_back(square_of(name, base::difference(made.head->right_from_left, found), cov));
}

/// The coordinates of a network in the frame of the true ones, after the rigid motion that the datum leaves open: the covariance is that
/// of inner constraints, so it does not see that motion.
void add_network(const Scene& made, const base::AdjustedNetwork& found, const base::AdjustedNetwork& planned,
                 std::vector<Square>& squares) {
  std::map<int, Eigen::Vector3d> truth;
  for (const base::ReferencePoint& point : true_reference(made).points) truth[point.id] = point.xyz_mm;
  std::vector<Index> rows;
  std::vector<double> errors;
  for (const base::AdjustedPoint& point : found.points) {
    const auto first = std::find(planned.labels.begin(), planned.labels.end(), fmt::format("point {} x [mm]", point.id));
    if (first == planned.labels.end() || !truth.contains(point.id)) continue;
    for (Index axis = 0; axis < 3; ++axis) {
      rows.push_back(first - planned.labels.begin() + axis);
      errors.push_back(point.xyz_mm(axis) - truth.at(point.id)(axis));
    }
  }
  squares.push_back(square_of("network points", Eigen::Map<const VectorXd>(errors.data(), static_cast<Index>(errors.size())),
                              planned.covariance(rows, rows)));
}

void add_machine(const Scene& made, const base::Commissioning& found, const base::CommissionPlan& planned,
                 std::vector<Square>& squares) {
  const base::LinearAxis& axis = planned.expected.frame.axis;
  for (const auto& [name, share] : {std::pair{"machine_from_rig, first reading", 0.0},
                                    {"machine_from_rig, mid-travel", 0.5},
                                    {"machine_from_rig, last reading", 1.0}}) {
    const double axis_mm = axis.from_mm + share * (axis.to_mm - axis.from_mm);
    const auto expected = planned.expected.frame.at(axis_mm);
    // Readings scatter: the ends of the travel as found are not quite those as planned.
    const auto here = found.frame.at(std::clamp(axis_mm, found.frame.axis.from_mm, found.frame.axis.to_mm));
    if (!expected || !here) continue;
    const base::Pose truth = fixtures::machine_from_rig(*made.machine, here->axis_mm);
    squares.push_back(square_of(name, base::difference(truth, here->machine_from_rig), expected->cov));
  }
  add_rig(made, found.head.right_from_left, base::Matrix6d(planned.expected.head.cov.bottomRightCorner<6, 6>()),
          "rig after commissioning", squares);
}

/// One draw: everything is measured with noise, as the real survey would be.
Result<std::vector<Square>> draw(const Scene& scene, const base::ScenePlan& plan, const SurveyOptions& options) {
  const Scene made = surveyed(scene, options);
  std::vector<Square> squares;
  std::optional<base::Calibration> calibration;
  if (plan.calibration) {
    auto result = survey_head(made, options);
    if (!result) return fail(std::move(result));
    calibration = *std::move(result);
    if (calibration->rig && plan.calibration->rig)
      add_rig(made, calibration->rig->right_from_left, plan.calibration->rig->cov, "rig by the board", squares);
  }
  std::optional<base::AdjustedNetwork> network;
  if (plan.network) {
    auto result = bundle::adjust(survey_network(made, options),
                                 {.uncoded = false, .variance_components = bundle::VarianceComponents::kNone});
    if (!result) return fail(std::move(result));
    network = *std::move(result);
    add_network(made, *network, plan.network->expected, squares);
  }
  if (!plan.machine || !calibration) return squares;
  const auto input = survey_machine(made, *calibration, network ? &*network : nullptr, options);
  if (!input) return tl::unexpected(input.error());
  const auto found = bundle::commission(*input);
  if (!found) return tl::unexpected(found.error());
  add_machine(made, *found, *plan.machine, squares);
  return squares;
}

}  // namespace

Result<base::Rehearsal> rehearse(const Scene& scene, const base::ScenePlan& plan, const SurveyOptions& options, int draws,
                                 Session& session) {
  std::vector<std::vector<Square>> all(static_cast<std::size_t>(draws));
  std::vector<std::string> failures(all.size());
  auto done = base::parallel_for(all.size(), session.threads(), "rehearsals", session.progress(), [&](std::size_t i) {
    SurveyOptions drawn = options;
    drawn.seed = i + 1;
    auto squares = draw(scene, plan, drawn);
    if (squares) {
      all[i] = *std::move(squares);
    } else {
      failures[i] = squares.error().message;
    }
    return Result<>{};
  });
  if (!done) return fail(std::move(done));
  base::Rehearsal rehearsal{.draws = draws};
  std::vector<base::RehearsedQuantity>& quantities = rehearsal.quantities;
  std::map<std::string, int> degrees;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!failures[i].empty()) {
      if (rehearsal.failed++ == 0) rehearsal.first_failure = failures[i];
      continue;
    }
    for (const Square& square : all[i]) {
      auto found = std::find_if(quantities.begin(), quantities.end(), [&](const auto& one) { return one.name == square.name; });
      if (found == quantities.end()) found = quantities.insert(quantities.end(), {.name = square.name, .dof = square.dof});
      found->square += square.value;
      degrees[square.name] += square.dof;
    }
  }
  const int counted = draws - rehearsal.failed;
  for (base::RehearsedQuantity& quantity : quantities) {
    quantity.square /= counted;
    const double dof = degrees[quantity.name];
    constexpr double kTail = 0.0005;  // either side
    quantity.low = math::chi_square_quantile(kTail, dof) / counted;
    quantity.high = math::chi_square_quantile(1.0 - kTail, dof) / counted;
  }
  return rehearsal;
}

}  // namespace crosstie::app
