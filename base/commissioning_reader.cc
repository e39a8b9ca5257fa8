#include "base/commissioning_reader.h"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/detail/result_reading.h"
#include "base/file.h"
#include "base/npy.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::numbers;
using detail::symmetric;
using detail::Unreadable;

constexpr int kMaxOrder = 20;  ///< of a term: far beyond what stations can carry

std::vector<ErrorMotion> terms_of(const Json& json) {
  std::vector<ErrorMotion> terms;
  for (const Json& motion : json) {
    const std::string name = motion.at("name");
    if (name.size() != 3 || name[0] != 'E' || std::string_view("XYZABC").find(name[1]) == std::string_view::npos) {
      throw Unreadable(fmt::format("an error motion called '{}'", name));
    }
    const Json& orders = motion.at("orders");
    const auto count = static_cast<Eigen::Index>(orders.size());
    const Eigen::VectorXd found = numbers(motion.at("found"), count);
    const Eigen::VectorXd sigmas = numbers(motion.at("sigmas"), count);
    const Eigen::VectorXd p = numbers(motion.at("p"), count);
    const Eigen::VectorXd values = numbers(motion.at("coefficients"), count);
    const Json& significant = motion.at("significant_orders");
    const Json& in_frame = motion.at("axis_orders");
    const auto has = [](const Json& list, int order) { return std::find(list.begin(), list.end(), order) != list.end(); };
    for (Eigen::Index i = 0; i < count; ++i) {
      ErrorMotion term;
      term.name = name;
      term.order = orders.at(static_cast<std::size_t>(i));
      if (term.order < 1 || term.order > kMaxOrder) throw Unreadable("a term of an order that is none");
      term.angle = motion.at("unit") == "rad";
      term.coefficient = found(i);
      term.sigma = sigmas(i);
      term.p = p(i);
      term.significant = has(significant, term.order);
      term.in_frame = has(in_frame, term.order);
      term.value = values(i);
      terms.push_back(std::move(term));
    }
  }
  return terms;
}

LinearAxis axis_of(const Json& json) {
  LinearAxis axis;
  axis.direction_in_machine = numbers(json.at("direction_in_machine"), 3);
  axis.direction_cov = symmetric(json.at("direction_cov"), 3);
  axis.scale_ppm = json.at("scale_ppm");
  axis.scale_sigma_ppm = json.at("scale_sigma_ppm");
  axis.scale_p = json.at("scale_p");
  axis.scale_significant = json.at("scale_significant");
  axis.terms = terms_of(json.at("terms"));
  axis.level = json.at("level");
  axis.from_mm = json.at("from_mm");
  axis.to_mm = json.at("to_mm");
  axis.pivot_mm = numbers(json.at("pivot_mm"), 3);
  axis.stop_sigma_mm = json.at("stop_sigma_mm");
  axis.stop_sigma_rad = json.at("stop_sigma_rad");
  axis.reading_sigma_mm = json.at("reading_sigma_mm");
  if (!(axis.from_mm < axis.to_mm)) throw Unreadable("an axis without travel");
  if (std::abs(axis.direction_in_machine.norm() - 1.0) > 1e-6) throw Unreadable("a direction that is not of unit length");
  return axis;
}

MachineFrame frame_of(const Json& json, LinearAxis axis) {
  MachineFrame frame;
  frame.axis = std::move(axis);
  frame.machine_from_rig_at_middle = detail::pose_of(json.at("machine_from_rig_at_middle"));
  const Eigen::VectorXd across = numbers(json.at("across"), 6);
  frame.across = Eigen::Map<const Eigen::Matrix<double, 3, 2, Eigen::RowMajor>>(across.data());
  const auto terms =
      std::count_if(frame.axis.terms.begin(), frame.axis.terms.end(), [](const ErrorMotion& term) { return term.in_frame; });
  frame.cov = symmetric(json.at("cov"), 9 + static_cast<Eigen::Index>(terms));
  return frame;
}

HeadPose pose_of(const Json& json) {
  HeadPose pose;
  pose.axis_mm = json.at("axis_mm");
  pose.machine_from_rig = detail::pose_of(json.at("machine_from_rig"));
  pose.cov = symmetric(json.at("cov"), 6);
  pose.stop_cov = symmetric(json.at("stop_cov"), 6);
  return pose;
}

CommissionedSphere sphere_of(const Json& json) {
  CommissionedSphere sphere;
  sphere.id = json.at("id");
  sphere.centre_mm = numbers(json.at("centre_mm"), 3);
  sphere.cov_mm2 = symmetric(json.at("cov_mm2"), 3);
  sphere.residual_mm = numbers(json.at("residual_mm"), 3);
  sphere.sigma_mm = numbers(json.at("sigma_mm"), 3);
  sphere.w = json.at("w");
  return sphere;
}

Commissioning commissioning_of(const Json& json) {
  detail::check_verb(json, "commission");
  Commissioning result{.head = detail::head_of(json)};
  result.baseline_mm = json.at("rig").at("baseline_mm");
  result.baseline_sigma_mm = json.at("rig").at("baseline_sigma_mm");
  result.frame = frame_of(json.at("frame_at_middle"), axis_of(json.at("axis")));
  result.machine_from_rig_at_zero.machine_from_rig = detail::pose_of(json.at("machine_from_rig_at_zero"));
  result.machine_from_rig_at_zero.cov = symmetric(json.at("cov"), 6);
  result.zero_in_travel = json.at("zero_in_travel");
  result.machine_from_cross = detail::pose_of(json.at("machine_from_cross"));
  result.machine_from_cross_cov = symmetric(json.at("machine_from_cross_cov"), 6);
  result.growth_ppm = json.at("growth_ppm");
  result.growth_sigma_ppm = json.at("growth_sigma_ppm");
  result.growth_stated_ppm = json.at("growth_stated_ppm");
  result.growth_stated_sigma_ppm = json.at("growth_stated_sigma_ppm");
  for (const Json& sphere : json.at("spheres")) result.spheres.push_back(sphere_of(sphere));
  for (const Json& pose : json.at("checked_at")) result.checked_at.push_back(pose_of(pose));
  for (const Json& one : json.at("markers")) {
    CommissionedMarker& marker = result.markers.emplace_back();
    marker.id = one.at("id");
    marker.rays = one.at("rays");
    marker.xyz_mm = numbers(one.at("xyz_mm"), 3);
    marker.residual_mm = numbers(one.at("residual_mm"), 3);
    marker.sigma_mm = numbers(one.at("sigma_mm"), 3);
  }
  result.fre_mm = json.at("fre_mm");
  result.sigma0 = json.at("sigma0");
  result.sigma0_px = json.at("sigma0_px");
  result.image_sigma_factor = json.at("image_sigma_factor");
  result.datum = json.at("datum");
  return result;
}

/// The block of lenses and rig; parameters that were held are not in the covariance and have zeros.
Eigen::MatrixXd head_covariance(const Commissioning& result) {
  std::vector<std::string> wanted;
  const Head& head = result.head;
  for (const auto& [name, camera] : {std::pair(&head.left_name, &head.left), std::pair(&head.right_name, &head.right)}) {
    for (const std::string_view parameter : parameter_names(camera->model()))
      wanted.push_back(fmt::format("camera {} {}", *name, parameter));
  }
  for (const char* part : {"rx", "ry", "rz", "tx", "ty", "tz"}) wanted.push_back(fmt::format("rig {}", part));
  std::vector<Eigen::Index> from;
  std::vector<Eigen::Index> to;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (const auto place = detail::row_of(result.labels, wanted[i])) {
      from.push_back(*place);
      to.push_back(static_cast<Eigen::Index>(i));
    }
  }
  const auto size = static_cast<Eigen::Index>(wanted.size());
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(size, size);
  cov(to, to) = result.covariance(from, from);
  return cov;
}

}  // namespace

Result<Commissioning> read_commissioning(const std::filesystem::path& folder) {
  auto result = detail::read_result(folder, commissioning_of);
  if (!result) return result;
  auto joint = read_covariance(folder);
  if (!joint) return fail(std::move(joint));
  result->covariance = std::move(joint->matrix);
  result->labels = std::move(joint->labels);
  if (!detail::row_of(result->labels, "rig rx"))
    return detail::bad_result(folder / "result.json", "its covariance holds no rig");
  result->head.cov = head_covariance(*result);
  return result;
}

}  // namespace crosstie::base
