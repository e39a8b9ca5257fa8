#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "base/point_list.h"
#include "base/result.h"
#include "base/verification.h"

namespace crosstie::verify {

/// Which motion may bring the measured points onto the reference.
enum class Fit {
  kRigid,       ///< 6 degrees of freedom: the scale of the measurement is under test
  kSimilarity,  ///< 7: its scale is fitted too, so lengths no longer tell of it
  kNone,        ///< 0: the coordinates are compared as they stand
};

/// Maximum permissible error of a length L, A + L / K, as acceptance protocols after VDI/VDE 2634 part 1 state it. The
/// guideline leaves A and K to the maker or the contract; these defaults are crosstie's own, chosen well inside what a welding
/// path needs, and are to be replaced by the job's.
struct MaximumPermissibleError {
  double a_mm = 0.050;
  double k = 20000.0;  ///< without unit (mm per mm): 20000 is 50 um per metre

  [[nodiscard]] double at_mm(double length_mm) const { return a_mm + length_mm / k; }
};

struct CompareOptions {
  Fit fit = Fit::kRigid;
  /// Ids that are listed with their deviation but take no part in the fit, the statistics and the lengths.
  std::vector<int> exclude_ids = {};
  /// True: each point enters the fit with the inverse of its predicted covariance; needs a covariance for every pair. False,
  /// the default: unit weights, which is what AICON, Tritop and SpatialAnalyzer report as a best fit.
  bool weighted = false;
  MaximumPermissibleError mpe = {};
  /// Distances that gave the measurement its scale; they are no test lengths.
  std::vector<std::pair<int, int>> defining_lengths = {};
  /// Largest number of test lengths; of more pairs an even selection over all lengths is taken, the longest included.
  int max_lengths = 2500;
  /// Measured points without an id of their own (ReferencePoint::has_own_id) are compared with the nearest point of the reference
  /// that no id claims, if it lies within this distance after the fit. Default: 0.5 mm, many times what a network is wrong by and
  /// a fraction of the distance between two targets.
  double position_gate_mm = 0.5;
  /// Covariance of all measured coordinates in mm^2, 3 per point in the order of `measured`, where it is known: it alone
  /// carries what the points have in common (their scale above all). Empty: the points of a list count as independent.
  Eigen::MatrixXd measured_cov_mm2 = {};

  [[nodiscard]] base::Result<> validate() const;
};

/// Compares measured points with a reference, id by id.
///
/// Model: reference_i = s R measured_i + t + e_i, estimated by least squares over all common ids (Horn 1987; s = 1 but for
/// kSimilarity). The deviations d_i = s R measured_i + t - reference_i are given after the fit and as they stand. Their
/// predicted covariance is M S M' with S the covariance of both sides in the frame of the reference and M = I - J N^-1 J' W
/// the projection by which the fit takes its 6 or 7 degrees of freedom out of the deviations; `normalised_rms` is the root
/// mean square of deviation over predicted sigma per coordinate and has the expectation 1 where all sigmas are true.
/// Where neither side gives a sigma, `sigma_mm` is 0, and the covariance of the pose comes from the scatter of the deviations.
/// A full covariance in a free datum over the very points that are fitted has no variance of the frame: `pose_cov` is then
/// that of the reference alone, and zero where the reference is exact.
/// For kRigid the scale of a similarity fit is stated beside it as a check, with its sigma. The points of the reference count
/// as independent of each other.
///
/// Uncoded targets have no common ids: they take no part in the fit and in the lengths, and their deviations from the nearest free
/// point of the reference stand apart (Verification::by_position), with sigmas from the same propagation.
///
/// Errors: no common id, an id twice, values that are not finite, a left-handed or mirrored list, units that differ by 25.4,
/// 1000 or a similar factor (kBadInput, naming the cause); fewer than 3 common points or points on one line
/// (kNoUniqueSolution), neither of which matters to kNone.
/// Warnings: "gross_point", "permuted_axes", "poor_fit", "scale_mismatch", "frames_differ", "few_points", "no_sigma".
base::Result<base::Verification> compare(const base::PointList& measured, const base::PointList& reference,
                                         const CompareOptions& options = {});

}  // namespace crosstie::verify
