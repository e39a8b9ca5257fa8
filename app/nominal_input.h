#pragma once

#include <optional>
#include <string>

#include "app/job.h"
#include "base/pose.h"
#include "base/result.h"
#include "edge/nominal.h"

namespace crosstie::app {

/// The nominal hole that a job describes.
struct NominalInput {
  edge::Nominal nominal;                      ///< in its own frame; of a list without normals those of the tower are taken
  std::string frame;                          ///< part or machine
  std::optional<base::Pose> frame_from_hole;  ///< where it lies in `frame`; none: an outline without centre_mm
  std::optional<std::filesystem::path> file;  ///< that it was read from
};

/// [hole] with the tower of [part]: where both say where they lie, an outline becomes the saddle curve of its prism in the tower. The
/// radius of the tower at the hole's centre follows from radius_mm at axis_point_mm and the half angle.
///
/// Errors: kBadInput for a job without [hole] nominal, a centre that is not on the tower's shell (by more than a hundredth of its
/// radius) or a normal that is not the shell's within 0.1 rad; those of edge::read_nominal().
base::Result<NominalInput> nominal_input(const Job& job);

/// `--nominal`: circle, ellipse, oval, superellipse (sizes fitted), or a file with points in `unit`; empty: its columns say it.
base::Result<edge::Nominal> nominal_of(const std::string& word_or_file, const std::string& unit);

}  // namespace crosstie::app
