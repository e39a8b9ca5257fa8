#pragma once

#include <string>

#include "tests/bundle/synthetic_network.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {

/// Projects all points into all images anew, with normal noise: for cameras, poses or points that were changed.
void project_all(SyntheticNetwork& synthetic, double noise_px);

/// Gives every image point the ellipse of a dot that lies in a plane of constant z, to first order.
void give_dots(SyntheticNetwork& synthetic, double diameter_mm);

/// What a job says beside its images; each is TOML text.
struct JobText {
  std::string markers = {};  ///< of [markers], beside the family
  std::string camera = {};   ///< of every [camera.NAME], beside the focal length
  std::string network = "scale_bars = \"bars.csv\"\n";
  std::string rest = {};  ///< tables of their own
};

/// Makes a job folder whose detection has found the image points of the network: job.toml, bars.csv, small images, and
/// results/detect, which `crosstie adjust` takes as it is. Image k of the network is the photograph cC_SS, C its camera and SS its
/// station. False where the executable does not play along.
[[nodiscard]] bool write_synthetic_job(const TemporaryFolder& folder, const SyntheticNetwork& synthetic,
                                       const JobText& text = {});

/// The name of the photograph of image k.
std::string photograph_name(const SyntheticNetwork& synthetic, std::size_t k);

/// Makes the folder an AICON project of the network, whose cameras must be pinholes; the start values are the truth.
void write_aicon_project(const TemporaryFolder& folder, const SyntheticNetwork& synthetic);

}  // namespace crosstie::tests
