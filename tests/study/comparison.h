#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "base/result.h"
#include "fixtures/scene.h"

namespace crosstie::study {

/// What a job of the twin found, held against its truth. `scene` is the one that was photographed, as drawn() left it.
///
///     stages  {NAME: {square, dof}}   lenses, rig, frame, head, stations, part, cloud, edge: e' C^-1 e and the rank of C
///     edge    {u, v: BAND}            points of the rim, u across it in the surface, v along the normal
///     path    {u, v, tilt_u, tilt_t: BAND}
///     budget  {NAME: {u, v, predicted_u, predicted_v}}   mean squares over the rim [mm^2]; see comparison.cc
///     BAND    {count, in_1, in_2, mean_mm, rms_mm, sigma_mm, square}: shares within 1 and 2 sigmas; square: of e / sigma, its mean
///
/// Errors: those of the readers.
base::Result<nlohmann::ordered_json> compare(const fixtures::Scene& scene, const std::filesystem::path& job);

}  // namespace crosstie::study
