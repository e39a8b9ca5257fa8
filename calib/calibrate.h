#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/board.h"
#include "base/calibration.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::calib {

/// What a calibration starts from: one board, one or two cameras, and who saw which corner where.
struct BoardViews {
  base::Board board;
  std::vector<std::string> cameras;  ///< one, or left and right; of two, the first is the rig's frame
  std::vector<base::BoardImage> images;
};

struct CalibrateOptions {
  /// The lens model. Default: chosen from the ladder OpenCV 4, 5, 8, splined (tried
  /// for up to 8000 corners) as the simplest whose views held out are not predicted
  /// worse than by the best (one standard error: Hastie, Tibshirani & Friedman, The Elements of Statistical Learning, 7.10).
  std::optional<base::LensModel> lens = {};

  /// [px] Standard deviation of a coordinate of a corner. Default: told by the residuals (variance component), 5e-4 at least.
  std::optional<double> sigma_px = {};

  /// true: odd and even views, k-fold. Default: true; it takes several times as long as the calibration itself.
  bool cross_validate = true;

  /// Parts into which the views are divided for the k-fold validation and the ladder. Default: 5.
  int folds = 5;

  /// Probability of rejecting a correct corner. Default: 0.001, the level of Baarda's data snooping.
  double significance = 0.001;

  /// false: every corner takes part.
  bool reject_outliers = true;

  /// [mm] Distance of the cameras as a drawing or an earlier calibration tells it: the only witness of the pitch besides the
  /// board itself. A calibration that is off by more than a quarter is refused. Default: none.
  std::optional<double> expected_baseline_mm = {};

  /// Threads of the cross-validation; the result does not depend on them. Default: 0, as many as the machine has.
  int threads = 0;

  /// An Error of code kUsage that names the member which is out of its domain.
  [[nodiscard]] base::Result<> validate() const;
};

/// Calibrates one camera or a rigid pair from images of one board.
///
/// Model: corner = project(lens, camera_from_board * X) + noise, with X the board's points. One least-squares adjustment
/// finds the lenses of both cameras, right_from_left, the board's pose at every station and, unless it is taken as nominal,
/// the board's shape under its prior (base::BoardPrior): its modes, and every point with a scatter about them. The prior
/// fixes the datum: a board that may grow by 1000 ppm leaves the baseline a sigma of that size, which is the truth.
/// The corners' sigma follows from the residuals (variance component of the image points, Foerstner's estimator); the prior's
/// sigmas are taken as stated, and CalibratedBoard::prior_ratio tells whether they can be true.
///
/// No start values: focal length from the homographies (Zhang, IEEE PAMI 22(11), 2000, with square pixels and a centred
/// principal point), poses from these and their mirror images, the rig from the pairs that agree. Stations are told by the
/// names of the images (pairing.h). Images without a partner take part with a pose of their own.
///
/// Outliers: data snooping (Baarda; Pope's tau), a few per round; images whose residuals are far beyond all others' leave
/// as a whole. Both are listed with their reason.
///
/// Cross-validation: part of the stations is held out, the rest is solved as a whole, and of each image held out only the pose is
/// fitted. Halves are the odd and even stations.
///
/// Errors: kUsage for options; kBadInput for inconsistent input (unknown camera, sizes that differ, corners that do not lie in
/// the board's grid, columns and rows exchanged, a baseline that contradicts the expected one); kNoUniqueSolution for fewer
/// than three usable views of a camera, for views that all show the board at one angle, and where unknowns are not
/// determined, naming them; kCancelled.
///
/// Deterministic: the same input and options give the same bytes for any number of threads.
base::Result<base::Calibration> calibrate(const BoardViews& views, const CalibrateOptions& options = {},
                                          const base::Progress& progress = {});

}  // namespace crosstie::calib
