#pragma once

#include <filesystem>

#include "base/result.h"
#include "base/stitching.h"

namespace crosstie::base {

/// Reads what later verbs need of a stitching back from the folder of its result: the frame, every station's place with the joint
/// covariance of all of them (and of the head, where there is one) and its labels, the head as adjusted, the segment, markers, overlaps
/// without their cells. Iterations and drift stay empty.
///
/// Errors: kFileSystem; kBadInput with the file where the folder holds no result of `stitch`, a value is missing or of the wrong kind, or
/// the covariance does not belong to it.
Result<Stitching> read_stitching(const std::filesystem::path& folder);

}  // namespace crosstie::base
