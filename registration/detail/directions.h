#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "base/stitching.h"

namespace crosstie::registration::detail {

/// Names of the three shifts and the three turns about them.
[[nodiscard]] std::array<std::string, 6> direction_names(base::Segment::Kind kind);

/// The segment's axes at a place: columns axial, tangential, radial (outwards); right-handed.
[[nodiscard]] Eigen::Matrix3d axes_at(const base::Segment& segment, const Eigen::Vector3d& place_mm);

/// From the perturbation of a pose [w, v] to [w, shift of the place].
[[nodiscard]] base::Matrix6d at_place(const Eigen::Vector3d& place_mm);

/// A motion that has a name: [w, shift of the place], about that place; "roll" turns about the segment's own axis.
struct NamedMotion {
  std::string name;
  base::Vector6d motion = base::Vector6d::Zero();
};
[[nodiscard]] std::vector<NamedMotion> motions_at(const base::Segment& segment, const Eigen::Vector3d& place_mm);

/// Which named motions span `free` (columns), where m' gram m is the mean squared shift of a motion m: one after the other the one of which
/// most lies in what is left of the span, as long as more than half of its mean squared shift does (the first one in any case). Motions are
/// taken about the same place.
[[nodiscard]] std::vector<std::string> names_of(const std::vector<NamedMotion>& motions, const Eigen::MatrixXd& free,
                                                const base::Matrix6d& gram);

/// Mean of D'D over places, D the shift of a place by a motion about `centre_mm`.
[[nodiscard]] base::Matrix6d shift_gram(const std::vector<Eigen::Vector3d>& places, const Eigen::Vector3d& centre_mm);

}  // namespace crosstie::registration::detail
