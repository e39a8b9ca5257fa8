#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "app/job.h"
#include "app/session.h"
#include "base/edge_curve.h"
#include "base/pose.h"
#include "base/result.h"
#include "base/surface_verification.h"
#include "base/verdict.h"
#include "verify/surface.h"

namespace crosstie::app {

/// A cloud and a rim, and what they are held against.
struct SurfaceTask {
  std::optional<std::filesystem::path> cloud;    ///< measured, PLY
  std::optional<std::filesystem::path> surface;  ///< reference mesh or cloud, PLY
  std::string shell;                             ///< "cone" or "cylinder" is fitted to the cloud; empty: none
  std::optional<verify::NominalShell>
      nominal;                                ///< of the shell, in the reference's frame; without `surface` it is the reference
  std::optional<std::filesystem::path> edge;  ///< measured rim: edge.csv
  std::optional<std::filesystem::path> edge_reference;  ///< x_mm,y_mm,z_mm,nx,ny,nz[,sigma_u_mm,sigma_v_mm] in order
  base::Pose reference_from_measured;
  bool best_fit = false;
  JobLimits limits;
};

/// What of a job can be held against a reference: the stitched cloud in `stitch` against [reference] surface and the tower of [part],
/// brought there by machine_from_part of the result in `edge`. Nothing where the job has none of it.
base::Result<std::optional<SurfaceTask>> surface_task(const Job& job, const std::filesystem::path& stitch,
                                                      const std::filesystem::path& edge);

/// A rim from a table with x_mm y_mm z_mm nx ny nz in order, as edge.csv is; sigmas where there are columns sigma_u_mm, sigma_v_mm.
base::Result<base::EdgeCurve> read_rim_table(const std::filesystem::path& file);

/// The files that it reads.
[[nodiscard]] std::vector<std::filesystem::path> surface_files(const SurfaceTask& task);
/// What of it changes the result, for the envelope.
[[nodiscard]] nlohmann::ordered_json surface_options(const SurfaceTask& task);

base::Result<base::SurfaceVerification> compare_surfaces(const SurfaceTask& task, Session& session);

/// Values held against limits.surface_p95_mm and limits.edge_rms_mm.
[[nodiscard]] std::vector<base::Verdict> judge(const base::SurfaceVerification& verification, const JobLimits& limits);

}  // namespace crosstie::app
