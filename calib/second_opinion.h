#pragma once

#include "base/calibration.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::calib {

struct SecondOpinionOptions {
  /// OpenCV 4, 5, 8, 12 or a splined stereographic model. Default: OpenCV 4.
  base::LensModel lens = base::LensModel::kOpenCv4;
  /// true: mrcal's own model of a board that is not flat, a parabola along columns and one along rows. Default: rigid.
  bool bent = false;
  /// true: mrcal rejects corners of its own. Default: every corner that took part in the calibration takes part.
  bool reject_outliers = false;
};

/// Solves the corners of a finished calibration once more, by mrcal (mrcal.secretsauce.net): independent code for the same least
/// squares, with a board that is rigid or bent in two directions, one lens model for all cameras, a weak regularisation of the lens and
/// no prior. Our solution serves as its start; splined control points start where they project as our lens does.
///
/// With a rigid board and one of OpenCV's models our own solver is run under the same assumptions and its figures stand beside: these
/// must agree. How far mrcal's answer is from the calibration itself (whose board is free) is the difference of projections at the
/// middle of the distances at which the board was seen.
///
/// Works in metres inside, as mrcal's scales expect; millimetres outside. Errors: kUsage for a lens model that mrcal does not
/// know and for boards that are no square grid; kBadInput for a calibration without residuals; kNoUniqueSolution where mrcal ends
/// without a finite answer or with boards behind the cameras (it reports neither by itself); kCancelled.
base::Result<base::SecondOpinion> second_opinion(const base::Calibration& calibration, const SecondOpinionOptions& options = {},
                                                 const base::Progress& progress = {});

}  // namespace crosstie::calib
