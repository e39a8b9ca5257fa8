#include "app/probed_spheres.h"

#include <algorithm>

#include <fmt/core.h>

#include "base/file.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

constexpr double kDiameterSigma_mm = 0.005;  ///< of a ball's certificate and of the stylus tip's calibration together
constexpr double kLargeForm = 6.0;           ///< form error over the probe's sigma: a range of 25 normal values stays below it

}  // namespace

Result<base::ProbedSphere> probed_sphere(const base::ProbeHits& hits, const base::ReferenceSphere* known,
                                         math::SphereProbingOptions options, std::vector<base::Warning>& warnings) {
  base::ProbedSphere sphere;
  sphere.id = hits.id;
  // A free diameter is held against the list; the centre then takes the list's knowledge, which makes it better along the pole.
  const auto free = math::fit_probed_sphere(hits.tips_mm, options);
  if (free) {
    sphere.diameter_mm = free->diameter_mm;
    sphere.diameter_sigma_mm = free->diameter_sigma_mm;
  }
  if (known != nullptr && known->diameter_mm > 0.0) {
    options.diameter_mm = known->diameter_mm;
    options.diameter_sigma_mm = kDiameterSigma_mm;
  }
  const auto fit = options.diameter_mm ? math::fit_probed_sphere(hits.tips_mm, options) : free;
  if (!fit) return base::fail(fit.error().code, fmt::format("sphere {}: {}", hits.id, fit.error().message));
  sphere.centre_mm = fit->centre_mm;
  sphere.cov_mm2 = fit->cov_mm2;
  for (base::Warning warning : fit->warnings) {
    warning.subject = fmt::format("sphere {}", hits.id);
    warnings.push_back(std::move(warning));
  }
  if (fit->form_mm > kLargeForm * options.probe_sigma_mm) {
    warnings.push_back(
        {"sphere_form", fmt::format("sphere {}", hits.id),
         fmt::format("its {} touches scatter over {:.4f} mm about a sphere, {:.0f} times the probe's sigma of {:.4f} "
                     "mm: dirt, a wrong diameter, or a touch of the mount",
                     fit->hits, fit->form_mm, fit->form_mm / options.probe_sigma_mm, options.probe_sigma_mm)});
  }
  return sphere;
}

Result<std::vector<base::ProbedSphere>> probed_spheres(const Job& job, const std::vector<base::ReferenceSphere>& known,
                                                       std::vector<base::Warning>& warnings) {
  const JobMachine& machine = *job.machine;
  if (machine.probed_spheres) return base::read_probed_spheres(job.resolve(*machine.probed_spheres));
  const auto path = job.resolve(*machine.probe_hits);
  const auto all = base::read_probe_hits(path);
  if (!all) return tl::unexpected(all.error());
  if (!machine.probe_sigma_mm) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("{}: probe_hits need probe_sigma_mm, the standard deviation of a touch", job.file.string()));
  }
  std::vector<base::ProbedSphere> spheres;
  for (const base::ProbeHits& hits : *all) {
    const auto of_cross =
        std::find_if(known.begin(), known.end(), [&](const base::ReferenceSphere& sphere) { return sphere.id == hits.id; });
    auto sphere =
        probed_sphere(hits, of_cross == known.end() ? nullptr : &*of_cross,
                      {.stylus_diameter_mm = *machine.stylus_diameter_mm, .probe_sigma_mm = *machine.probe_sigma_mm}, warnings);
    if (!sphere) return base::fail(sphere.error().code, fmt::format("{}: {}", base::shown(path), sphere.error().message));
    spheres.push_back(std::move(*sphere));
  }
  return spheres;
}

}  // namespace crosstie::app
