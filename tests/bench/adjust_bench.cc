// The adjustment against COLMAP's bundle_adjuster: the same image points with the same weights, the same lens model, from the same
// start values. Both must find the same network up to position, orientation and scale.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <random>
#include <tuple>

#include <fmt/format.h>

#include "base/aicon_network.h"
#include "base/colmap_model.h"
#include "base/image.h"
#include "bundle/adjust.h"
#include "markers/detect.h"
#include "math/rigid_alignment.h"
#include "tests/bench/table.h"
#include "tests/support/colmap.h"
#include "tests/support/measured_data.h"

namespace crosstie::bench {
namespace {

namespace fs = std::filesystem;

constexpr int kRuns = 5;

[[noreturn]] void give_up(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(1);
}

/// The coded markers of all photographs of a panel, both cameras.
base::Network observed(const fs::path& folder) {
  const auto family = markers::marker_family("aicon14");
  base::Network network;
  network.scale_is_free = true;
  for (const char* name : {"043", "671"}) {
    network.cameras.push_back({name, *base::Camera::nominal(base::LensModel::kOpenCv4, 2000, 1333, 2042.0), true});
  }
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".tif") continue;
    const auto image = base::read_image(entry.path());
    if (!image) give_up(image.error().message);
    auto observations = markers::detect(image->view(), *family);
    if (!observations) give_up(observations.error().message);
    observations->image = entry.path().stem().string();
    observations->camera = observations->image.substr(0, 3);
    std::erase_if(observations->observations, [](const auto& o) { return o.id >= 72 && o.id <= 74; });
    network.images.push_back(std::move(*observations));
  }
  return network;
}

/// Only what a first adjustment kept, as plain image points without ellipses, with start values that are some mm and mrad off.
base::Network cleaned(const base::Network& network, const base::AdjustedNetwork& adjusted) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const auto draw = [&](double sigma) {
    return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  base::Network clean;
  clean.scale_is_free = true;
  clean.cameras = network.cameras;
  for (base::NetworkCamera& camera : clean.cameras) {
    for (const base::AdjustedCamera& known : adjusted.cameras) {
      if (known.name != camera.name) continue;
      Eigen::VectorXd parameters = known.camera.parameters();
      parameters.head<4>().array() += 2.0;
      camera.camera =
          *base::Camera::make(camera.camera.model(), camera.camera.width_px(), camera.camera.height_px(), parameters);
    }
  }
  const double unit = adjusted.points.front().xyz_mm.norm() / 300.0;  // a free scale: some mm of the real panel
  for (const base::AdjustedImage& image : adjusted.images) {
    base::ImageObservations& kept = clean.images.emplace_back();
    kept.image = image.name;
    kept.camera = image.camera;
    base::Pose start = image.network_from_camera;
    start.rotation = base::rotation_exp(draw(2e-3)) * start.rotation;
    start.translation_mm += draw(2.0 * unit);
    clean.start_poses.push_back({image.name, start});
  }
  for (const base::AdjustedPoint& point : adjusted.points)
    clean.start_points.push_back({point.id, point.xyz_mm + draw(1.0 * unit), {}});
  for (const base::AdjustedObservation& seen : adjusted.residuals) {
    base::Observation observation;
    observation.id = adjusted.points[static_cast<std::size_t>(seen.point)].id;
    observation.centre_px = seen.measured_px;
    observation.cov_px2 = Eigen::Matrix2d::Identity();
    observation.status = base::ObservationStatus::kCoded;
    clean.images[static_cast<std::size_t>(seen.image)].observations.push_back(observation);
  }
  return clean;
}

/// The start values as COLMAP takes them: an adjusted network that holds them.
base::AdjustedNetwork start_of(const base::Network& clean, base::AdjustedNetwork adjusted) {
  for (std::size_t i = 0; i < adjusted.images.size(); ++i)
    adjusted.images[i].network_from_camera = clean.start_poses[i].network_from_camera;
  for (std::size_t p = 0; p < adjusted.points.size(); ++p) adjusted.points[p].xyz_mm = clean.start_points[p].xyz_mm;
  for (std::size_t c = 0; c < adjusted.cameras.size(); ++c) adjusted.cameras[c].camera = clean.cameras[c].camera;
  return adjusted;
}

/// Largest distance of two sets of points after a fit with 7 parameters, for a panel of 735 mm.
double largest_difference_mm(const base::AdjustedNetwork& ours, const base::ColmapModel& theirs) {
  std::vector<math::AlignmentPair> pairs;
  for (const base::ColmapPoint& point : theirs.points) {
    for (const base::AdjustedPoint& other : ours.points) {
      if (static_cast<std::uint64_t>(other.id) != point.id) continue;
      math::AlignmentPair& pair = pairs.emplace_back();
      pair.a_mm = other.xyz_mm;
      pair.b_mm = point.xyz;
    }
  }
  const auto fit = math::align(pairs, {.with_scale = true, .weighted = false});
  if (!fit) give_up(fit.error().message);
  double extent = 0.0;
  double largest = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    largest = std::max(largest, fit->residuals_mm[i].norm());
    for (const math::AlignmentPair& other : pairs) extent = std::max(extent, (pairs[i].a_mm - other.a_mm).norm());
  }
  constexpr double kPanel_mm = 912.0;  // longest distance of two of its targets
  return largest / extent * kPanel_mm;
}

double wall_millis(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

void compare(const fs::path& folder) {
  const base::Network network = observed(folder);
  bundle::AdjustOptions first;
  first.weights = bundle::ImageWeights::kEqual;
  first.uncoded = false;
  const auto start = bundle::adjust(network, first);
  if (!start) give_up(start.error().message);
  const base::Network clean = cleaned(network, *start);
  bundle::AdjustOptions options = first;
  options.sigma_px = 1.0;
  options.reject_outliers = false;
  options.min_angle_rad = 0.0;
  base::Result<base::AdjustedNetwork> ours = *start;
  std::vector<double> our_runs, peer_runs;
  for (int run = 0; run < kRuns; ++run) our_runs.push_back(wall_millis([&] { ours = bundle::adjust(clean, options); }));
  if (!ours) give_up(ours.error().message);

  const tests::TemporaryFolder work;
  fs::create_directories(work / "in");
  fs::create_directories(work / "out");
  if (auto written =
          base::write_colmap_model(work / "in", base::colmap_model_of(start_of(clean, *start)), base::ColmapFormat::kBinary);
      !written) {
    give_up(written.error().message);
  }
  const std::string arguments = fmt::format(
      "bundle_adjuster --input_path '{}' --output_path '{}' --BundleAdjustment.refine_principal_point 1 "
      "--BundleAdjustment.max_num_iterations 200 --BundleAdjustment.function_tolerance 0 "
      "--BundleAdjustment.parameter_tolerance 0",
      (work / "in").string(), (work / "out").string());
  for (int run = 0; run < kRuns; ++run) {
    peer_runs.push_back(wall_millis([&] {
      if (tests::run_colmap(arguments).empty()) give_up("colmap bundle_adjuster failed");
    }));
  }
  const auto theirs = base::read_colmap_model(work / "out");
  if (!theirs) give_up(theirs.error().message);
  print_row(
      fmt::format("adjust aicon-panel, {} images, {} rays, all covariances [ms]", ours->images.size(), ours->residuals.size())
          .c_str(),
      median_of(our_runs), median_of(peer_runs));
  std::printf("%-44s %10.2e mm (limit 1e-4; 7-parameter fit, %zu points)\n", "  largest difference of a coordinate",
              largest_difference_mm(*ours, *theirs), theirs->points.size());
}

/// A real network of 115 images, its files as they are, from their start values; against what an engineer should have to wait.
void time_large_network(const fs::path& folder) {
  constexpr double kSolve_ms = 1000.0;
  constexpr double kCovariance_ms = 2000.0;
  const auto project = base::find_aicon_project(folder);
  if (!project) give_up(project.error().message);
  auto network = base::read_aicon_network(*project);
  if (!network) give_up(network.error().message);
  for (base::NetworkCamera& camera : network->cameras) camera.held = {"A3", "C1", "C2"};
  bundle::AdjustOptions options;
  options.model_sigma_px = 0.0;
  options.reject_outliers = false;
  options.uncoded = false;
  options.min_angle_rad = 0.0;
  for (const auto& [what, full, limit] : {std::tuple{"adjust aicon-network, 115 images [ms]", false, kSolve_ms},
                                          std::tuple{"  and the covariance of all unknowns [ms]", true, kCovariance_ms}}) {
    options.full_covariance = full;
    std::vector<double> runs;
    for (int run = 0; run < kRuns; ++run) {
      runs.push_back(millis_of([&] {
        if (auto adjusted = bundle::adjust(*network, options); !adjusted) give_up(adjusted.error().message);
      }));
    }
    print_row(what, median_of(runs), limit);
  }
}

}  // namespace
}  // namespace crosstie::bench

int main() {
  using namespace crosstie;
  if (const auto large = tests::measured_data("aicon-network"); !large.empty()) {
    bench::print_heading("a limit of waiting");
    bench::time_large_network(large);
  }
  bench::print_heading("colmap bundle_adjuster, a process with its files, no covariance");
  const auto folder = tests::measured_data("aicon-panel");
  if (folder.empty() || !tests::has_colmap()) {
    std::printf("skipped: %s\n", folder.empty() ? "no aicon-panel in CROSSTIE_DATA" : "no colmap here");
    return 0;
  }
  bench::compare(folder);
  return 0;
}
