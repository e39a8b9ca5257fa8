#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "registration/detail/directions.h"
#include "registration/detail/matching.h"

namespace crosstie::registration::detail {

/// Two overlapping stations at one moment of the alignment.
struct Overlap {
  int a = 0;
  int b = 0;
  std::vector<Match> matches = {};
  std::vector<double> trust = {};  ///< robust weight of each match, 0 to 1
  Eigen::Vector3d centre_mm = Eigen::Vector3d::Zero();
  base::Matrix6d gram = base::Matrix6d::Identity();  ///< mean squared shift of the matches' places by a motion about the centre
  /// Onto the motions that the surface sees, as [w, shift of the centre].
  base::Matrix6d visible = base::Matrix6d::Identity();
  std::vector<std::string> not_seen = {};
};

/// How the differences of all overlaps compare with their sigmas.
struct OverlapScale {
  double factor = 1.0;             ///< robust sigma of distance / sigma
  double independent_share = 1.0;  ///< N_eff / N, see scale_of()
  double rms_mm = 0.0;             ///< robust, of the distances

  /// Of a match, with all that makes it weigh less.
  [[nodiscard]] double variance(const Match& match) const {
    return match.sigma_mm * match.sigma_mm * factor * factor / independent_share;
  }
};

/// Tukey's biweight on distance / sigma, at 4.685 robust sigmas of all overlaps (1.4826 median |d|).
void trust_matches(std::vector<Overlap>& overlaps, OverlapScale& scale);

/// N_eff / N: neighbouring pieces may err together. Over places of two, four, ... cells the weighted mean of the distances has the
/// variance that independent pieces predict, times f^2(place); where f^2 grows beyond chance (1 %), N_eff / N is its smallest inverse.
double independent_share(const std::vector<Overlap>& overlaps, double factor, double cell_mm);

/// Centre, gram and visible motions: those of which the surface sees at least `least_seen` (mean square of the shift along the normals over
/// that of the shift); the others are named.
void find_visible(Overlap& overlap, double least_seen, const base::Segment& segment);

/// An overlap as rows of the adjustment.
struct ReducedOverlap {
  Eigen::MatrixXd root;  ///< columns: perturbation of a less that of b, then the shared unknowns
  Eigen::VectorXd offset;
};

/// sum w (d + n' D delta + s z)^2 as |root [delta; z] + offset|^2 and a constant; `by_shared`: a row for each match, or empty.
ReducedOverlap reduce(const Overlap& overlap, const OverlapScale& scale, const Eigen::MatrixXd& by_shared);

}  // namespace crosstie::registration::detail
