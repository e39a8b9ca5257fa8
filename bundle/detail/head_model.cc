#include "bundle/detail/head_model.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "math/image_point.h"
#include "math/prior.h"

namespace crosstie::bundle::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Pose;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

math::Block lens_block(const std::string& name, const base::Camera& camera, const VectorXd& values) {
  math::Block block{"camera " + name, math::Block::Kind::kVector, {values.data(), values.data() + values.size()}, {}, {}, {}};
  const auto names = base::parameter_names(camera.model());
  const auto units = base::parameter_units(camera.model());
  for (std::size_t i = 0; i < names.size(); ++i) {
    block.components.push_back(units[i].empty() ? std::string(names[i]) : fmt::format("{} [{}]", names[i], units[i]));
  }
  return block;
}

math::Block vector_block(std::string name, std::vector<double> values, std::vector<std::string> components) {
  math::Block block{std::move(name), math::Block::Kind::kVector, std::move(values), std::move(components), {}, {}};
  for (int i = 0; i < block.tangent_size(); ++i) block.free.push_back(i);
  return block;
}

Result<> add_head(const CommissionInput& input, const HeadState& state, HeadModel& head) {
  const base::Head& given = input.head;
  math::Model& model = head.model;
  math::Block left = lens_block(given.left_name, given.left, state.left);
  math::Block right = lens_block(given.right_name, given.right, state.right);
  math::Block mount = math::pose_block("rig", state.rig_from_right);
  mount.kind = math::Block::Kind::kMount;
  const auto l = static_cast<Index>(state.left.size());
  const auto r = static_cast<Index>(state.right.size());
  const bool known = given.cov.size() != 0;
  if (known) {
    if (given.cov.rows() != l + r + 6 || given.cov.cols() != l + r + 6 || !given.cov.allFinite()) {
      return fail(
          ErrorCode::kBadInput,
          fmt::format("the covariance of the head must be finite and of size {0} x {0}: both lenses, then the rig", l + r + 6));
    }
    const auto free_of = [&](math::Block& block, Index first, Index count) {
      block.free.clear();
      for (Index i = 0; i < count; ++i) {
        if (given.cov(first + i, first + i) > 0.0) block.free.push_back(static_cast<int>(i));
      }
    };
    free_of(left, 0, l);
    free_of(right, l, r);
    // A rig's pose turns as a whole: it is held altogether, or not at all.
    if (given.cov.diagonal().tail<6>().maxCoeff() <= 0.0) mount.free.clear();
  }
  head.left = model.add(std::move(left));
  head.right = model.add(std::move(right));
  head.mount_right = model.add(std::move(mount));
  math::Block still = math::pose_block("left mount", Pose{});
  still.kind = math::Block::Kind::kMount;
  still.free.clear();
  head.mount_left = model.add(std::move(still));
  if (!known) return {};
  // The covariance of right_from_left, perturbed on the left, becomes that of its inverse.
  MatrixXd turn = MatrixXd::Identity(l + r + 6, l + r + 6);
  turn.bottomRightCorner<6, 6>() = -given.right_from_left.inverse().adjoint();
  auto whitening = math::whitening_of_mixed(turn * given.cov * turn.transpose(), "calibration of the head");
  if (!whitening) return fail(std::move(whitening));
  if (whitening->rows() == 0) return {};
  model.measurements.push_back(std::make_unique<HeadPrior>(std::vector<int>{head.left, head.right, head.mount_right},
                                                           given.left.parameters(), given.right.parameters(),
                                                           given.right_from_left.inverse(), std::move(*whitening)));
  head.groups.push_back({HeadGroup::Kind::kCalibration, 0});
  return {};
}

Result<> add_cross(const CommissionInput& input, const HeadSurvey& survey, const SpherePairs& spheres, const HeadState& state,
                   HeadModel& head) {
  const base::Cross& cross = input.cross;
  math::Model& model = head.model;
  math::Block growth = vector_block("cross", {state.growth_ppm}, {"growth [ppm]"});
  const double sigma_ppm = 1e6 * cross.growth_sigma();
  if (!(sigma_ppm > 0.0)) growth.free.clear();
  head.growth = model.add(std::move(growth));
  if (sigma_ppm > 0.0) {
    model.measurements.push_back(std::make_unique<math::Prior>(std::vector<int>{head.growth}, std::vector<int>{1},
                                                               VectorXd::Constant(1, 1e6 * cross.growth()),
                                                               MatrixXd::Constant(1, 1, 1.0 / sigma_ppm)));
    head.groups.push_back({HeadGroup::Kind::kTemperature, 0});
  }
  head.markers.assign(cross.markers.size(), -1);
  head.spheres.assign(cross.spheres.size(), -1);
  std::vector<char> seen(cross.markers.size(), 0);
  for (const HeadRay& ray : survey.rays) seen[static_cast<std::size_t>(ray.marker)] |= ray.active ? 1 : 0;
  std::vector<int> used;           // blocks of the points in use
  std::vector<Index> coordinates;  // of the joint list
  VectorXd listed(3 * static_cast<Index>(cross.markers.size() + cross.spheres.size()));
  const auto add_point = [&](std::string name, const Vector3d& at, std::size_t number, const Vector3d& given) {
    const int block = model.add(math::point_block(std::move(name), at));
    listed.segment<3>(3 * static_cast<Index>(used.size())) = given;
    used.push_back(block);
    for (Index axis = 0; axis < 3; ++axis) coordinates.push_back(3 * static_cast<Index>(number) + axis);
    return block;
  };
  for (std::size_t m = 0; m < cross.markers.size(); ++m) {
    if (!seen[m]) continue;
    head.markers[m] = add_point(fmt::format("marker {}", cross.markers[m].id), state.markers[m], m, cross.markers[m].xyz_mm);
  }
  for (const SpherePair& pair : spheres.pairs) {
    if (!pair.active) continue;
    const auto s = static_cast<std::size_t>(pair.reference);
    head.spheres[s] =
        add_point(fmt::format("sphere {}", pair.id), state.spheres[s], cross.markers.size() + s, cross.spheres[s].centre_mm);
  }
  if (cross.cov_mm2.size() != 0) {
    auto whitening = math::whitening_of(cross.cov_mm2(coordinates, coordinates), "covariance of the cross");
    if (!whitening) return fail(std::move(whitening));
    model.measurements.push_back(std::make_unique<ListedPoints>(
        used, head.growth, listed.head(3 * static_cast<Index>(used.size())), std::move(*whitening)));
    head.groups.push_back({HeadGroup::Kind::kListed, 0});
    return {};
  }
  const auto alone = [&](int block, const Vector3d& at, const Eigen::Matrix3d& cov, const std::string& name) -> Result<> {
    auto whitening = math::whitening_of(cov, name);
    if (!whitening) return fail(std::move(whitening));
    model.measurements.push_back(
        std::make_unique<ListedPoints>(std::vector<int>{block}, head.growth, at, std::move(*whitening)));
    head.groups.push_back({HeadGroup::Kind::kListed, block});
    return {};
  };
  for (std::size_t m = 0; m < cross.markers.size(); ++m) {
    if (head.markers[m] < 0) continue;
    const base::ReferencePoint& marker = cross.markers[m];
    if (auto added = alone(head.markers[m], marker.xyz_mm, *marker.cov_mm2, fmt::format("marker {} of the cross", marker.id));
        !added) {
      return added;
    }
  }
  for (std::size_t s = 0; s < cross.spheres.size(); ++s) {
    if (head.spheres[s] < 0) continue;
    const base::ReferenceSphere& sphere = cross.spheres[s];
    if (auto added = alone(head.spheres[s], sphere.centre_mm, sphere.cov_mm2, fmt::format("sphere {} of the cross", sphere.id));
        !added) {
      return added;
    }
  }
  return {};
}

Result<> add_probing(const CommissionInput& input, const SpherePairs& spheres, const HeadState& state, HeadModel& head) {
  head.machine_from_cross = head.model.add(math::pose_block("cross", state.machine_from_cross));
  for (std::size_t p = 0; p < spheres.pairs.size(); ++p) {
    const SpherePair& pair = spheres.pairs[p];
    if (!pair.active) continue;
    const base::ProbedSphere& ball = input.probed[static_cast<std::size_t>(pair.probed)];
    std::vector<Index> counting;
    for (Index axis = 0; axis < 3; ++axis) {
      if (ball.axes[static_cast<std::size_t>(axis)]) counting.push_back(axis);
    }
    if (counting.empty()) continue;
    auto root = math::whitening_of(ball.cov_mm2(counting, counting), fmt::format("probed sphere {}", pair.id));
    if (!root) return fail(std::move(root));
    MatrixXd whitening = MatrixXd::Zero(root->rows(), 3);
    whitening(Eigen::all, counting) = *root;
    head.model.measurements.push_back(std::make_unique<ProbedCentre>(
        head.machine_from_cross, head.spheres[static_cast<std::size_t>(pair.reference)], ball.centre_mm, std::move(whitening)));
    head.groups.push_back({HeadGroup::Kind::kSphere, static_cast<int>(p)});
  }
  return {};
}

void add_stations(const CommissionInput& input, const HeadSurvey& survey, double image_sigma_factor, HeadModel& head) {
  head.stations.assign(survey.stations.size(), -1);
  for (std::size_t k = 0; k < survey.stations.size(); ++k) {
    const HeadStation& station = survey.stations[k];
    if (!station.reason.empty()) continue;
    head.stations[k] = head.model.add(math::pose_block("station " + station.name, *station.cross_from_rig));
  }
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    const HeadRay& ray = survey.rays[r];
    if (!ray.active) continue;
    const HeadImage& image = survey.images[static_cast<std::size_t>(ray.image)];
    const bool right = image.camera == 1;
    const Eigen::LLT<Eigen::Matrix2d> root(ray.cov_px2 * (image_sigma_factor * image_sigma_factor));
    const Eigen::Matrix2d whitening = root.matrixL().solve(Eigen::Matrix2d::Identity());
    head.model.measurements.push_back(std::make_unique<math::ImagePoint>(
        math::ImagePoint::Blocks{right ? head.right : head.left, head.stations[static_cast<std::size_t>(image.station)],
                                 head.markers[static_cast<std::size_t>(ray.marker)],
                                 right ? head.mount_right : head.mount_left},
        right ? input.head.right.model() : input.head.left.model(), ray.measured_px, whitening));
    head.groups.push_back({HeadGroup::Kind::kImagePoint, static_cast<int>(r)});
  }
}

/// Terms that are not significant stay near 0.
void add_motion_priors(const std::vector<AxisTerm>& terms, HeadModel& head) {
  const auto count = static_cast<Index>(terms.size());
  MatrixXd whitening = MatrixXd::Zero(count, count);
  Index rows = 0;
  for (Index i = 0; i < count; ++i) {
    const double sigma = terms[static_cast<std::size_t>(i)].prior_sigma;
    if (sigma > 0.0) whitening(rows++, i) = 1.0 / sigma;
  }
  if (rows == 0) return;
  head.model.measurements.push_back(std::make_unique<math::Prior>(
      std::vector<int>{head.terms}, std::vector<int>{static_cast<int>(count)}, VectorXd::Zero(count), whitening.topRows(rows)));
  head.groups.push_back({HeadGroup::Kind::kMotion, 0});
}

void add_axis(const CommissionInput& input, const HeadSurvey& survey, const AxisModel& axis, HeadModel& head) {
  math::Model& model = head.model;
  head.at_middle = model.add(math::pose_block("head", axis.at_middle));
  head.direction = model.add(vector_block("axis", {0.0, 0.0}, {"across 1 [rad]", "across 2 [rad]"}));
  head.scale = model.add(vector_block("axis", {axis.scale_ppm}, {"scale [ppm]"}));
  if (!axis.carriage.terms.empty()) {
    std::vector<std::string> names;
    for (const AxisTerm& term : axis.carriage.terms) {
      const char letter = "XYZ"[term.component];
      names.push_back(term.angle ? fmt::format("E{}X{} [rad]", "ABC"[term.component], term.order)
                                 : fmt::format("E{}X{} [mm]", letter, term.order));
    }
    std::vector<double> zeros(names.size(), 0.0);
    head.terms = model.add(vector_block("axis", std::move(zeros), std::move(names)));
    add_motion_priors(axis.carriage.terms, head);
  }
  std::vector<int> carriage{head.at_middle, head.direction, head.scale};
  if (head.terms >= 0) carriage.push_back(head.terms);
  for (std::size_t k = 0; k < survey.stations.size(); ++k) {
    if (head.stations[k] < 0) continue;
    const double way = survey.stations[k].axis_mm - axis.carriage.middle_mm;
    const Vector3d place = axis.at_middle.translation_mm + axis.carriage.direction * way;
    const double sigma_mm = std::max(axis.stop_sigma_mm, kLeastStop_mm);
    const double sigma_rad = std::max(axis.stop_sigma_rad, kLeastStop_rad);
    base::Matrix6d root = base::Matrix6d::Zero();
    root.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / sigma_rad;
    const Eigen::Matrix3d along = axis.carriage.direction * axis.carriage.direction.transpose();
    root.bottomRightCorner<3, 3>() =
        (Eigen::Matrix3d::Identity() - along) / sigma_mm + along / std::hypot(sigma_mm, input.reading_sigma_mm);
    std::vector<int> blocks{head.machine_from_cross, head.stations[k]};
    blocks.insert(blocks.end(), carriage.begin(), carriage.end());
    model.measurements.push_back(
        std::make_unique<OnAxis>(std::move(blocks), axis.carriage, survey.stations[k].axis_mm, root * at_origin(place)));
    head.groups.push_back({HeadGroup::Kind::kAxis, static_cast<int>(k)});
  }
}

}  // namespace

HeadState start_state(const CommissionInput& input, const Pose& machine_from_cross) {
  HeadState state;
  state.left = input.head.left.parameters();
  state.right = input.head.right.parameters();
  state.rig_from_right = input.head.right_from_left.inverse();
  state.machine_from_cross = machine_from_cross;
  state.growth_ppm = 1e6 * input.cross.growth();
  const double grown = 1.0 + input.cross.growth();
  for (const auto& marker : input.cross.markers) state.markers.emplace_back(grown * marker.xyz_mm);
  for (const auto& sphere : input.cross.spheres) state.spheres.emplace_back(grown * sphere.centre_mm);
  return state;
}

Result<HeadModel> build_head_model(const CommissionInput& input, const HeadSurvey& survey, const SpherePairs& spheres,
                                   const HeadState& state, double image_sigma_factor, const AxisModel* axis) {
  HeadModel head;
  if (auto added = add_head(input, state, head); !added) return fail(std::move(added));
  if (auto added = add_cross(input, survey, spheres, state, head); !added) return fail(std::move(added));
  if (auto added = add_probing(input, spheres, state, head); !added) return fail(std::move(added));
  add_stations(input, survey, image_sigma_factor, head);
  if (axis != nullptr) add_axis(input, survey, *axis, head);
  return head;
}

void read_back(const HeadModel& head, HeadState& state, HeadSurvey& survey) {
  const auto values = [&](int block) -> const std::vector<double>& {
    return head.model.blocks[static_cast<std::size_t>(block)].values;
  };
  state.left = Eigen::Map<const VectorXd>(values(head.left).data(), state.left.size());
  state.right = Eigen::Map<const VectorXd>(values(head.right).data(), state.right.size());
  state.rig_from_right = math::pose_from_values(values(head.mount_right).data());
  state.machine_from_cross = math::pose_from_values(values(head.machine_from_cross).data());
  state.growth_ppm = values(head.growth).front();
  for (std::size_t m = 0; m < head.markers.size(); ++m) {
    if (head.markers[m] >= 0) state.markers[m] = Eigen::Map<const Vector3d>(values(head.markers[m]).data());
  }
  for (std::size_t s = 0; s < head.spheres.size(); ++s) {
    if (head.spheres[s] >= 0) state.spheres[s] = Eigen::Map<const Vector3d>(values(head.spheres[s]).data());
  }
  for (std::size_t k = 0; k < head.stations.size(); ++k) {
    if (head.stations[k] >= 0) survey.stations[k].cross_from_rig = math::pose_from_values(values(head.stations[k]).data());
  }
}

}  // namespace crosstie::bundle::detail
