// The calibration against mrcal's and OpenCV's: the same corners of a board that is not plane, the same lens model. The board's shape
// is drawn from its prior, and the corners have noise.
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>

#include "calib/calibrate.h"
#include "tests/bench/table.h"
#include "tests/calib/true_boards.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::bench {
namespace {

constexpr int kRuns = 3;

[[noreturn]] void give_up(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(1);
}

tests::TrueScene scene(bool two_cameras) {
  base::Board board{.columns = 24, .rows = 17, .pitch_mm = 25.0};
  board.prior = {0.05, 0.15, 200.0};
  return tests::make_scene(board, {.stations = 28, .two_cameras = two_cameras});
}

double wall_ms(const std::function<void()>& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

double best_of(const std::function<void()>& work) {
  double best = 1e300;
  for (int run = 0; run < kRuns; ++run) best = std::min(best, wall_ms(work));
  return best;
}

void our_solve(const tests::TrueScene& truth, double& focal_px) {
  const auto result = calib::calibrate(truth.views, {.lens = base::LensModel::kOpenCv5, .cross_validate = false});
  if (!result) give_up(result.error().message);
  focal_px = result->cameras[0].camera.focal_px().x();
}

/// Corners as mrcal reads them: every image has a line for each corner of the board.
std::string vnl_of(const tests::TrueScene& truth) {
  std::string text = "# filename x y level\n";
  for (const auto& image : truth.views.images) {
    std::vector<std::string> lines(static_cast<std::size_t>(truth.board.count()), image.image + ".png - - -\n");
    for (const auto& corner : image.corners) {
      lines[static_cast<std::size_t>(corner.index)] =
          fmt::format("{}.png {:.6f} {:.6f} 0\n", image.image, corner.px.x(), corner.px.y());
    }
    for (const auto& line : lines) text += line;
  }
  return text;
}

void against_mrcal() {
  print_heading("mrcal-calibrate-cameras (whole program), wall clock ms");
  if (std::system("command -v mrcal-calibrate-cameras >/dev/null 2>&1") != 0) {
    std::printf("mrcal's tools are not installed: not compared\n");
    return;
  }
  const tests::TrueScene truth = scene(true);
  const tests::TemporaryFolder folder;
  const auto corners = folder.write("corners.vnl", vnl_of(truth));
  const auto& camera = truth.cameras[0];
  const std::string command = fmt::format(
      "cd '{}' && timeout 300 mrcal-calibrate-cameras --corners-cache corners.vnl --lensmodel LENSMODEL_OPENCV5 --focal {} "
      "--imagersize {} {} --object-spacing 0.025 --object-width-n 24 --object-height-n 17 'left*.png' 'right*.png' >out.txt "
      "2>&1",
      folder.path().string(), camera.lens[0], camera.width, camera.height);
  double peer = 1e300;
  for (int run = 0; run < kRuns; ++run) {
    int status = 0;
    peer = std::min(peer, wall_ms([&] { status = std::system(command.c_str()); }));
    if (status != 0) give_up("mrcal-calibrate-cameras failed:\n" + tests::read_all(folder / "out.txt"));
  }
  double focal_px = 0.0;
  print_row("28 pairs of 24 x 17 corners, jointly", best_of([&] { our_solve(truth, focal_px); }), peer);
  std::printf("  ours: fx left %.3f px (true %.3f)\n", focal_px, camera.lens[0]);
}

void against_opencv() {
  print_heading("cv::calibrateCameraRO (one thread for ours), wall clock ms");
  const tests::TrueScene truth = scene(false);
  const Eigen::Matrix3Xd nominal = truth.board.nominal_points();
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const auto& image : truth.views.images) {
    if (static_cast<int>(image.corners.size()) != truth.board.count()) continue;  // it wants whole boards
    auto& of_image = pixels.emplace_back();
    for (const auto& corner : image.corners) {
      of_image.emplace_back(static_cast<float>(corner.px.x()), static_cast<float>(corner.px.y()));
    }
  }
  std::vector<cv::Point3f> object;
  for (Eigen::Index i = 0; i < nominal.cols(); ++i) {
    object.emplace_back(static_cast<float>(nominal(0, i)), static_cast<float>(nominal(1, i)), 0.0F);
  }
  const std::vector<std::vector<cv::Point3f>> objects(pixels.size(), object);
  cv::Mat matrix;
  const double peer = wall_ms([&] {  // once: it takes minutes
    matrix = cv::Mat();
    cv::Mat distortion;
    std::vector<cv::Mat> rotations;
    std::vector<cv::Mat> translations;
    cv::Mat points;
    cv::calibrateCameraRO(objects, pixels, cv::Size(truth.cameras[0].width, truth.cameras[0].height), truth.board.columns - 1,
                          matrix, distortion, rotations, translations, points);
  });
  tests::TrueScene whole = truth;
  std::erase_if(whole.views.images,
                [&](const auto& image) { return static_cast<int>(image.corners.size()) != truth.board.count(); });
  double focal_px = 0.0;
  print_row(fmt::format("{} images of 24 x 17 corners, free board", pixels.size()).c_str(),
            best_of([&] { our_solve(whole, focal_px); }), peer);
  std::printf("  fx: ours %.3f px, OpenCV %.3f px (true %.3f)\n", focal_px, matrix.at<double>(0, 0), truth.cameras[0].lens[0]);
}

}  // namespace
}  // namespace crosstie::bench

int main() {
  crosstie::bench::against_mrcal();
  crosstie::bench::against_opencv();
}
