#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/calibration.h"
#include "base/machine.h"
#include "base/result.h"

namespace crosstie::app {

/// The rig of a calibration with both its lenses and their joint covariance; the temperature is the left camera's. kBadInput where it
/// holds no rig.
base::Result<base::Head> head_of(const base::Calibration& calibration);

/// A calibrated head with the files that it was read from.
struct HeadFiles {
  base::Head head;
  std::vector<std::filesystem::path> files;
};

/// `text` names the folder of a result of `calibrate` with a rig or of `commission` (the head as adjusted there), or two files of OpenCV, "intrinsic.yml,extrinsic.yml" (M1 D1 M2 D2;
/// R T), whose covariance is unknown and whose images have `width_px` x `height_px`. Errors: kFileSystem, kBadInput.
base::Result<HeadFiles> read_head(const std::string& text, int width_px, int height_px);

}  // namespace crosstie::app
