#include "bundle/detail/head_outcome.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "bundle/detail/outliers.h"
#include "math/cofactors.h"
#include "math/distributions.h"

namespace crosstie::bundle::detail {
namespace {

using base::Pose;
using base::Result;
using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kWarnLevel = 1e-3;
constexpr double kLeastControl = 1e-3;  // redundancy below which what the others say is no control

/// Indices of the free tangent directions of several blocks among all of their directions.
std::vector<Index> free_of(const math::Model& model, const std::vector<int>& blocks, Index& all) {
  std::vector<Index> free;
  all = 0;
  for (const int b : blocks) {
    const math::Block& block = model.blocks[static_cast<std::size_t>(b)];
    for (const int i : block.free) free.push_back(all + i);
    all += block.tangent_size();
  }
  return free;
}

/// Joint covariance of all directions of the blocks: 0 for those that are held.
MatrixXd joint(const math::Cofactors& cofactors, const math::Model& model, const std::vector<int>& blocks) {
  Index size = 0;
  const std::vector<Index> free = free_of(model, blocks, size);
  MatrixXd all = MatrixXd::Zero(size, size);
  const MatrixXd known = cofactors.joint(blocks);
  all(free, free) = known;
  return all;
}

void fill_axis(const HeadResult& at, const MatrixXd& cov, base::MachineFrame& frame) {
  const HeadModel& head = at.head;
  const auto values = [&](int block) -> const std::vector<double>& {
    return head.model.blocks[static_cast<std::size_t>(block)].values;
  };
  const Carriage& carriage = at.axis.carriage;
  base::LinearAxis& axis = frame.axis;
  const std::vector<double>& turned = values(head.direction);
  axis.direction_in_machine = carriage.direction_at(turned.data());
  const Vector3d raw = carriage.direction + carriage.across * Eigen::Vector2d(turned[0], turned[1]);
  frame.across =
      (Matrix3d::Identity() - axis.direction_in_machine * axis.direction_in_machine.transpose()) * carriage.across / raw.norm();
  frame.cov = cov;
  frame.machine_from_rig_at_middle = math::pose_from_values(values(head.at_middle).data());
  axis.direction_cov = frame.across * cov.block<2, 2>(6, 6) * frame.across.transpose();
  axis.scale_ppm = values(head.scale).front();
  axis.scale_sigma_ppm = std::sqrt(cov(8, 8));
  axis.scale_p = two_sided_p(axis.scale_ppm / axis.scale_sigma_ppm, at.motion.degrees);
  axis.scale_significant = axis.scale_p < at.options.significance;
  axis.terms = at.motion.terms;
  std::size_t place = 0;
  for (base::ErrorMotion& term : axis.terms) {
    if (term.in_frame) term.value = values(head.terms)[place++];
  }
  axis.level = at.options.significance;
  axis.from_mm = carriage.middle_mm - carriage.half_mm;
  axis.to_mm = carriage.middle_mm + carriage.half_mm;
  axis.pivot_mm = carriage.pivot_mm - axis.direction_in_machine * carriage.middle_mm;
  axis.stop_sigma_mm = at.axis.stop_sigma_mm;
  axis.stop_sigma_rad = at.axis.stop_sigma_rad;
  axis.reading_sigma_mm = at.input.reading_sigma_mm;
}

void fill_images(const HeadResult& at, base::Commissioning& result) {
  const HeadSurvey& survey = at.survey;
  std::vector<int> number(survey.stations.size(), -1);
  for (std::size_t k = 0, n = 0; k < survey.stations.size(); ++k) {
    const HeadStation& station = survey.stations[k];
    if (!station.reason.empty()) continue;
    number[k] = static_cast<int>(n);
    base::CommissionedStation adjusted{.name = station.name, .axis_mm = station.axis_mm};
    adjusted.machine_from_rig = at.free_stations.machine_from_rig[n];
    adjusted.cov = at.free_stations.cov.block<6, 6>(6 * static_cast<Index>(n), 6 * static_cast<Index>(n));
    if (n < at.motion.off_axis.size()) {
      adjusted.off_axis = at.motion.off_axis[n];
      adjusted.w = at.motion.w[n];
      adjusted.off_along_mm = adjusted.off_axis.tail<3>().dot(result.frame.axis.direction_in_machine);
    }
    result.stations.push_back(std::move(adjusted));
    ++n;
  }
  std::vector<int> image_number(survey.images.size(), -1);
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    const HeadImage& image = survey.images[i];
    if (number[static_cast<std::size_t>(image.station)] < 0) continue;
    image_number[i] = static_cast<int>(result.images.size());
    result.images.push_back({.name = image.name,
                             .camera = image.camera == 1 ? at.input.head.right_name : at.input.head.left_name,
                             .station = number[static_cast<std::size_t>(image.station)]});
  }
  std::vector<double> sigmas;
  double all = 0.0;
  for (std::size_t g = 0; g < at.head.groups.size(); ++g) {
    if (at.head.groups[g].kind != HeadGroup::Kind::kImagePoint) continue;
    const HeadRay& ray = survey.rays[static_cast<std::size_t>(at.head.groups[g].index)];
    const Eigen::Matrix2d cov = ray.cov_px2 * (at.image_sigma_factor * at.image_sigma_factor);
    base::CommissionedRay adjusted{.image = image_number[static_cast<std::size_t>(ray.image)],
                                   .id = at.input.cross.markers[static_cast<std::size_t>(ray.marker)].id,
                                   .measured_px = ray.measured_px};
    adjusted.residual_px = Eigen::LLT<Eigen::Matrix2d>(cov).matrixL() * at.solution.rows.residual(static_cast<int>(g));
    adjusted.sigma_px = cov.diagonal().cwiseSqrt();
    adjusted.w = standardised(at.solution.rows.residual(static_cast<int>(g)), at.solution.residual_cofactors()[g]);
    sigmas.push_back(std::sqrt(0.5 * cov.trace()));
    base::CommissionedImage& image = result.images[static_cast<std::size_t>(adjusted.image)];
    ++image.rays;
    image.rms_px += adjusted.residual_px.squaredNorm();
    image.max_px = std::max(image.max_px, adjusted.residual_px.norm());
    all += adjusted.residual_px.squaredNorm();
    result.residuals.push_back(std::move(adjusted));
  }
  for (base::CommissionedImage& image : result.images) image.rms_px = std::sqrt(image.rms_px / std::max(image.rays, 1));
  if (!sigmas.empty()) {
    result.rms_px = std::sqrt(all / static_cast<double>(sigmas.size()));
    std::nth_element(sigmas.begin(), sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2), sigmas.end());
    result.sigma0_px = sigmas[sigmas.size() / 2];
  }
}

void fill_spheres(const HeadResult& at, const math::Cofactors& cofactors, base::Commissioning& result) {
  double square = 0.0;
  for (std::size_t p = 0; p < at.spheres.pairs.size(); ++p) {
    const SpherePair& pair = at.spheres.pairs[p];
    if (!pair.active) {
      result.rejected.push_back({fmt::format("sphere {}", pair.id), -1, pair.reason, 0.0});
      continue;
    }
    const base::ProbedSphere& ball = at.input.probed[static_cast<std::size_t>(pair.probed)];
    const int block = at.head.spheres[static_cast<std::size_t>(pair.reference)];
    base::CommissionedSphere sphere{.id = pair.id};
    sphere.centre_mm = at.state.machine_from_cross * at.state.spheres[static_cast<std::size_t>(pair.reference)];
    sphere.residual_mm = sphere.centre_mm - ball.centre_mm;
    sphere.sigma_mm = ball.cov_mm2.diagonal().cwiseSqrt();
    sphere.axes = ball.axes;
    const MatrixXd cov = joint(cofactors, at.head.model, {at.head.machine_from_cross, block});
    Eigen::Matrix<double, 3, 9> jacobian;
    jacobian << -base::skew(sphere.centre_mm), Matrix3d::Identity(), at.state.machine_from_cross.rotation.toRotationMatrix();
    sphere.cov_mm2 = jacobian * cov * jacobian.transpose();
    for (std::size_t g = 0; g < at.head.groups.size(); ++g) {
      if (at.head.groups[g].kind != HeadGroup::Kind::kSphere || at.head.groups[g].index != static_cast<int>(p)) continue;
      const MatrixXd& cofactor = at.solution.residual_cofactors()[g];
      const VectorXd residual = at.solution.rows.residual(static_cast<int>(g));
      sphere.w = standardised(residual, cofactor);
      // What all others say: the residual of a deleted group of rows is (I - H)^-1 times its own, of covariance (I - H)^-1.
      const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(cofactor);
      if (eigen.eigenvalues()(0) < kLeastControl) continue;
      std::vector<Index> counting;
      for (Index axis = 0; axis < 3; ++axis) {
        if (ball.axes[static_cast<std::size_t>(axis)]) counting.push_back(axis);
      }
      const Eigen::SelfAdjointEigenSolver<MatrixXd> probed(ball.cov_mm2(counting, counting));
      const MatrixXd root = probed.eigenvectors() * probed.eigenvalues().cwiseSqrt().asDiagonal();  // whitening^-1
      const MatrixXd inverse = cofactor.inverse();
      sphere.left_out_mm = Vector3d::Zero();
      (*sphere.left_out_mm)(counting) = root * inverse * residual;
      sphere.left_out_sigma_mm(counting) = (root * inverse * root.transpose()).diagonal().cwiseSqrt();
    }
    square += sphere.residual_mm.squaredNorm();
    result.spheres.push_back(std::move(sphere));
  }
  result.fre_mm = std::sqrt(square / static_cast<double>(std::max<std::size_t>(result.spheres.size(), 1)));
}

void fill_groups(const HeadResult& at, base::Commissioning& result) {
  constexpr std::pair<HeadGroup::Kind, const char*> kKinds[] = {
      {HeadGroup::Kind::kImagePoint, "image points"}, {HeadGroup::Kind::kListed, "cross"},
      {HeadGroup::Kind::kSphere, "spheres"},          {HeadGroup::Kind::kAxis, "axis"},
      {HeadGroup::Kind::kMotion, "small motions"},    {HeadGroup::Kind::kCalibration, "calibration"},
      {HeadGroup::Kind::kTemperature, "temperature"}};
  for (const auto& [kind, name] : kKinds) {
    base::ObservationGroup group{.name = name};
    double square = 0.0;
    for (std::size_t g = 0; g < at.head.groups.size(); ++g) {
      if (at.head.groups[g].kind != kind) continue;
      const auto residual = at.solution.rows.residual(static_cast<int>(g));
      group.observations += static_cast<int>(residual.size());
      group.redundancy += at.solution.residual_cofactors()[g].trace();
      square += residual.squaredNorm();
    }
    if (group.observations == 0) continue;
    if (group.redundancy > 1e-6) group.ratio = square / group.redundancy;
    const bool judged = group.redundancy > 0.5 && kind != HeadGroup::Kind::kImagePoint && kind != HeadGroup::Kind::kAxis &&
                        kind != HeadGroup::Kind::kMotion;
    if (judged && 1.0 - math::chi_square_cdf(square, group.redundancy) < kWarnLevel) {
      result.warnings.push_back(
          {"group_contradicts", name,
           fmt::format("{}: the residuals are {:.1f} times what the stated sigmas allow (redundancy {:.1f}); {}", name,
                       std::sqrt(group.ratio), group.redundancy,
                       kind == HeadGroup::Kind::kCalibration
                           ? "the cameras moved against each other, or their calibration is another one's"
                           : "the sigmas are too small, or something moved")});
    }
    result.groups.push_back(std::move(group));
  }
}

void fill_volume(const HeadResult& at, base::Commissioning& result) {
  WorkingVolume volume;
  if (at.options.volume) {
    volume = *at.options.volume;
  } else {
    volume.from_mm.setConstant(1e300);
    volume.to_mm.setConstant(-1e300);
    for (const HeadStation& station : at.survey.stations) {
      if (!station.reason.empty()) continue;
      const Pose rig_from_cross = station.cross_from_rig->inverse();
      for (std::size_t m = 0; m < at.state.markers.size(); ++m) {
        if (at.head.markers[m] < 0) continue;
        const Vector3d p = rig_from_cross * at.state.markers[m];
        volume.from_mm = volume.from_mm.cwiseMin(p);
        volume.to_mm = volume.to_mm.cwiseMax(p);
      }
    }
  }
  const base::LinearAxis& axis = result.frame.axis;
  for (const double place : {0.0, 0.5, 1.0}) {
    const auto head = result.frame.at(axis.from_mm + place * (axis.to_mm - axis.from_mm));
    if (!head) continue;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        for (int k = 0; k < 2; ++k) {
          const Vector3d share(0.5 * i, 0.5 * j, k);
          base::FramePoint point{.axis_mm = head->axis_mm};
          point.p_in_rig_mm = volume.from_mm + share.cwiseProduct(volume.to_mm - volume.from_mm);
          point.p_in_machine_mm = head->machine_from_rig * point.p_in_rig_mm;
          point.cov_mm2 = base::position_covariance({Eigen::Quaterniond::Identity(), point.p_in_machine_mm}, head->cov);
          result.tre.push_back(std::move(point));
        }
      }
    }
  }
}

void warn(const HeadResult& at, base::Commissioning& result) {
  auto& warnings = result.warnings;
  warnings.insert(warnings.end(), at.survey.warnings.begin(), at.survey.warnings.end());
  warnings.insert(warnings.end(), at.spheres.warnings.begin(), at.spheres.warnings.end());
  if (result.stations.size() < 3) {
    warnings.push_back(
        {"few_stations", "axis",
         "two stations determine the axis without any control; straightness cannot be told: take five over the travel"});
  }
  if (at.motion.stops_scatter) {
    warnings.push_back(
        {"stops_scatter", "axis",
         fmt::format("the stations scatter about every error motion that was tried (p = {:.1g}): a single stop is taken to "
                     "be uncertain by {:.4f} mm and {:.1f} urad beside its model",
                     at.motion.excess_p, at.motion.stop_sigma_mm, 1e6 * at.motion.stop_sigma_rad)});
  }
  if (!result.zero_in_travel) {
    warnings.push_back(
        {"zero_outside_travel", "axis",
         fmt::format("reading 0 lies outside of the travel of {:.1f} to {:.1f} mm: the head's pose there is that on the "
                     "straight axis, without error motions",
                     result.frame.axis.from_mm, result.frame.axis.to_mm)});
  }
  if (std::abs(result.sphere_scale_ppm) > 3.29 * result.sphere_scale_sigma_ppm && result.sphere_scale_sigma_ppm > 0.0) {
    warnings.push_back(
        {"sphere_scale", "spheres",
         fmt::format("the probed distances are {:+.0f} ppm (sigma {:.0f}) longer than those of the list at the cross's "
                     "temperature: check the temperatures, the CTE and the machine's scales",
                     result.sphere_scale_ppm, result.sphere_scale_sigma_ppm)});
  }
}

}  // namespace

Result<std::vector<ListedResidual>> listed_residuals(const CommissionInput& input, const HeadState& state,
                                                     const HeadModel& head, const math::Solution& solution) {
  const base::Cross& cross = input.cross;
  std::vector<ListedResidual> residuals(cross.markers.size());
  auto cofactors = math::Cofactors::make(solution.equations, solution.equations.null_space());
  if (!cofactors) return base::fail(std::move(cofactors));
  for (std::size_t m = 0; m < cross.markers.size(); ++m) {
    if (head.markers[m] < 0) continue;
    const Vector3d& listed = cross.markers[m].xyz_mm;
    const auto first = static_cast<Index>(3 * m);
    const Matrix3d given =
        cross.cov_mm2.size() != 0 ? Matrix3d(cross.cov_mm2.block<3, 3>(first, first)) : *cross.markers[m].cov_mm2;
    ListedResidual& residual = residuals[m];
    residual.residual_mm = state.markers[m] - (1.0 + 1e-6 * state.growth_ppm) * listed;
    residual.sigma_mm = given.diagonal().cwiseSqrt();
    const MatrixXd cov = joint(*cofactors, head.model, {head.markers[m], head.growth});
    Eigen::Matrix<double, 3, 4> jacobian;
    jacobian << Matrix3d::Identity(), -1e-6 * listed;
    const VectorXd scale = residual.sigma_mm.cwiseMax(1e-12).cwiseInverse();
    const MatrixXd left = scale.asDiagonal() * (given - jacobian * cov * jacobian.transpose()) * scale.asDiagonal();
    residual.w = standardised(scale.asDiagonal() * residual.residual_mm, left);
  }
  return residuals;
}

Result<base::Commissioning> head_outcome(const HeadResult& at) {
  const HeadModel& head = at.head;
  const base::Head& given = at.input.head;
  auto cofactors = math::Cofactors::make(at.solution.equations, at.solution.equations.null_space());
  if (!cofactors) return base::fail(std::move(cofactors));
  auto left = base::Camera::make(given.left.model(), given.left.width_px(), given.left.height_px(), at.state.left);
  if (!left) return base::fail(std::move(left));
  auto right = base::Camera::make(given.right.model(), given.right.width_px(), given.right.height_px(), at.state.right);
  if (!right) return base::fail(std::move(right));

  std::vector<int> blocks{head.left, head.right, head.mount_right, head.at_middle, head.direction, head.scale};
  if (head.terms >= 0) blocks.push_back(head.terms);
  blocks.push_back(head.machine_from_cross);
  blocks.push_back(head.growth);
  for (const int marker : head.markers) {
    if (marker >= 0) blocks.push_back(marker);
  }
  MatrixXd covariance = joint(*cofactors, head.model, blocks);
  const Index l = at.state.left.size();
  const Index r = at.state.right.size();
  MatrixXd turn = MatrixXd::Identity(covariance.rows(), covariance.cols());
  turn.block<6, 6>(l + r, l + r) = -at.state.rig_from_right.inverse().adjoint();  // the rig is right_from_left
  covariance = turn * covariance * turn.transpose();
  covariance = 0.5 * (covariance + covariance.transpose()).eval();

  base::Commissioning result{.head = {.left_name = given.left_name,
                                      .right_name = given.right_name,
                                      .left = std::move(*left),
                                      .right = std::move(*right),
                                      .right_from_left = at.state.rig_from_right.inverse(),
                                      .cov = covariance.topLeftCorner(l + r + 6, l + r + 6),
                                      .temperature_c = given.temperature_c}};
  result.head.left.set_covariance(covariance.topLeftCorner(l, l));
  result.head.right.set_covariance(covariance.block(l, l, r, r));
  result.baseline_mm = at.state.rig_from_right.translation_mm.norm();
  const MatrixXd mount = joint(*cofactors, head.model, {head.mount_right});
  const Vector3d along = at.state.rig_from_right.translation_mm.normalized();
  result.baseline_sigma_mm = std::sqrt(along.dot(base::position_covariance(at.state.rig_from_right, mount) * along));

  const Index frame_size = 9 + static_cast<Index>(at.axis.carriage.terms.size());
  fill_axis(at, covariance.block(l + r + 6, l + r + 6, frame_size, frame_size), result.frame);
  const auto zero = result.frame.at(0.0);
  result.zero_in_travel = zero.has_value();
  result.machine_from_rig_at_zero = zero ? *zero : result.frame.straight_at(0.0);
  result.machine_from_cross = at.state.machine_from_cross;
  const Index cross_at = l + r + 6 + frame_size;
  result.machine_from_cross_cov = covariance.block<6, 6>(cross_at, cross_at);
  result.growth_ppm = at.state.growth_ppm;
  result.growth_sigma_ppm = std::sqrt(covariance(cross_at + 6, cross_at + 6));
  result.growth_stated_ppm = 1e6 * at.input.cross.growth();
  result.growth_stated_sigma_ppm = 1e6 * at.input.cross.growth_sigma();
  result.sphere_scale_ppm = at.spheres.scale_ppm;
  result.sphere_scale_sigma_ppm = at.spheres.scale_sigma_ppm;
  result.datum = at.spheres.datum;

  fill_images(at, result);
  fill_spheres(at, *cofactors, result);
  auto listed = listed_residuals(at.input, at.state, head, at.solution);
  if (!listed) return base::fail(std::move(listed));
  for (std::size_t m = 0; m < head.markers.size(); ++m) {
    if (head.markers[m] < 0) continue;
    base::CommissionedMarker marker{.id = at.input.cross.markers[m].id};
    marker.xyz_mm = at.state.markers[m];
    marker.residual_mm = (*listed)[m].residual_mm;
    marker.sigma_mm = (*listed)[m].sigma_mm;
    for (const HeadRay& ray : at.survey.rays) marker.rays += ray.active && ray.marker == static_cast<int>(m) ? 1 : 0;
    result.markers.push_back(std::move(marker));
  }
  for (std::size_t k = 0; k < at.survey.stations.size(); ++k) {
    const HeadStation& station = at.survey.stations[k];
    if (!station.reason.empty()) result.rejected.push_back({"station " + station.name, -1, station.reason, 0.0});
  }
  for (const HeadRay& ray : at.survey.rays) {
    const HeadImage& image = at.survey.images[static_cast<std::size_t>(ray.image)];
    if (ray.active || !at.survey.stations[static_cast<std::size_t>(image.station)].reason.empty()) continue;
    result.rejected.push_back(
        {"image " + image.name, at.input.cross.markers[static_cast<std::size_t>(ray.marker)].id, ray.reason, ray.w});
  }
  for (const base::CommissionedStation& station : result.stations) {
    if (auto pose = result.frame.at(station.axis_mm)) result.checked_at.push_back(std::move(*pose));
  }
  fill_groups(at, result);
  fill_volume(at, result);

  result.sigma0 = at.solution.sigma0();
  result.image_sigma_factor = at.image_sigma_factor;
  result.largest_eccentricity_px = at.largest_eccentricity_px;
  result.observations = at.solution.observations;
  result.unknowns = at.solution.unknowns;
  result.redundancy = at.solution.redundancy;
  result.chi2_p = math::chi_square_two_sided(at.solution.square_sum, at.solution.redundancy);
  result.iterations = at.solution.iterations;
  std::tie(result.least_eigenvalue, result.weakest) = at.solution.equations.weakest();
  result.covariance = std::move(covariance);
  for (const int b : blocks) {
    const math::Block& block = head.model.blocks[static_cast<std::size_t>(b)];
    for (const std::string& component : block.components) result.labels.push_back(block.name + " " + component);
  }
  warn(at, result);
  return result;
}

}  // namespace crosstie::bundle::detail
