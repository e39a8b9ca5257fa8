// What grows with the work: lists of points, one large image, a network of many photographs and points; time and memory for sizes that double
// or more. `bench_load lists|image|adjust [SCALE]`, SCALE 1 the full sizes; `bench_load job FOLDER STATIONS PHOTOGRAPHS` writes a job.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <string>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "base/ply.h"
#include "base/point_list.h"
#include "bundle/adjust.h"
#include "fixtures/render.h"
#include "fixtures/scene.h"
#include "fixtures/simulate.h"
#include "markers/detect.h"
#include "tests/bench/table.h"
#include "verify/compare.h"

namespace crosstie::bench {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void give_up(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(1);
}

template <typename T>
T checked(base::Result<T> result) {
  if (!result) give_up(result.error().message);
  return *std::move(result);
}
void checked(const base::Result<>& result) {
  if (!result) give_up(result.error().message);
}

/// A line of /proc/self/status [MB].
double memory_mb(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(key)) return std::atof(line.c_str() + key.size() + 1) / 1024.0;
  }
  return 0.0;
}

/// What `work` takes: milliseconds of processor time and its peak of memory above what was there before.
struct Cost {
  double millis = 0.0;
  double peak_mb = 0.0;
};

template <typename Work>
Cost cost_of(Work&& work) {
  std::ofstream("/proc/self/clear_refs") << "5";  // sets the peak back
  const double before_mb = memory_mb("VmRSS:");
  const double millis = millis_of(work);
  return {millis, std::max(0.0, memory_mb("VmHWM:") - before_mb)};
}

/// A row for each size; the exponent of growth is that between the two largest.
class Growth {
 public:
  explicit Growth(std::string what) : what_(std::move(what)) {}

  void add(double size, const Cost& cost) {
    std::string exponents;
    if (size_ > 0.0) {
      const double ratio = std::log(size / size_);
      exponents = fmt::format("  grows with size^{:.2f}", std::log(cost.millis / cost_.millis) / ratio);
    }
    std::printf("%-42s %12.0f %10.1f ms %9.1f MB%s\n", what_.c_str(), size, cost.millis, cost.peak_mb, exponents.c_str());
    std::fflush(stdout);
    size_ = size;
    cost_ = cost;
  }

 private:
  std::string what_;
  double size_ = 0.0;
  Cost cost_;
};

void lists(double scale) {
  const fs::path folder = fs::temp_directory_path() / fmt::format("crosstie-load-{}", std::random_device()());
  fs::create_directories(folder);
  Growth write("write a list, points"), read("read it"), compare("compare with a reference, best fit"),
      ply("write and read a PLY");
  for (const double share : {0.1, 0.3, 1.0}) {
    const int count = static_cast<int>(100000 * scale * share);
    std::mt19937_64 random(1);
    std::normal_distribution<double> normal;
    const auto draw = [&](double sigma) {
      return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
    };
    base::PointList reference, measured;
    const Eigen::AngleAxisd turn(0.3, Eigen::Vector3d(1.0, 2.0, 3.0).normalized());
    for (int id = 0; id < count; ++id) {
      const Eigen::Vector3d p = draw(1000.0);
      const Eigen::Matrix3d cov = Eigen::Matrix3d::Identity() * 1e-4;
      reference.points.push_back({id, p + draw(0.01), cov});
      measured.points.push_back({id, turn * p + Eigen::Vector3d(10.0, 20.0, 30.0) + draw(0.01), cov});
    }
    const fs::path file = folder / "list.csv";
    write.add(count, cost_of([&] { checked(base::write_point_list(file, reference)); }));
    base::PointList again;
    read.add(count, cost_of([&] { again = checked(base::read_point_list(file)); }));
    if (again.points.size() != reference.points.size()) give_up("points were lost");
    compare.add(count, cost_of([&] {
                  const auto verification = checked(verify::compare(measured, again, {}));
                  if (verification.points.size() != again.points.size()) give_up("points were lost");
                }));
    base::Cloud cloud;
    for (const auto& point : reference.points) cloud.points.push_back(point.xyz_mm);
    ply.add(count, cost_of([&] {
              checked(base::write_ply(folder / "cloud.ply", cloud));
              if (checked(base::read_ply(folder / "cloud.ply")).points.size() != cloud.points.size())
                give_up("points were lost");
            }));
  }
  fs::remove_all(folder);
}

/// The twin's panel with a sensor of so many pixels: as many markers, larger; and the same picture tiled: as large, more of them.
void image(double scale) {
  Growth larger("detect one image [px], 60 large markers"), more("detect one image [px], tiled: more markers");
  base::Image tile;
  for (const double megapixels : {2.7, 10.7, 50.0 * scale}) {
    fixtures::Scene scene = checked(fixtures::make_scene("panel"));
    fixtures::SceneCamera& camera = scene.cameras[static_cast<std::size_t>(scene.views[0].camera)];
    const double factor = std::sqrt(1e6 * megapixels / (camera.camera->width_px() * camera.camera->height_px()));
    Eigen::VectorXd p = camera.camera->parameters();
    p.head<4>() *= factor;
    camera.sensor.bits = 8;
    camera.camera = checked(base::Camera::make(camera.camera->model(), static_cast<int>(camera.camera->width_px() * factor),
                                               static_cast<int>(camera.camera->height_px() * factor), p));
    const base::Image picture = checked(fixtures::render(scene, 0, 1));
    const double pixels = static_cast<double>(picture.width()) * picture.height();
    std::size_t coded = 0;
    const auto count = [](const base::ImageObservations& seen) {
      return static_cast<std::size_t>(std::count_if(seen.observations.begin(), seen.observations.end(),
                                                    [](const auto& o) { return o.status == base::ObservationStatus::kCoded; }));
    };
    larger.add(pixels, cost_of([&] { coded = count(checked(markers::detect(picture.view(), scene.family))); }));
    if (tile.width() == 0) tile = picture;
    const int side = std::max(1, static_cast<int>(std::lround(std::sqrt(pixels / (1.0 * tile.width() * tile.height())))));
    base::Image tiled(tile.width() * side, tile.height() * side, 8);
    for (int y = 0; y < tiled.height(); ++y) {
      for (int i = 0; i < side; ++i)
        std::copy_n(tile.row<std::uint8_t>(y % tile.height()), tile.width(), tiled.row<std::uint8_t>(y) + i * tile.width());
    }
    std::size_t many = 0;
    more.add(1.0 * tiled.width() * tiled.height(),
             cost_of([&] { many = count(checked(markers::detect(tiled.view(), scene.family))); }));
    std::printf("    %d x %d: %zu coded markers; tiled %d x %d: %zu\n", picture.width(), picture.height(), coded, tiled.width(),
                tiled.height(), many);
  }
}

/// Photographs from all sides of points in a box of 3 m x 2 m x 0.6 m, each of which is seen from one side of them.
base::Network network_of(int images, int points, int rays_of_point) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  base::Network network;
  const base::Camera camera = checked(base::Camera::nominal(base::LensModel::kOpenCv5, 4000, 3000, 3400.0));
  network.cameras = {{"hand", camera, true}};
  std::vector<Eigen::Vector3d> truth;
  for (int i = 0; i < points; ++i)
    truth.emplace_back(1500.0 * uniform(random), 1000.0 * uniform(random), 300.0 * uniform(random));
  std::uniform_int_distribution<int> chance(0, images - 1);
  std::vector<int> middle;  // of the photographs that show a point, which are neighbours
  for (int k = 0; k < points; ++k) middle.push_back(chance(random));
  for (int i = 0; i < images; ++i) {
    const double around = 2.0 * std::numbers::pi * i / images, height = 0.6 + 0.5 * (i % 3) / 2.0;
    const Eigen::Vector3d place =
        4500.0 * Eigen::Vector3d(std::cos(around) * std::cos(height), std::sin(around) * std::cos(height), std::sin(height));
    const base::Pose pose = fixtures::look_at(place, {0.0, 0.0, 0.0}, i % 4 == 3 ? std::numbers::pi / 2.0 : 0.0);
    base::ImageObservations& seen = network.images.emplace_back();
    seen.image = fmt::format("i{:03}", i);
    seen.camera = "hand";
    seen.width_px = 4000;
    seen.height_px = 3000;
    for (int k = 0; k < points; ++k) {
      const int apart = std::abs(middle[static_cast<std::size_t>(k)] - i);
      if (2 * std::min(apart, images - apart) > rays_of_point) continue;
      const auto pixel = camera.project(pose.inverse() * truth[static_cast<std::size_t>(k)]);
      if (!pixel || pixel->minCoeff() < 10.0 || pixel->x() > 3990.0 || pixel->y() > 2990.0) continue;
      base::Observation one;
      one.id = k;
      one.status = base::ObservationStatus::kCoded;
      one.centre_px = *pixel + 0.02 * Eigen::Vector2d(normal(random), normal(random));
      one.cov_px2 = 4e-4 * Eigen::Matrix2d::Identity();
      one.semi_major_px = one.semi_minor_px = 8.0;
      seen.observations.push_back(one);
    }
  }
  base::ScaleBar bar;
  bar.id_a = 0;
  bar.id_b = 1;
  bar.length_mm = (truth[0] - truth[1]).norm();
  bar.sigma_mm = 0.005;
  network.scale_bars = {bar};
  return network;
}

void adjust(double scale) {
  const auto row = [](Growth& growth, double size, int images, int points, int rays) {
    const base::Network network = network_of(images, points, rays);
    std::size_t observations = 0;
    for (const auto& one : network.images) observations += one.observations.size();
    base::AdjustedNetwork adjusted;
    growth.add(size, cost_of([&] { adjusted = checked(bundle::adjust(network, {.model_sigma_px = 0.0})); }));
    std::printf("    %zu observations, %zu points and %zu images adjusted, %zu rejected, sigma0 %.4f, %d iterations\n",
                observations, adjusted.points.size(), adjusted.images.size(), adjusted.rejected.size(), adjusted.sigma0,
                adjusted.iterations);
  };
  Growth photographs("adjust, 300 points: photographs"), points("adjust, 200 photographs: points");
  for (const int images : {50, 100, 200}) {
    if (images > 200 * scale) continue;
    row(photographs, images, images, 300, images / 2);
  }
  for (const double share : {0.02, 0.1, 1.0}) {
    const int count = static_cast<int>(20000 * scale * share);
    row(points, count, 200, count, 12);
  }
}

/// A job of the twin's machine with more stops and photographs; its images are small, so that files and steps weigh more than pixels.
void job(const fs::path& folder, int stations, int photographs) {
  fixtures::Scene scene = checked(fixtures::make_scene("machine"));
  auto& stops = scene.machine->stations;
  const double from = stops.front().axis_mm, to = stops.back().axis_mm;
  stops.resize(static_cast<std::size_t>(stations), stops.front());
  for (int i = 0; i < stations; ++i) {
    stops[static_cast<std::size_t>(i)].axis_mm = from + (to - from) * i / std::max(1, stations - 1);
    stops[static_cast<std::size_t>(i)].name = fmt::format("s{:03}", i);
  }
  const std::vector<fixtures::View> views = scene.views;
  scene.views.clear();
  for (int i = 0; i < photographs; ++i) {
    fixtures::View view = views[static_cast<std::size_t>(i) % views.size()];
    // Each time round a little farther to the side.
    const int round = i / static_cast<int>(views.size());
    view.name = fmt::format("{}_{:03}", scene.cameras[static_cast<std::size_t>(view.camera)].name, i);
    view.scene_from_camera.translation_mm +=
        view.scene_from_camera.rotation *
        Eigen::Vector3d(17.0 * (round % 7) - 51.0, 23.0 * (round % 5) - 46.0, -15.0 * (round % 3));
    scene.views.push_back(std::move(view));
  }
  checked(fixtures::simulate(fixtures::drawn(scene, 1), folder, {}));
}

}  // namespace
}  // namespace crosstie::bench

int main(int argc, char** argv) {
  using namespace crosstie;
  const std::string what = argc > 1 ? argv[1] : "";
  if (what == "job" && argc == 5) {
    bench::job(argv[2], std::atoi(argv[3]), std::atoi(argv[4]));
    return 0;
  }
  const double scale = argc > 2 ? std::atof(argv[2]) : 1.0;
  if (what == "lists")
    bench::lists(scale);
  else if (what == "image")
    bench::image(scale);
  else if (what == "adjust")
    bench::adjust(scale);
  else {
    std::fprintf(stderr, "usage: bench_load lists|image|adjust [SCALE], or job FOLDER STATIONS PHOTOGRAPHS\n");
    return 2;
  }
  return 0;
}
