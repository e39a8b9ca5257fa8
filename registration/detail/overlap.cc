#include "registration/detail/overlap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "math/distributions.h"
#include "math/median.h"

namespace crosstie::registration::detail {
namespace {

using base::Matrix6d;
using base::Vector6d;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double kTukey = 4.685;  // 95 % efficient for normal errors
constexpr double kMad = 1.4826;
constexpr int kLeastPlaces = 20;  // from which a variance is told
constexpr int kPoseUnknowns = 6;  // of an overlap: they take as many places' means away
constexpr double kChance = 0.99;
constexpr double kTiny = 1e-14;  // of the largest eigenvalue: rounding

/// Derivative of the distance by a motion about the centre.
Vector6d by_motion(const Match& match, const Vector3d& centre) {
  Vector6d row;
  row << (match.place_mm - centre).cross(match.normal), match.normal;
  return row;
}

}  // namespace

void trust_matches(std::vector<Overlap>& overlaps, OverlapScale& scale) {
  std::vector<double> normalised, distances;
  for (const Overlap& overlap : overlaps) {
    for (const Match& match : overlap.matches) {
      normalised.push_back(std::abs(match.distance_mm) / match.scatter_mm);
      distances.push_back(std::abs(match.distance_mm));
    }
  }
  scale.factor = std::max(1e-3, kMad * math::median(normalised));
  scale.rms_mm = kMad * math::median(distances);
  for (Overlap& overlap : overlaps) {
    overlap.trust.clear();
    for (const Match& match : overlap.matches) {
      const double u = match.distance_mm / match.scatter_mm / (kTukey * scale.factor);
      overlap.trust.push_back(std::abs(u) < 1.0 ? std::pow(1.0 - u * u, 2) : 0.0);
    }
  }
}

double independent_share(const std::vector<Overlap>& overlaps, double factor, double cell_mm) {
  double least = 1.0;
  for (double size = 2.0 * cell_mm;; size *= 2.0) {
    double sum = 0.0;
    double dof = 0.0;
    for (const Overlap& overlap : overlaps) {
      std::map<std::array<int, 3>, std::pair<double, double>> places;  // sums of d / sigma^2 and 1 / sigma^2
      for (std::size_t i = 0; i < overlap.matches.size(); ++i) {
        if (overlap.trust[i] <= 0.0) continue;
        const Match& match = overlap.matches[i];
        const Vector3d at = match.place_mm / size;
        const double weight = 1.0 / (match.sigma_mm * match.sigma_mm * factor * factor);
        auto& place = places[{static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())),
                              static_cast<int>(std::floor(at.z()))}];
        place.first += match.distance_mm * weight;
        place.second += weight;
      }
      if (static_cast<int>(places.size()) <= 2 * kPoseUnknowns) continue;
      for (const auto& [key, place] : places) sum += place.first * place.first / place.second;
      dof += static_cast<double>(places.size()) - kPoseUnknowns;
    }
    if (dof < kLeastPlaces) return least;
    if (sum > math::chi_square_quantile(kChance, dof)) least = std::min(least, dof / sum);
  }
}

void find_visible(Overlap& overlap, double least_seen, const base::Segment& segment) {
  overlap.centre_mm.setZero();
  std::vector<Vector3d> places;
  for (const Match& match : overlap.matches) places.push_back(match.place_mm);
  for (const Vector3d& place : places) overlap.centre_mm += place / static_cast<double>(places.size());
  overlap.gram = shift_gram(places, overlap.centre_mm);
  Matrix6d seen = Matrix6d::Zero();
  for (const Match& match : overlap.matches) {
    const Vector6d row = by_motion(match, overlap.centre_mm);
    seen += row * row.transpose() / static_cast<double>(places.size());
  }
  const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix6d> eigen(seen, overlap.gram);
  const auto hidden = static_cast<Index>((eigen.eigenvalues().array() < least_seen).count());
  const MatrixXd free = eigen.eigenvectors().leftCols(hidden);
  overlap.visible = Matrix6d::Identity() - free * free.transpose() * overlap.gram;
  overlap.not_seen.clear();
  if (hidden > 0) overlap.not_seen = names_of(motions_at(segment, overlap.centre_mm), free, overlap.gram);
}

ReducedOverlap reduce(const Overlap& overlap, const OverlapScale& scale, const MatrixXd& by_shared) {
  const Index shared = by_shared.cols();
  const Index size = 6 + shared;
  MatrixXd normal = MatrixXd::Zero(size, size);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
  Eigen::VectorXd row(size);
  for (std::size_t i = 0; i < overlap.matches.size(); ++i) {
    if (overlap.trust[i] <= 0.0) continue;
    const Match& match = overlap.matches[i];
    const double weight = overlap.trust[i] / scale.variance(match);
    row.head<6>() = by_motion(match, overlap.centre_mm);
    if (shared > 0) row.tail(shared) = by_shared.row(static_cast<Index>(i));
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
    right += (weight * match.distance_mm) * row;
  }
  normal.triangularView<Eigen::StrictlyUpper>() = normal.transpose();
  // About the centre, where the numbers are of one size (a mm and a mm's turn at the edge), the factor is well conditioned.
  const double reach = std::sqrt(overlap.gram.topLeftCorner<3, 3>().trace() / 3.0);
  Eigen::VectorXd unit = Eigen::VectorXd::Ones(size);
  unit.head<3>().setConstant(1.0 / reach);
  const MatrixXd visible_unit = [&] {
    MatrixXd all = MatrixXd::Identity(size, size);
    all.topLeftCorner<6, 6>() = overlap.visible;
    return MatrixXd(all * unit.asDiagonal());
  }();
  const MatrixXd scaled = visible_unit.transpose() * normal * visible_unit;
  const Eigen::SelfAdjointEigenSolver<MatrixXd> eigen(scaled);
  const double limit = kTiny * std::max(eigen.eigenvalues().maxCoeff(), 1e-300);
  const auto kept = static_cast<Index>((eigen.eigenvalues().array() > limit).count());
  const MatrixXd vectors = eigen.eigenvectors().rightCols(kept);
  const Eigen::VectorXd roots = eigen.eigenvalues().tail(kept).cwiseSqrt();
  ReducedOverlap result;
  MatrixXd centred = MatrixXd::Identity(size, size);
  centred.topLeftCorner<6, 6>() = at_place(overlap.centre_mm);
  result.root = roots.asDiagonal() * vectors.transpose() * unit.cwiseInverse().asDiagonal() * centred;
  result.offset = roots.cwiseInverse().asDiagonal() * vectors.transpose() * (visible_unit.transpose() * right);
  return result;
}

}  // namespace crosstie::registration::detail
