// Fringe images that are in memory already to a cloud: time against the bars, against memory bandwidth, against OpenCV's structured_light
// on the same Gray code images, and how time and memory grow with pixels and images.

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <numbers>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/structured_light.hpp>

#include "base/parallel.h"
#include "scan/cloud.h"
#include "scan/decode.h"
#include "scan/match.h"
#include "scan/patterns.h"
#include "tests/bench/table.h"

namespace crosstie::bench {
namespace {

using base::Image;
using base::Pattern;
using base::PatternKind;
using base::PatternSequence;
using base::ProjectorAxis;

/// A wall before two parallel pinhole cameras and a projector, all by closed formulae.
class Wall {
 public:
  Wall(int width, int height, const scan::PatternOptions& options)
      : head{"left", "right", camera(width, height), camera(width, height), base::Pose{}, {}, {}},
        sequence(*scan::make_patterns(options)),
        width_(width),
        height_(height) {
    head.right_from_left.translation_mm = {-kBaseline_mm, 0.0, 0.0};
    for (const Pattern& pattern : sequence.patterns) patterns_.push_back(scan::render_pattern(options, sequence, pattern));
  }

  /// What a camera sees of a pattern, with some noise that no generator needs.
  [[nodiscard]] Image image(int which, std::size_t pattern) const {
    const Image& shown = patterns_[pattern];
    Image image(width_, height_, 8);
    const double focal = kFocal * width_;
    std::uint32_t state = 12345U + 977U * static_cast<std::uint32_t>(pattern) + 7U * static_cast<std::uint32_t>(which);
    for (int y = 0; y < height_; ++y) {
      auto* row = image.row<std::uint8_t>(y);
      const double v = (0.5 + 0.55 * (y - 0.5 * height_) / focal / 0.4) * shown.height();
      for (int x = 0; x < width_; ++x) {
        // X of the wall under the pixel, on a plane that is turned a little about the vertical.
        const double tangent = (x - 0.5 * width_) / focal;
        const double from = which == 0 ? 0.0 : kBaseline_mm;
        const double z = (kDepth_mm + kTilt * from) / (1.0 - kTilt * tangent);
        const double wall_x = from + tangent * z;
        const double u = (0.5 + (wall_x - 0.5 * kBaseline_mm) / 1500.0) * shown.width();
        double level = 12.0;
        if (u >= 0.5 && u < shown.width() - 1.5 && v >= 0.0 && v < shown.height()) {
          const auto* line = shown.view().row<std::uint8_t>(static_cast<int>(v));
          const auto i = static_cast<std::size_t>(u - 0.5);
          const double part = u - 0.5 - static_cast<double>(i);
          const auto j = static_cast<int>(v - 0.5 < 0.0 ? 0.0 : v - 0.5);
          const double down = std::max(0.0, v - 0.5 - j);
          const auto* next = shown.view().row<std::uint8_t>(std::min(j + 1, shown.height() - 1));
          const auto* first = shown.view().row<std::uint8_t>(j);
          (void)line;
          const double upper = (1.0 - part) * first[i] + part * first[i + 1];
          const double lower = (1.0 - part) * next[i] + part * next[i + 1];
          level += 0.7 * ((1.0 - down) * upper + down * lower);
        }
        state = state * 1664525U + 1013904223U;
        const double noise = (static_cast<double>(state >> 24U) + static_cast<double>((state >> 16U) & 255U) - 255.0) / 75.0;
        row[x] = static_cast<std::uint8_t>(std::clamp(level + noise + 0.5, 0.0, 255.0));
      }
    }
    return image;
  }

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }

  base::Head head;
  PatternSequence sequence;

 private:
  static constexpr double kBaseline_mm = 300.0;
  static constexpr double kDepth_mm = 1200.0;
  static constexpr double kTilt = 0.1;
  static constexpr double kFocal = 1.4;  // of the image's width
  static base::Camera camera(int width, int height) {
    Eigen::VectorXd p(4);
    p << kFocal * width, kFocal * width, 0.5 * width, 0.5 * height;
    return *base::Camera::make(base::LensModel::kPinhole, width, height, p);
  }
  int width_;
  int height_;
  std::vector<Image> patterns_;
};

struct Times {
  double decode_s = 0.0;  ///< wall clock
  double all_s = 0.0;
  double cpu_s = 0.0;
  std::int64_t points = 0;
};

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Image by image, and then what needs all of them, both cameras' at once: as `crosstie scan` does it.
template <typename ImageOf>
std::array<base::PhaseMap, 2> decode(const Wall& wall, const ImageOf& image_of) {
  const auto give_up = [](const base::Error& error) {
    std::fprintf(stderr, "%s\n", error.message.c_str());
    std::exit(1);
  };
  std::vector<scan::Decoder> decoders;
  for (int camera = 0; camera < 2; ++camera)
    decoders.push_back(*scan::Decoder::make(wall.sequence, wall.width(), wall.height(), {}));
  for (std::size_t i = 0; i < wall.sequence.patterns.size(); ++i) {
    const auto added = base::parallel_for(
        2, 0, "images", {}, [&](std::size_t camera) { return decoders[camera].add(static_cast<int>(i), image_of(camera, i)); });
    if (!added) give_up(added.error());
  }
  std::array<base::PhaseMap, 2> maps;
  const auto done = base::parallel_for(2, 0, "phases", {}, [&](std::size_t camera) -> base::Result<> {
    auto map = decoders[camera].finish();
    if (!map) return base::fail(std::move(map));
    maps[camera] = *std::move(map);
    return {};
  });
  if (!done) give_up(done.error());
  return maps;
}

/// Images -> cloud. `images` are consumed.
Times reconstruct(const Wall& wall, std::array<std::vector<Image>, 2> images) {
  Times times;
  const std::clock_t cpu = std::clock();
  const auto start = std::chrono::steady_clock::now();
  const auto maps = decode(wall, [&](std::size_t camera, std::size_t i) { return std::move(images[camera][i]); });
  times.decode_s = seconds_since(start);
  const auto depths = scan::match(maps[0], maps[1], wall.head, {});
  const auto cloud = scan::make_cloud(*depths, maps[0], wall.head, {});
  times.all_s = seconds_since(start);
  times.cpu_s = static_cast<double>(std::clock() - cpu) / CLOCKS_PER_SEC;
  times.points = static_cast<std::int64_t>(cloud->cloud.points.size());
  return times;
}

std::array<std::vector<Image>, 2> all_images(const Wall& wall) {
  std::array<std::vector<Image>, 2> images;
  for (int camera = 0; camera < 2; ++camera) {
    for (std::size_t i = 0; i < wall.sequence.patterns.size(); ++i)
      images[static_cast<std::size_t>(camera)].push_back(wall.image(camera, i));
  }
  return images;
}

/// The fastest of some runs.
Times best_of(const Wall& wall, int runs) {
  const auto images = all_images(wall);
  Times best;
  for (int run = 0; run < runs; ++run) {
    const Times times = reconstruct(wall, images);
    if (run == 0 || times.all_s < best.all_s) {
      const double cpu = run == 0 ? times.cpu_s : std::min(best.cpu_s, times.cpu_s);
      const double decode = run == 0 ? times.decode_s : std::min(best.decode_s, times.decode_s);
      best = times;
      best.cpu_s = cpu;
      best.decode_s = decode;
    }
  }
  return best;
}

double peak_rss_mib() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// Memory [MiB] that streaming the images through a process takes at its peak, beyond that of the patterns they are made from.
double peak_mib(int width, int height, const scan::PatternOptions& options) {
  std::array<int, 2> ends = {};
  if (pipe(ends.data()) != 0) return -1.0;
  const pid_t child = fork();
  if (child == 0) {
    const Wall wall(width, height, options);
    const double before = peak_rss_mib();
    const auto maps = decode(wall, [&](std::size_t camera, std::size_t i) { return wall.image(static_cast<int>(camera), i); });
    const auto depths = scan::match(maps[0], maps[1], wall.head, {});
    const auto cloud = scan::make_cloud(*depths, maps[0], wall.head, {});
    const double taken = peak_rss_mib() - before;
    const bool told = cloud && write(ends[1], &taken, sizeof taken) == sizeof taken;
    _exit(told ? 0 : 1);
  }
  close(ends[1]);
  double taken = -1.0;
  if (read(ends[0], &taken, sizeof taken) != sizeof taken) taken = -1.0;
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return taken;
}

/// Bytes per second that all cores together read from memory.
double bandwidth() {
  const std::size_t words = std::size_t{48} << 20U;  // 384 MiB
  std::vector<std::uint64_t> memory(words, 1);
  const unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  double best = 0.0;
  for (int run = 0; run < 5; ++run) {
    std::vector<std::uint64_t> sums(threads);
    const auto start = std::chrono::steady_clock::now();
    std::vector<std::thread> workers;
    for (unsigned t = 0; t < threads; ++t) {
      workers.emplace_back([&, t] {
        const std::size_t from = words / threads * t;
        const std::size_t to = words / threads * (t + 1);
        std::uint64_t a = 0, b = 0, c = 0, d = 0;
        for (std::size_t i = from; i + 4 <= to; i += 4) {
          a += memory[i];
          b += memory[i + 1];
          c += memory[i + 2];
          d += memory[i + 3];
        }
        sums[t] = a + b + c + d;
      });
    }
    for (std::thread& worker : workers) worker.join();
    const double seconds = seconds_since(start);
    best = std::max(best, static_cast<double>(words * sizeof(std::uint64_t)) / seconds);
    if (sums[0] == 0) std::printf("\n");
  }
  return best;
}

scan::PatternOptions seventeen() {  // white, black, 8 bits, 7 steps of one direction
  scan::PatternOptions options;
  options.width_px = 1920;
  options.height_px = 1080;
  options.y = false;
  options.inverse = false;
  options.repeat = false;
  options.periods_px = {15.0};
  options.steps = 7;
  return options;
}

scan::PatternOptions thirty_six() {  // white, black, 7 + 7 bits, 8 + 8 steps, repeats
  scan::PatternOptions options = seventeen();
  options.y = true;
  options.repeat = true;
  options.periods_px = {30.0};
  options.steps = 8;
  return options;
}

void against_bars() {
  const double peak = peak_mib(2592, 1944, thirty_six());  // first: memory that others have left would be used again
  const double bytes_per_s = bandwidth();
  std::printf("memory bandwidth, all threads: %.1f GB/s\n", 1e-9 * bytes_per_s);
  struct Case {
    const char* name;
    int width, height;
    scan::PatternOptions options;
    double bar_s;
  };
  for (const Case& one : {Case{"2 x 17 images of 3 Mpx", 2048, 1536, seventeen(), 1.0},
                          Case{"2 x 36 images of 5 Mpx", 2592, 1944, thirty_six(), 2.5}}) {
    const Wall wall(one.width, one.height, one.options);
    const Times times = best_of(wall, 3);
    std::printf("%s: %zu images each, %lld points\n", one.name, wall.sequence.patterns.size(),
                static_cast<long long>(times.points));
    print_row(fmt::format("  to cloud, wall clock [s] (bar)").c_str(), times.all_s, one.bar_s);
    print_row("  to cloud, processor time / 2 cores [s] (bar)", times.cpu_s / 2.0, one.bar_s);
    const double bytes = 2.0 * static_cast<double>(wall.sequence.patterns.size()) * one.width * one.height;
    print_row("  decode alone [s] (3 x memory's time)", times.decode_s, 3.0 * bytes / bytes_per_s);
  }
  print_row("peak memory, 36 images of 5 Mpx [MiB] (bar)", peak, 1024.0);
}

void growth() {
  std::printf("\n%-28s %8s %10s %10s %12s\n", "growth", "images", "wall [s]", "cpu [s]", "peak [MiB]");
  struct Case {
    int width, height;
    scan::PatternOptions options;
    double peak = 0.0;
  };
  std::vector<Case> cases;
  for (const double mpx : {0.75, 1.5, 3.0, 6.0}) {
    const int width = static_cast<int>(std::lround(std::sqrt(mpx * 1e6 * 4.0 / 3.0)));
    cases.push_back({width, width * 3 / 4, seventeen()});
  }
  for (const int steps : {4, 8, 16, 32}) {
    cases.push_back({1632, 1224, seventeen()});
    cases.back().options.steps = steps;
  }
  for (Case& one : cases) one.peak = peak_mib(one.width, one.height, one.options);
  for (const Case& one : cases) {
    const Wall wall(one.width, one.height, one.options);
    const Times times = best_of(wall, 2);
    std::printf("%-28s %8zu %10.3f %10.3f %12.0f\n", fmt::format("{:.2f} Mpx", 1e-6 * one.width * one.height).c_str(),
                wall.sequence.patterns.size(), times.all_s, times.cpu_s, one.peak);
  }
}

/// OpenCV reads the Gray code of both directions and makes a disparity map; we read the same images and four fringe images of each direction,
/// too, and make depths.
void against_opencv() {
  scan::PatternOptions options;
  options.width_px = 1024;
  options.height_px = 768;
  options.steps = 4;
  options.periods_px = {2.0 * 3.0};
  options.repeat = false;
  const int width = 2048;
  const int height = 1536;
  const Wall wall(width, height, options);
  const auto images = all_images(wall);
  double ours = 1e30;
  for (int run = 0; run < 3; ++run) {
    auto copy = images;
    const auto after_copy = std::chrono::steady_clock::now();
    const auto maps = decode(wall, [&](std::size_t camera, std::size_t i) { return std::move(copy[camera][i]); });
    const auto depths = scan::match(maps[0], maps[1], wall.head, {});
    ours = std::min(ours, seconds_since(after_copy));
    if (!depths) return;
  }
  // OpenCV's own patterns in its order: columns' bits with their inverses, then rows'.
  auto pattern = cv::structured_light::GrayCodePattern::create(options.width_px, options.height_px);
  pattern->setBlackThreshold(5);
  pattern->setWhiteThreshold(5);
  std::vector<cv::Mat> shown;
  pattern->generate(shown);
  std::vector<std::vector<cv::Mat>> captured(2);
  std::vector<cv::Mat> black(2), white(2);
  for (int camera = 0; camera < 2; ++camera) {
    const auto as_mat = [&](std::size_t i) {
      const Image& image = images[static_cast<std::size_t>(camera)][i];
      cv::Mat mat(height, width, CV_8U);
      for (int y = 0; y < height; ++y) std::copy_n(image.view().row<std::uint8_t>(y), width, mat.ptr<std::uint8_t>(y));
      return mat;
    };
    // As many images as it wants; where its code has more bits than ours, ours are given again: the same work for it.
    std::vector<std::size_t> gray;
    for (std::size_t i = 0; i < wall.sequence.patterns.size(); ++i) {
      const PatternKind kind = wall.sequence.patterns[i].kind;
      if (kind == PatternKind::kGray || kind == PatternKind::kGrayInverse) gray.push_back(i);
      if (kind == PatternKind::kWhite) white[static_cast<std::size_t>(camera)] = as_mat(i);
      if (kind == PatternKind::kBlack) black[static_cast<std::size_t>(camera)] = as_mat(i);
    }
    for (std::size_t i = 0; i < shown.size(); ++i)
      captured[static_cast<std::size_t>(camera)].push_back(as_mat(gray[i % gray.size()]));
  }
  double theirs = 1e30;
  for (int run = 0; run < 2; ++run) {
    cv::Mat disparity;
    const auto start = std::chrono::steady_clock::now();
    pattern->decode(captured, disparity, black, white, cv::structured_light::DECODE_3D_UNDERWORLD);
    theirs = std::min(theirs, seconds_since(start));
  }
  print_row(
      fmt::format("decode and match 2 x {} (theirs {}) of 3 Mpx [s]", wall.sequence.patterns.size(), shown.size() + 2).c_str(),
      ours, theirs);
}

}  // namespace
}  // namespace crosstie::bench

/// bench_scan [bars] [opencv] [growth]: these parts, else all.
int main(int argc, char** argv) {
  using namespace crosstie::bench;
  const std::vector<std::string> parts(argv + 1, argv + argc);
  const auto wanted = [&](const char* part) {
    return parts.empty() || std::find(parts.begin(), parts.end(), part) != parts.end();
  };
  print_heading("the bar, or OpenCV structured_light");
  if (wanted("growth")) growth();  // before the others, which leave memory behind
  if (wanted("bars")) against_bars();
  if (wanted("opencv")) against_opencv();
  return 0;
}
