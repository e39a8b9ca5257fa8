#include "app/commissioning_view.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

namespace crosstie::app {
namespace {

constexpr int kAlong = 81;  ///< readings over the travel
constexpr int kCells = 16;

/// The box in the rig's frame that the result's own points of the working volume span.
struct Box {
  Eigen::Vector3d low = Eigen::Vector3d(0.0, -300.0, 1200.0);
  Eigen::Vector3d high = Eigen::Vector3d(800.0, 300.0, 1400.0);
};

Box working_box(const base::Commissioning& result) {
  Box box;
  if (result.tre.empty()) return box;
  box.low = box.high = result.tre.front().p_in_rig_mm;
  for (const base::FramePoint& point : result.tre) {
    box.low = box.low.cwiseMin(point.p_in_rig_mm);
    box.high = box.high.cwiseMax(point.p_in_rig_mm);
  }
  for (Eigen::Index i = 0; i < 3; ++i) {  // a plane or a line still gets a picture
    const double narrow = 100.0 - (box.high(i) - box.low(i));
    if (narrow <= 0.0) continue;
    box.low(i) -= 0.5 * narrow;
    box.high(i) += 0.5 * narrow;
  }
  return box;
}

double worst_u_mm(const Eigen::Matrix3d& cov) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(cov, Eigen::EigenvaluesOnly);
  return 2.0 * std::sqrt(std::max(0.0, eigen.eigenvalues()(2)));
}

/// U of a point that the head sees at a reading, by the frame alone.
double frame_u_mm(const base::HeadPose& head, const Eigen::Vector3d& p_in_rig_mm) {
  Eigen::Matrix<double, 3, 6> jacobian;
  jacobian << -base::skew(head.machine_from_rig * p_in_rig_mm), Eigen::Matrix3d::Identity();
  return worst_u_mm(jacobian * head.cov * jacobian.transpose());
}

base::HeadPose head_at(const base::MachineFrame& frame, double axis_mm) {
  const auto pose = frame.at(std::clamp(axis_mm, frame.axis.from_mm, frame.axis.to_mm));
  return pose ? *pose : frame.straight_at(axis_mm);
}

/// Middle of cell `i` of so many.
double middle(double low, double high, int i) { return low + (high - low) * (i + 0.5) / kCells; }

report::VolumeMap map_along(const base::Commissioning& result, const Box& box, int axis, std::string title, std::string label) {
  const base::LinearAxis& travel = result.frame.axis;
  report::VolumeMap map{std::move(title), "axis reading [mm]", std::move(label), travel.from_mm,
                        travel.to_mm,     box.low(axis),       box.high(axis),   Eigen::MatrixXd(kCells, kCells)};
  for (int column = 0; column < kCells; ++column) {
    const base::HeadPose head = head_at(result.frame, middle(travel.from_mm, travel.to_mm, column));
    for (int row = 0; row < kCells; ++row) {
      Eigen::Vector3d point = 0.5 * (box.low + box.high);
      point(axis) = middle(box.low(axis), box.high(axis), row);
      map.expanded_mm(row, column) = frame_u_mm(head, point);
    }
  }
  return map;
}

report::VolumeMap map_across(const base::Commissioning& result, const Box& box) {
  const base::HeadPose head = head_at(result.frame, result.frame.axis.middle_mm());
  report::VolumeMap map{"At the middle of the travel, over the field of view",
                        "x in rig [mm]",
                        "y in rig [mm]",
                        box.low.x(),
                        box.high.x(),
                        box.low.y(),
                        box.high.y(),
                        Eigen::MatrixXd(kCells, kCells)};
  for (int column = 0; column < kCells; ++column) {
    for (int row = 0; row < kCells; ++row) {
      map.expanded_mm(row, column) =
          frame_u_mm(head, {middle(box.low.x(), box.high.x(), column), middle(box.low.y(), box.high.y(), row),
                            0.5 * (box.low.z() + box.high.z())});
    }
  }
  return map;
}

}  // namespace

report::CommissioningView commissioning_view(const base::Commissioning& result, const bundle::CommissionInput& input) {
  const base::LinearAxis& axis = result.frame.axis;
  report::CommissioningView view{result, input.head, input.cross, {}, volume_maps(result)};
  for (int i = 0; i < kAlong; ++i) {
    view.along.push_back(head_at(result.frame, axis.from_mm + (axis.to_mm - axis.from_mm) * i / (kAlong - 1)));
  }
  return view;
}

std::vector<report::VolumeMap> volume_maps(const base::Commissioning& result) {
  const Box box = working_box(result);
  return {map_across(result, box), map_along(result, box, 1, "Along the travel, across it", "y in rig [mm]"),
          map_along(result, box, 2, "Along the travel, over the distance", "distance from the head [mm]")};
}

double largest_frame_u_mm(const base::Commissioning& result) {
  double largest = 0.0;
  for (const base::FramePoint& point : result.tre) largest = std::max(largest, worst_u_mm(point.cov_mm2));
  return largest;
}

}  // namespace crosstie::app
