// The alignment of two clouds against PCL's GICP and Open3D's point-to-plane ICP, from points to the motion (normals, search, alignment), and
// thirty stations of a million points.
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>

#include <fmt/format.h>

#include "base/parallel.h"
#include "base/ply.h"
#include "math/rigid_alignment.h"
#include "registration/merge.h"
#include "registration/stitch.h"
#include "tests/bench/stitch_peers.h"
#include "tests/bench/table.h"
#include "tests/registration/synthetic_shell.h"

namespace crosstie::bench {
namespace {

constexpr int kRuns = 5;

[[noreturn]] void give_up(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(1);
}

double wall_ms(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

template <typename Clock>
double best_of(Clock clock, const std::function<void()>& work) {
  double best = 1e300;
  for (int run = 0; run < kRuns; ++run) best = std::min(best, clock(work));
  return best;
}

/// Two clouds, what is known of their markers, and the truth.
struct Task {
  const char* name = "";
  base::Cloud first;
  base::Cloud second;
  std::vector<registration::Sighting> first_markers;
  std::vector<registration::Sighting> second_markers;
  base::Pose start;  ///< first_from_second
  base::Pose truth;
  double reach_mm = 0.0;
};

Task shell_task() {
  const tests::Shell shell;
  tests::Scanner scanner(1);
  const tests::Window windows[2] = {{.along_mm = -225.0}, {.along_mm = 225.0}};
  Task task;
  task.name = "twin shell, 2 x 20 000 points";
  const base::Pose first = scanner.pose(shell, windows[0]);
  const base::Pose second = scanner.pose(shell, windows[1]);
  std::vector<math::AlignmentPair> pairs;
  for (int id = 0; id < 5; ++id) {
    const Eigen::Vector3d place = shell.at(scanner.uniform(-205.0, 205.0), scanner.uniform(-330.0, 330.0));
    task.first_markers.push_back(scanner.sighting(id, place, first, 0.03));
    task.second_markers.push_back(scanner.sighting(id, place, second, 0.03));
    pairs.push_back({task.first_markers.back().p_in_rig_mm, task.second_markers.back().p_in_rig_mm});
  }
  task.first = scanner.cloud(shell, windows[0], first, 20000, 0.03);
  task.second = scanner.cloud(shell, windows[1], second, 20000, 0.03);
  task.truth = first.inverse() * second;
  task.start = math::align(pairs)->a_from_b;
  task.reach_mm = 10.0;
  return task;
}

Task moved_task(base::Cloud cloud) {
  Task task;
  task.name = "plaster-head, moved";
  task.truth = {base::rotation_exp({0.02, -0.015, 0.01}), {2.0, -1.5, 1.0}};
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : cloud.points) middle += point / static_cast<double>(cloud.points.size());
  // Turned about its middle; the second is a copy in another frame, so that no grid is shared.
  task.truth.translation_mm += middle - task.truth.rotation * middle;
  task.second = cloud;
  const base::Pose second_from_first = task.truth.inverse();
  for (Eigen::Vector3d& point : task.second.points) point = second_from_first * point;
  for (Eigen::Vector3d& normal : task.second.normals) normal = second_from_first.rotation * normal;
  task.first = std::move(cloud);
  task.reach_mm = 10.0;
  return task;
}

/// From points to the motion, with `threads` threads.
base::Pose ours(const Task& task, int threads) {
  registration::StitchInput input;
  input.stations.resize(2);
  std::vector<std::optional<registration::Surface>> surfaces(2);
  const auto done = base::parallel_for(2, threads, "surfaces", {}, [&](std::size_t i) -> base::Result<> {
    auto surface = registration::Surface::make(i == 0 ? task.first : task.second);
    if (!surface) return base::fail(std::move(surface));
    surfaces[i] = *std::move(surface);
    return {};
  });
  if (!done) give_up(done.error().message);
  for (std::size_t i = 0; i < 2; ++i) {
    input.stations[i].name = i == 0 ? "first" : "second";
    input.stations[i].markers = i == 0 ? task.first_markers : task.second_markers;
    input.stations[i].surface = std::move(surfaces[i]);
    if (task.first_markers.empty()) input.stations[i].start = i == 0 ? base::Pose{} : task.start;
  }
  registration::StitchOptions options{.threads = threads};
  if (task.first_markers.empty()) options.start_reach_mm = task.reach_mm;
  const auto result = registration::stitch(input, options);
  if (!result) give_up(result.error().message);
  return result->stations[0].machine_from_rig.inverse() * result->stations[1].machine_from_rig;
}

void print_error(const char* who, const base::Pose& found, const Task& task) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : task.second.points) middle += point / static_cast<double>(task.second.points.size());
  std::printf("  %-10s off by %8.4f mm, %8.5f deg\n", who, (found * middle - task.truth * middle).norm(),
              base::rotation_log(found.rotation * task.truth.rotation.conjugate()).norm() * 57.29577951308232);
}

base::Pose pose_of(const Eigen::Matrix4d& matrix) {
  return {Eigen::Quaterniond(Eigen::Matrix3d(matrix.topLeftCorner<3, 3>())).normalized(), matrix.topRightCorner<3, 1>()};
}

void compare(const Task& task) {
  std::printf("%s (%zu and %zu points)\n", task.name, task.first.points.size(), task.second.points.size());
  const Eigen::Matrix4d start = task.start.matrix();
  base::Pose found;
  const auto cpu = [](const std::function<void()>& work) { return millis_of(work); };
  const double one = best_of(cpu, [&] { found = ours(task, 1); });
  print_error("ours", found, task);
  PeerAlignment peer;
  const double pcl = best_of(cpu, [&] { peer = pcl_gicp(task.first.points, task.second.points, start, task.reach_mm); });
  print_error("PCL GICP", pose_of(peer.first_from_second), task);
  const double open3d =
      best_of(cpu, [&] { peer = open3d_point_to_plane(task.first.points, task.second.points, start, task.reach_mm); });
  print_error("Open3D", pose_of(peer.first_from_second), task);
  print_heading("PCL 1.13 GICP, Open3D 0.16 point-to-plane; ms of processor time");
  print_row("normals + search + alignment, PCL", one, pcl);
  print_row("normals + search + alignment, Open3D", one, open3d);
  const double wall_one = best_of(wall_ms, [&] { found = ours(task, 1); });
  const double wall_two = best_of(wall_ms, [&] { found = ours(task, 2); });
  std::printf("%-44s %10.2f %10.2f %8.2f   wall time, one thread over two\n", "two threads", wall_two, wall_one,
              wall_one / wall_two);
}

long peak_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss / 1024;
}

/// Stations one after the other from memory that is freed again, as from files.
void many_stations(int count) {
  const tests::Shell shell;
  const auto window = [](int k) { return tests::Window{.along_mm = 350.0 * k, .length_mm = 700.0, .height_mm = 900.0}; };
  const auto cloud_of = [&](int k, const base::Pose& pose) {
    tests::Scanner scanner(1000 + static_cast<std::uint64_t>(k));
    base::Cloud cloud = scanner.cloud(shell, window(k), pose, 1000000, 0.03);
    cloud.fields.push_back({"sigma_mm", std::vector<double>(cloud.points.size(), 0.03)});
    return cloud;
  };
  tests::Scanner scanner(7);
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < 6 * (count + 1); ++i) {
    places.push_back(shell.at(350.0 * (i / 6) - 175.0 + scanner.uniform(-170.0, 170.0), scanner.uniform(-400.0, 400.0)));
  }
  registration::StitchInput input;
  std::vector<base::Pose> truth;
  double surfaces = 0.0;
  for (int k = 0; k < count; ++k) {
    truth.push_back(scanner.pose(shell, window(k)));
    const base::Cloud cloud = cloud_of(k, truth.back());
    registration::StationScan& station = input.stations.emplace_back();
    station.name = fmt::format("s{}", k);
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (std::abs(places[i].x() - 350.0 * k) < 345.0)
        station.markers.push_back(scanner.sighting(static_cast<int>(i), places[i], truth.back(), 0.03));
    }
    surfaces += millis_of([&] { station.surface = *registration::Surface::make(cloud); });
  }
  base::Result<base::Stitching> result = tl::unexpected(base::Error{});
  const double aligned = millis_of([&] { result = registration::stitch(input); });
  if (!result) give_up(result.error().message);
  double merged = 0.0;
  std::size_t points = 0;
  {
    registration::CloudMerger merger(*result, {});
    for (int k = 0; k < count; ++k) {
      const base::Cloud cloud = cloud_of(k, truth[static_cast<std::size_t>(k)]);
      merged += millis_of([&] {
        if (!merger.add(k, cloud)) give_up("merging failed");
      });
    }
    merged += millis_of([&] { points = merger.finish().points.size(); });
  }
  std::printf("%8d %12.0f %12.0f %12.0f %12.0f %14.0f %10zu %10ld\n", count, surfaces, aligned, merged,
              surfaces + aligned + merged, (surfaces + aligned + merged) / count, points, peak_mb());
}

}  // namespace
}  // namespace crosstie::bench

int main(int argc, char** argv) {
  using namespace crosstie::bench;
  compare(shell_task());
  if (argc > 1) {
    auto cloud = crosstie::base::read_ply(argv[1]);
    if (!cloud) give_up(cloud.error().message);
    cloud->frame = "rig";
    compare(moved_task(*std::move(cloud)));
  } else {
    std::printf("plaster-head: give the cloud.ply of its scan as an argument\n");
  }
  std::printf("stations of 1 000 000 points; ms of processor time\n%8s %12s %12s %12s %12s %14s %10s %10s\n", "stations",
              "surfaces", "alignment", "merging", "all", "per station", "merged", "peak MB");
  for (const int count : {2, 5, 10, 20, 30}) many_stations(count);
  return 0;
}
