#include "app/adjust_result.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/verdicts.h"
#include "base/camera_file.h"
#include "base/cloud.h"
#include "base/npy.h"
#include "base/ply.h"
#include "report/bundle_report.h"
#include "report/tables.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::Result;
using nlohmann::ordered_json;

base::Cloud cloud_of(const base::AdjustedNetwork& network) {
  base::Cloud cloud;
  cloud.frame = "network";
  base::CloudField id{"id", {}};
  base::CloudField sigma{"sigma_mm", {}};
  for (const base::AdjustedPoint& point : network.points) {
    cloud.points.push_back(point.xyz_mm);
    cloud.cov_mm2.push_back(point.cov_mm2);
    id.values.push_back(point.id);
    sigma.values.push_back(std::sqrt(point.cov_mm2.trace()));
  }
  cloud.fields = {std::move(id), std::move(sigma)};
  return cloud;
}

Result<> write_files(const fs::path& folder, const base::AdjustedNetwork& network) {
  if (auto written = report::write_bundle_tables(folder, network); !written) return written;
  if (auto written = base::write_ply(folder / "points.ply", cloud_of(network)); !written) return written;
  for (const base::AdjustedCamera& camera : network.cameras) {
    if (auto written = base::write_cameramodel(folder / (camera.name + ".cameramodel"), camera.camera); !written)
      return written;
  }
  if (network.covariance.size() == 0) return {};
  return base::write_covariance(folder, {network.covariance, network.labels});
}

}  // namespace

Result<StepOutcome> write_adjustment(ResultFolder& folder, const fs::path& out, const base::AdjustedNetwork& adjusted,
                                     AdjustmentRecord record) {
  base::ResultEnvelope envelope{"adjust", "network", std::move(record.inputs), judge(adjusted, record.limits),
                                adjusted.warnings};
  if (auto written = write_files(folder.path(), adjusted); !written) return base::fail(std::move(written));
  const std::string html =
      report::bundle_report(adjusted, {"Bundle adjustment", record.title, envelope, record.options.dump(2), record.overview});
  const ordered_json result = base::result_json(envelope, record.options, base::network_json(adjusted));
  if (auto published = publish(folder, html, result); !published) return base::fail(std::move(published));
  const auto uncoded = std::count_if(adjusted.points.begin(), adjusted.points.end(),
                                     [](const base::AdjustedPoint& point) { return point.kind == "uncoded"; });
  return StepOutcome{
      out,
      fmt::format("{} points{} from {} images, sigma0 {:.4f} px, redundancy {}, {} rejected, {} warnings",
                  adjusted.points.size(), uncoded > 0 ? fmt::format(" ({} uncoded)", uncoded) : "", adjusted.images.size(),
                  adjusted.sigma0_px, adjusted.redundancy, adjusted.rejected.size(), adjusted.warnings.size()),
      false, outcome_of(envelope.verdicts)};
}

}  // namespace crosstie::app
