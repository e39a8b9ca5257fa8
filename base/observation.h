#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace crosstie::base {

/// What a detector says of one marker image.
enum class ObservationStatus {
  kCoded,       ///< the code was read with a sufficient margin; `id` is valid
  kUncoded,     ///< a dot without a code
  kAmbiguous,   ///< a code was read, but another is nearly as likely; `id` is the likelier one and is not to be trusted
  kUnreadable,  ///< there is a ring, but it is no code of the family (occluded, glare, too small)
  kRefused,     ///< read, but the id is not in use in this job
};

/// "coded", "uncoded", "ambiguous", "unreadable", "refused".
[[nodiscard]] std::string_view status_name(ObservationStatus status);

inline constexpr int kNoId = -1;

/// The image of one marker: the centre of its dot's ellipse, in pixels, with the ellipse and the covariance of the centre.
struct Observation {
  int id = kNoId;
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d cov_px2 = Eigen::Matrix2d::Zero();  ///< of the centre
  double semi_major_px = 0.0;
  double semi_minor_px = 0.0;
  double angle_rad = 0.0;  ///< of the major axis, from x towards y (clockwise as seen), in (-pi/2, pi/2]
  double margin = 0.0;  ///< how far the worst segment lies from the decision level: 0 undecided, 1 as white or black as can be
  ObservationStatus status = ObservationStatus::kUncoded;
};

/// All that was found in one image.
struct ImageObservations {
  std::string image;   ///< its name, unique in the job: the file's stem, or as the job says
  std::string camera;  ///< which camera took it
  std::string family;  ///< marker family: "ring10", "aicon14", ...
  int width_px = 0;
  int height_px = 0;
  double saturated_fraction = 0.0;        ///< of all pixels
  double dark_fraction = 0.0;             ///< of all pixels
  double millis = 0.0;                    ///< time it took; never part of a result that is compared
  std::vector<Observation> observations;  ///< sorted by status, id, y, x
};

}  // namespace crosstie::base
