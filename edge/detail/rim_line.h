#pragma once

#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"
#include "edge/detail/rim_candidates.h"

namespace crosstie::edge::detail {

/// A short part of the rim.
struct RimCell {
  std::vector<const RimCandidate*> members;
  /// Of each: it shows no band and lies where its neighbours' bands end: the far side of a chamfer whose near side it did not show.
  std::vector<char> inner;
  Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d along = Eigen::Vector3d::Zero();   ///< unit, by growing angle
  Eigen::Vector3d across = Eigen::Vector3d::Zero();  ///< unit, in the face, away from the material
};

/// The cells of a rim that have members, by the angle about its middle.
class RimCells {
 public:
  RimCells(std::vector<RimCell> cells, double cell_mm, double reach_mm)
      : cells_(std::move(cells)), cell_mm_(cell_mm), reach_mm_(reach_mm) {}
  [[nodiscard]] std::size_t size() const { return cells_.size(); }
  [[nodiscard]] const RimCell& operator[](std::size_t i) const { return cells_[i]; }
  [[nodiscard]] double cell_mm() const { return cell_mm_; }
  /// To either side, over which the rim counts as a parabola: four cells, less where it is strongly curved.
  [[nodiscard]] double reach_mm() const { return reach_mm_; }

 private:
  std::vector<RimCell> cells_;
  double cell_mm_;
  double reach_mm_;
};

/// Which side of a chamfer the rim is.
enum class ChamferSide { kNear, kFar };

/// `cell_mm` 0: the candidates' own pieces of edge. The candidates outlive the cells. Inner members are marked where the rim is the near side.
/// kNoUniqueSolution where there are too few.
base::Result<RimCells> cells_of(const std::vector<RimCandidate>& rim, const Face& face, double cell_mm,
                                ChamferSide side = ChamferSide::kNear);

/// The smooth line through a cell and its neighbours, a parabola in the face, robust; inner members aside.
struct RimLine {
  bool known = false;
  Eigen::Vector3d middle_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d along = Eigen::Vector3d::Zero();
  Eigen::Vector3d across = Eigen::Vector3d::Zero();
  Eigen::Vector3d shape = Eigen::Vector3d::Zero();  ///< offset, slope, curvature [mm, 1, 1/mm]
  double scatter_mm = 0.0;                          ///< of the candidates about it

  [[nodiscard]] double along_mm(const Eigen::Vector3d& point_mm) const { return along.dot(point_mm - middle_mm); }
  /// Of a point from the line, positive away from the material.
  [[nodiscard]] double off_mm(const Eigen::Vector3d& point_mm) const {
    const double a = along_mm(point_mm);
    return across.dot(point_mm - middle_mm) - shape.x() - shape.y() * a - shape.z() * a * a;
  }
};
RimLine line_about(const RimCells& cells, std::size_t at);
/// The same of those members that `takes` says, inner ones too.
RimLine line_about(const RimCells& cells, std::size_t at, const std::function<bool(const RimCandidate&)>& takes);

}  // namespace crosstie::edge::detail
