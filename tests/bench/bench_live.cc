// The operator's page at work: two simulated cameras replay pictures that the twin rendered, 1224 x 1024 with some 30 coded markers; each
// pair is searched for markers, judged, drawn, coded as JPEG and triangulated. What counts is the rate that two cores hold; at 100 Hz, more
// than they can, the newest win.

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "devices/simulated_camera.h"
#include "fixtures/render.h"
#include "fixtures/scene.h"
#include "live/preview_loop.h"
#include "live/spatial.h"

namespace crosstie::bench {
namespace {

using devices::host_now;
using devices::seconds_between;

constexpr std::size_t kPictures = 4;  // of each camera, with noise of their own, shown in turn

double cpu_s() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

struct Twin {
  fixtures::Scene scene;
  std::array<std::vector<base::Image>, 2> pictures;
  base::Head head;
};

/// The first stop of the twin's machine whose pictures show most markers.
base::Result<Twin> make_twin() {
  auto scene = fixtures::make_scene("segment");
  if (!scene) return base::fail(std::move(scene));
  Twin twin{.scene = fixtures::drawn(*std::move(scene), 1),
            .pictures = {},
            .head = {.left = *base::Camera::nominal(base::LensModel::kOpenCv5, 8, 8, 8.0),
                     .right = *base::Camera::nominal(base::LensModel::kOpenCv5, 8, 8, 8.0),
                     .right_from_left = {}}};
  const int middle = static_cast<int>(twin.scene.machine->stations.size() / 2);
  for (std::size_t v = 0; v < twin.scene.views.size(); ++v) {
    const fixtures::View& view = twin.scene.views[v];
    if (view.purpose != fixtures::Purpose::kStation || view.station != middle) continue;
    const fixtures::SceneCamera& camera = twin.scene.cameras[static_cast<std::size_t>(view.camera)];
    const std::size_t side = camera.name == twin.scene.head->left ? 0 : 1;
    const auto light = fixtures::render_irradiance(twin.scene, v);
    if (!light) return tl::unexpected(light.error());
    for (std::size_t i = 0; i < kPictures; ++i) {
      twin.pictures[side].push_back(fixtures::expose(*light, camera.sensor, camera.exposure, 100 * side + i));
    }
    (side == 0 ? twin.head.left : twin.head.right) = *camera.camera;
  }
  twin.head.right_from_left = twin.scene.head->right_from_left;
  const Eigen::Index n = twin.head.parameter_count();
  twin.head.cov = Eigen::MatrixXd::Identity(n, n) * 1e-8;
  return twin;
}

void print_steps(const Twin& twin, const live::PreviewOptions& options) {
  constexpr int kRuns = 12;
  std::vector<double> detect, judge, draw, encode, locate, cpu;
  std::array<base::ImageObservations, 2> seen;
  std::size_t bytes = 0;
  for (int run = 0; run < kRuns; ++run) {
    for (std::size_t side = 0; side < 2; ++side) {
      const devices::Frame frame{{}, twin.pictures[side][static_cast<std::size_t>(run) % kPictures], {}};
      const double before_s = cpu_s();
      const auto picture = live::preview(frame, options);
      cpu.push_back(1e3 * (cpu_s() - before_s));
      detect.push_back(picture->millis.detect);
      judge.push_back(picture->millis.judge);
      draw.push_back(picture->millis.draw);
      encode.push_back(picture->millis.encode);
      bytes = picture->jpeg.size();
      seen[side] = picture->observations;
    }
    const auto begin = host_now();
    (void)live::locate_markers(twin.head, seen[0], seen[1]);
    locate.push_back(1e3 * seconds_between(begin, host_now()));
  }
  const auto coded = std::count_if(seen[0].observations.begin(), seen[0].observations.end(),
                                   [](const auto& one) { return one.status == base::ObservationStatus::kCoded; });
  std::printf(
      "one thread, median of %d [ms a picture]: detect %.1f, judge %.1f, draw %.1f, encode %.1f (%zu kB), together %.1f of "
      "CPU; "
      "3D %.1f a pair; %td coded of %zu observations\n",
      2 * kRuns, quantile(detect, 0.5), quantile(judge, 0.5), quantile(draw, 0.5), quantile(encode, 0.5), bytes / 1000,
      quantile(cpu, 0.5), quantile(locate, 0.5), coded, seen[0].observations.size());
}

void run(const Twin& twin, const live::PreviewOptions& options, double rate_hz, double seconds) {
  const auto replay = [&](std::size_t side) {
    return [&twin, side](const devices::SimulatedExposure& exposure) -> base::Result<base::Image> {
      return twin.pictures[side][exposure.id % kPictures];
    };
  };
  devices::SimulatedCamera left("left", replay(0)), right("right", replay(1));
  devices::CameraPair pair(left, right, {.max_host_skew_s = 0.4 / rate_hz});  // below half of the time between two exposures
  live::Feed feed;
  std::mutex mutex;
  std::vector<double> latency_ms;
  std::size_t located = 0;
  std::string trouble;
  live::PreviewLoop loop(pair, feed,
                         [&](base::Result<live::PreviewPair> seen) {
                           const std::lock_guard lock(mutex);
                           if (!seen) {
                             trouble = seen.error().message;
                             return;
                           }
                           const auto markers =
                               live::locate_markers(twin.head, seen->pictures[0].observations, seen->pictures[1].observations);
                           located += static_cast<std::size_t>(std::count_if(
                               markers->begin(), markers->end(), [](const auto& marker) { return marker.xyz_mm.has_value(); }));
                           for (const auto& picture : seen->pictures) latency_ms.push_back(picture.latency_ms);
                         },
                         {options, options});
  const double cpu_before_s = cpu_s();
  const auto begin = host_now();
  if (const auto started = loop.start({.frame_rate_hz = rate_hz}); !started) {
    std::printf("does not start: %s\n", started.error().message.c_str());
    return;
  }
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  const live::PreviewStatistics statistics = loop.statistics();
  loop.stop();
  const double passed_s = seconds_between(begin, host_now());
  const std::lock_guard lock(mutex);
  const auto shown = statistics.cameras[0].shown;
  std::printf(
      "%3.0f Hz: shown %.1f pairs/s (%llu of %llu paired, %llu unmatched, %llu dropped), latency median %.0f ms, 95 %% %.0f "
      "ms, "
      "%.0f ms of CPU a pair, %.1f markers in space a pair%s\n",
      rate_hz, static_cast<double>(shown) / passed_s, static_cast<unsigned long long>(shown),
      static_cast<unsigned long long>(statistics.pairs.pairs),
      static_cast<unsigned long long>(statistics.pairs.unmatched[0] + statistics.pairs.unmatched[1]),
      static_cast<unsigned long long>(statistics.cameras[0].dropped), quantile(latency_ms, 0.5), quantile(latency_ms, 0.95),
      1e3 * (cpu_s() - cpu_before_s) / static_cast<double>(std::max<std::uint64_t>(1, shown)),
      2.0 * static_cast<double>(located) / static_cast<double>(std::max<std::size_t>(1, latency_ms.size())), trouble.c_str());
}

}  // namespace
}  // namespace crosstie::bench

int main(int argc, char** argv) {
  using namespace crosstie;
  const double seconds = argc > 1 ? std::atof(argv[1]) : 10.0;
  const auto twin = bench::make_twin();
  if (!twin) {
    std::printf("%s\n", twin.error().message.c_str());
    return 1;
  }
  const live::PreviewOptions options{.family = twin->scene.family};
  bench::print_steps(*twin, options);
  for (const double rate_hz : {20.0, 30.0, 100.0}) bench::run(*twin, options, rate_hz, seconds);
  return 0;
}
