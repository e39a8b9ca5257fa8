// How the face about a hole bends: the last part of edge/detail/rim_candidates.h.

#include <cmath>

#include <Eigen/Cholesky>

#include "edge/detail/rim_candidates.h"
#include "math/median.h"

namespace crosstie::edge::detail {
namespace {

using Slopes = Eigen::Matrix<double, 2, 5>;  // by slopes at the face's origin and second derivatives xx, xy, yy

/// oo, oa, aa of a candidate by xx, xy, yy.
Eigen::Matrix3d by_face(const RimCandidate& candidate, const Face& face) {
  const Eigen::Vector2d o = (face.axes.transpose() * candidate.out).head<2>().normalized();
  const Eigen::Vector3d edge = candidate.out.cross(candidate.normal);
  const Eigen::Vector2d a = (face.axes.transpose() * edge).head<2>().normalized();
  Eigen::Matrix3d rows;
  rows << o.x() * o.x(), 2.0 * o.x() * o.y(), o.y() * o.y(),        //
      o.x() * a.x(), o.x() * a.y() + o.y() * a.x(), o.y() * a.y(),  //
      a.x() * a.x(), 2.0 * a.x() * a.y(), a.y() * a.y();
  return rows;
}

Eigen::Vector2d slope_of(const Eigen::Vector3d& normal_in_face) { return -normal_in_face.head<2>() / normal_in_face.z(); }

}  // namespace

Eigen::Matrix2d curvature_of(const std::vector<RimCandidate>& candidates, const Face& face) {
  constexpr int kRounds = 6;
  constexpr double kTukey = 4.7;
  constexpr double kLeastScatter = 1e-4;
  constexpr double kHold = 1e-6;  // of directions that nothing tells
  std::vector<Slopes> rows;
  std::vector<Eigen::Vector2d> slopes;
  for (const RimCandidate& candidate : candidates) {
    const Eigen::Vector3d at = face.local(candidate.point_mm);
    const Eigen::Vector3d normal = face.axes.transpose() * candidate.normal;
    if (!(normal.z() > 0.5)) continue;
    Slopes row;
    row << 1.0, 0.0, at.x(), at.y(), 0.0,  //
        0.0, 1.0, 0.0, at.x(), at.y();
    const Eigen::Matrix3d turn = face.axes.transpose() * candidate.bend_turn * by_face(candidate, face);
    row.rightCols<3>() -= turn.topRows<2>() / normal.z();
    rows.push_back(row);
    slopes.push_back(slope_of(normal));
  }
  Eigen::Matrix<double, 5, 1> h = Eigen::Matrix<double, 5, 1>::Zero();
  if (rows.size() < 5) return Eigen::Matrix2d::Zero();
  std::vector<double> weights(rows.size(), 1.0);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, 5, 5> normals = kHold * Eigen::Matrix<double, 5, 5>::Identity();
    Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      normals += weights[i] * rows[i].transpose() * rows[i];
      right += weights[i] * rows[i].transpose() * slopes[i];
    }
    h = normals.ldlt().solve(right);
    std::vector<double> off(rows.size());
    for (std::size_t i = 0; i < rows.size(); ++i) off[i] = (slopes[i] - rows[i] * h).norm();
    std::vector<double> sorted = off;
    const double scale = kTukey * std::max(kLeastScatter, math::median(sorted));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double ratio = off[i] / scale;
      weights[i] = ratio < 1.0 ? std::pow(1.0 - ratio * ratio, 2) : 0.0;
    }
  }
  Eigen::Matrix2d curvature;
  curvature << h(2), h(3), h(3), h(4);
  return curvature;
}

void unbend(const Face& face, const Eigen::Matrix2d& curvature, std::vector<RimCandidate>& candidates) {
  const Eigen::Vector3d by_axes(curvature(0, 0), curvature(0, 1), curvature(1, 1));
  for (RimCandidate& candidate : candidates) {
    const Eigen::Vector3d own = by_face(candidate, face) * by_axes;
    candidate.point_mm -= candidate.bend_mm * own;
    candidate.normal = (candidate.normal - candidate.bend_turn * own).normalized();
  }
}

}  // namespace crosstie::edge::detail
