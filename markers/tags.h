#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "markers/detect.h"

namespace crosstie::markers {

/// kBadInput for an image smaller than 8 x 8, without data, or of a depth other than 8 or 16 bits.
[[nodiscard]] base::Result<> check_image(const ImageView& image);

/// One square tag (AprilTag) in an image.
struct TagObservation {
  int id = base::kNoId;
  base::ObservationStatus status = base::ObservationStatus::kUnreadable;
  std::array<Eigen::Vector2d, 4>
      corners_px;  ///< of the border square: upper left, upper right, lower right, lower left of the tag
  Eigen::Matrix<double, 8, 8> corners_cov_px2 = Eigen::Matrix<double, 8, 8>::Zero();  ///< x, y of the corners in that order
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();  ///< image of the tag's centre: where the diagonals meet
  Eigen::Matrix2d cov_px2 = Eigen::Matrix2d::Zero();    ///< of the centre
  double cell_px = 0.0;                                 ///< width of the narrowest cell, across its longer sides
  double margin = 0.0;    ///< of the worst cell: 0 at the decision level, 1 as black or white as the border
  bool inverted = false;  ///< black and white exchanged
  bool mirrored = false;  ///< seen in a mirror
};

/// Finds the tags of a family (MarkerFamily::tag set) in an image: the library finds and numbers squares, the rest is done here.
///
/// Model: each of the four edges of the border square is a straight line between two levels (linear along it), blurred by a
/// Gaussian; what the blur spreads from the neighbouring cells, whose tones the code tells, is taken off. Offset, direction, blur
/// and levels of an edge follow from a weighted least-squares adjustment of the grey levels on both sides of it. Corners are the
/// intersections of the lines; the centre is the image of the tag's centre point under the homography of the corners, that is
/// the intersection of the diagonals: no eccentricity is left to correct.
///
/// Covariance: the noise of the pixels, on either side from the residuals, through the four lines (two parameters each) to
/// corners and centre, times the power of what the edges deviate from lines (the Legendre terms of third and fourth order, 8 for
/// a tag, pooled with the image's median; never below 1). Smooth bends by lens distortion are not counted: they move centre and
/// edges nearly together. What is left is 0.03 px for a tag of 55 px near the corner of a lens with k1 = -0.22, and falls with
/// the square of the size.
///
/// Status: kCoded where every cell agrees with the code by options.min_margin and the rings of the border with their tones, and
/// the id is in use; kRefused where the id is not in use or the tag is seen in a mirror (its id is then that of the tag);
/// kAmbiguous where a cell is doubtful; kUnreadable where the narrowest cell is below 3 px, the edges cannot be fitted, or a
/// cell beside the border is hidden. One tag gives one observation; sorted by status, id, y, x.
///
/// Options used: ids, polarity (kDarkDots: tags as published, kBrightDots: inverted), min_margin, min_contrast, saturated_level.
/// Pixels: (0, 0) is the centre of the first pixel. Errors as detect(), and kUsage for a family that has no tags.
[[nodiscard]] Result<std::vector<TagObservation>> detect_tags(const ImageView& image, const MarkerFamily& family,
                                                              const DetectOptions& options = {}, const Progress& progress = {});

}  // namespace crosstie::markers
