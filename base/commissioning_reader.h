#pragma once

#include <filesystem>

#include "base/machine.h"
#include "base/result.h"

namespace crosstie::base {

/// Reads what later verbs need of a commissioning back from the folder of its result: the head (lenses and rig with their joint
/// covariance), the machine's frame (MachineFrame::at() answers for every reading of the travel, with covariance), the cross's place and
/// growth, spheres, markers, stations, and the full covariance with its labels. Residuals and the figures of the adjustment stay empty.
///
/// Errors: kFileSystem; kBadInput with the file where the folder holds no result of `commission`, a value is missing or of the wrong
/// kind, or the covariance does not belong to it.
Result<Commissioning> read_commissioning(const std::filesystem::path& folder);

}  // namespace crosstie::base
