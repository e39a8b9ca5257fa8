#include "bundle/plan.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/LU>

#include "bundle/adjust.h"
#include "math/distributions.h"

namespace crosstie::bundle {
namespace {

using base::fail;
using base::Result;
using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

/// Peak to valley of the Legendre polynomial over the travel.
double range_of(int order) {
  double low = 0.0;
  double high = 0.0;
  constexpr int kSteps = 1000;
  for (int i = 0; i <= kSteps; ++i) {
    const double value = base::legendre(order, 2.0 * i / kSteps - 1.0);
    low = std::min(low, value);
    high = std::max(high, value);
  }
  return high - low;
}

/// Derivatives of a place by a pose's perturbation.
Eigen::Matrix<double, 3, 6> by_motion(const Vector3d& place) {
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << -base::skew(place), Matrix3d::Identity();
  return jacobian;
}

Vector3d middle_of_volume(const base::Commissioning& expected) {
  Vector3d sum = Vector3d::Zero();
  for (const base::FramePoint& point : expected.tre) sum += point.p_in_rig_mm;
  return expected.tre.empty() ? Vector3d(0.0, 0.0, 1300.0) : Vector3d(sum / static_cast<double>(expected.tre.size()));
}

bool inside(const base::Camera& camera, const Eigen::Vector2d& pixel) {
  return pixel.minCoeff() >= -0.5 && pixel.x() <= camera.width_px() - 0.5 && pixel.y() <= camera.height_px() - 0.5;
}

/// How a triangulated point in the rig moves with lenses and rig, and with the noise of its four image coordinates.
struct Triangulated {
  MatrixXd by_head;    ///< 3 x (left, right, right_from_left)
  Matrix3d noise_mm2;  ///< for unit sigma of the image coordinates
};

std::optional<Triangulated> triangulated(const base::Head& head, const Vector3d& p_in_rig) {
  Eigen::Matrix<double, 2, 3> left_by_point;
  Eigen::Matrix<double, 2, 3> right_by_point;
  base::ProjectionParameterJacobian left_by_lens;
  base::ProjectionParameterJacobian right_by_lens;
  const Vector3d p_in_right = head.right_from_left * p_in_rig;
  const auto left = head.left.project(p_in_rig, &left_by_point, &left_by_lens);
  const auto right = head.right.project(p_in_right, &right_by_point, &right_by_lens);
  if (!left || !right || !inside(head.left, *left) || !inside(head.right, *right)) return {};
  Eigen::Matrix<double, 4, 3> by_point;
  by_point << left_by_point, right_by_point * head.right_from_left.rotation.toRotationMatrix();
  MatrixXd by_head = MatrixXd::Zero(4, left_by_lens.cols() + right_by_lens.cols() + 6);
  by_head.block(0, 0, 2, left_by_lens.cols()) = left_by_lens;
  by_head.block(2, left_by_lens.cols(), 2, right_by_lens.cols()) = right_by_lens;
  by_head.block<2, 6>(2, left_by_lens.cols() + right_by_lens.cols()) = right_by_point * by_motion(p_in_right);
  const Matrix3d inverse = (by_point.transpose() * by_point).inverse();
  return Triangulated{-(inverse * by_point.transpose()) * by_head, inverse};
}

/// The reading at which a place lies in the middle of the volume along the travel, as far as the travel reaches.
double reading_before(const base::Commissioning& expected, const Vector3d& p_in_machine) {
  const base::LinearAxis& axis = expected.frame.axis;
  const Vector3d middle = expected.frame.machine_from_rig_at_middle * middle_of_volume(expected);
  const double reading = axis.middle_mm() + (p_in_machine - middle).dot(axis.direction_in_machine);
  return std::clamp(reading, axis.from_mm, axis.to_mm);
}

}  // namespace

Result<> PlanOptions::validate() const {
  if (!(power > 0.5 && power < 1.0)) return fail(base::ErrorCode::kUsage, "the power lies between 0.5 and 1");
  return commission.validate();
}

Result<base::CommissionPlan> plan_commission(const CommissionInput& exact, const PlanOptions& options,
                                             const base::Progress& progress) {
  if (auto valid = options.validate(); !valid) return fail(std::move(valid));
  CommissionOptions commission_options = options.commission;
  commission_options.estimate_image_sigma = false;
  auto expected = commission(exact, commission_options, progress);
  if (!expected) return fail(std::move(expected));
  base::CommissionPlan plan{.expected = *std::move(expected)};
  plan.level = commission_options.significance;
  plan.power = options.power;
  const double sigmas = math::normal_quantile(1.0 - 0.5 * plan.level) + math::normal_quantile(plan.power);
  const base::LinearAxis& axis = plan.expected.frame.axis;
  for (const base::ErrorMotion& term : axis.terms) {
    plan.motions.push_back({.name = term.name,
                            .order = term.order,
                            .angle = term.angle,
                            .sigma = term.sigma,
                            .smallest = sigmas * term.sigma,
                            .range_factor = range_of(term.order),
                            .in_model = term.significant});
  }
  plan.direction_sigma_rad = base::worst_sigma(axis.direction_cov);
  plan.scale_smallest_ppm = sigmas * axis.scale_sigma_ppm;
  return plan;
}

base::PlannedPoint plan_point(const base::Commissioning& expected, const Vector3d& p_in_machine_mm, double sigma_px) {
  base::PlannedPoint point{.p_in_machine_mm = p_in_machine_mm, .axis_mm = reading_before(expected, p_in_machine_mm)};
  const auto pose = expected.frame.at(point.axis_mm);
  if (!pose) return point;
  const MatrixXd by_frame = by_motion(p_in_machine_mm) * expected.frame.jacobian(point.axis_mm);
  point.frame_cov_mm2 = by_frame * expected.frame.cov * by_frame.transpose();
  const auto seen = triangulated(expected.head, pose->machine_from_rig.inverse() * p_in_machine_mm);
  const Index head = expected.head.parameter_count();
  const Index frame = expected.frame.cov.rows();
  if (!seen || expected.covariance.rows() < head + frame) return point;
  const Matrix3d turn = pose->machine_from_rig.rotation.toRotationMatrix();
  MatrixXd by_all(3, head + frame);
  by_all << turn * seen->by_head, by_frame;
  point.cov_mm2 = by_all * expected.covariance.topLeftCorner(head + frame, head + frame) * by_all.transpose() +
                  sigma_px * sigma_px * turn * seen->noise_mm2 * turn.transpose();
  return point;
}

Result<base::NetworkPlan> plan_network(const base::Network& exact, const base::Progress& progress) {
  auto expected = adjust(
      exact,
      {.model_sigma_px = 0.0, .reject_outliers = false, .uncoded = false, .variance_components = VarianceComponents::kNone},
      progress);
  if (!expected) return fail(std::move(expected));
  base::NetworkPlan plan{.expected = *std::move(expected)};
  base::AdjustedNetwork& network = plan.expected;
  // Without noise sigma0 tells nothing but how well the optics' residue is modelled; variances are a priori.
  const double a_priori = network.redundancy > 0 && network.sigma0 > 0.0 ? 1.0 / (network.sigma0 * network.sigma0) : 1.0;
  std::vector<double> sigmas;
  for (base::AdjustedPoint& point : network.points) {
    point.cov_mm2 *= a_priori;
    sigmas.push_back(base::worst_sigma(point.cov_mm2));
  }
  for (base::AdjustedImage& image : network.images) image.cov *= a_priori;
  for (base::AdjustedCamera& camera : network.cameras) camera.camera.set_covariance(a_priori * camera.camera.covariance());
  for (base::AdjustedScaleBar& bar : network.scale_bars) bar.sigma_mm *= std::sqrt(a_priori);
  network.covariance *= a_priori;
  network.sigma0 = 1.0;
  std::sort(sigmas.begin(), sigmas.end());
  if (!sigmas.empty()) {
    plan.median_mm = sigmas[sigmas.size() / 2];
    plan.max_mm = sigmas.back();
  }
  return plan;
}

}  // namespace crosstie::bundle
