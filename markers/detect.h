#pragma once

#include <vector>

#include "base/image.h"
#include "base/observation.h"
#include "base/progress.h"
#include "base/result.h"
#include "markers/family.h"

namespace crosstie::markers {

using base::ImageObservations;
using base::ImageView;
using base::Progress;

/// Which dots are looked for: bright on dark ground (retro-reflective targets, ring10), dark on bright (printed on paper).
enum class Polarity { kBoth, kBrightDots, kDarkDots };

/// How to detect. Every value has a default that serves photographs from a few to some 50 megapixels as they are.
struct DetectOptions {
  /// Ids that may occur in this job; others are read but refused. Empty: all of the family.
  std::vector<int> ids = {};

  Polarity polarity = Polarity::kBoth;

  /// [px] Smallest semi-minor axis of a dot. Default: below 2 px hardly a pixel lies inside of the blurred edge, so that
  /// contrast and size are no longer told apart.
  double min_radius_px = 2.0;

  /// [px] Largest radius (semi-major axis); 0: a quarter of the image's shorter side, beyond which no ring fits around the dot.
  double max_radius_px = 0.0;

  /// [-] Smallest ratio of the axes; default: cos 75 degrees, foreshortening beyond which rings are not readable.
  double min_axis_ratio = 0.26;

  /// [-] Smallest margin of the worst segment (0 at the decision level, 1 at full contrast) for kCoded; below it the reading is
  /// kAmbiguous. Default: measured on photographs with glare, where the wrong readings lie below it.
  double min_margin = 0.25;

  /// [-] Smallest contrast of a dot against its surroundings, as a fraction of the white level. Default: 4 of 255 grey levels;
  /// that it also stands out of the noise is tested apart.
  double min_contrast = 0.015;

  /// [-] Grey levels at or above this fraction of the white level are saturated: their pixels only tell that the light was at
  /// least that bright. Default: 253 of 255, since cameras round and compress near the end of their scale.
  double saturated_level = 0.992;

  /// [-] Grey levels at or below this fraction of the white level are counted as under-exposed. Default: 5 of 255.
  double dark_level = 0.02;

  /// An Error (kUsage) that names the field which is out of its domain.
  [[nodiscard]] base::Result<> validate() const;
};

/// Finds the markers of `family` and plain dots in an image.
///
/// Model: in the neighbourhood of a dot, the image is that of an ellipse with an edge blurred by a Gaussian (lens and pixel
/// together), between two levels that vary linearly. Centre, axes, direction, blur and levels follow from one weighted
/// least-squares adjustment of all pixels of dot and gap, in which saturated pixels are treated as lower bounds and occluded
/// ones are down-weighted. The covariance of the centre is the inverse normal matrix times the power of what the edge deviates
/// from an ellipse: the photometric noise and the correlated deviations along the edge (print, glare, sampling) together. The
/// centre is the ellipse's, not the image of the circle's centre (the eccentricity is modelled by the adjustment).
///
/// The observations are sorted by status, id, y, x; the names of image and camera are left to the caller. One marker gives one
/// observation. A ring that is blurred, partly hidden or in glare becomes kAmbiguous or kUnreadable with its centre.
///
/// Pixels: (0, 0) is the centre of the first pixel. Valid domain: see DetectOptions; a ring is read where its segments are at
/// least 2.5 px wide and it lies inside of the image, else it is kUnreadable; dots cut by the border are left out. Dots of
/// up to a quarter of the image's shorter side are found, at any tilt that leaves them the smallest semi-minor axis. The centre is
/// free of bias (below 0.005 px) for blurs up to half of the semi-minor axis, of plain dots and of coded ones that are read. Its
/// error is within 1.2 times the Cramer-Rao bound (formulation.md). Blurs beyond a third of the semi-minor axis hide what stands
/// close by: a dot that does not stand alone is then kUnreadable, not kUncoded, and the centre of one that is not read may be off
/// by up to 0.1 px.
///
/// Errors: kUsage for invalid options, kBadInput for an image smaller than 8 x 8 or without data, kCancelled.
/// Deterministic: the same image gives the same observations, `millis` aside.
[[nodiscard]] Result<ImageObservations> detect(const ImageView& image, const MarkerFamily& family,
                                               const DetectOptions& options = {}, const Progress& progress = {});

}  // namespace crosstie::markers
