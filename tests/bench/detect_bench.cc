// Detection, of images already decoded, on one thread: on real photographs markers::detect against libapriltag (tag36h11, decimate 1), where both
// look at every pixel for shapes that they then measure (the photographs hold coded rings and no tags); on rendered tags against libapriltag and
// OpenCV's aruco, and on a rendered grid of dots against findCirclesGrid, time and errors of the centres. Errors of dots also against the
// Cramer-Rao bound of their noise.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}

#include "markers/detect.h"
#include "tests/bench/table.h"
#include "tests/markers/cramer_rao.h"
#include "tests/support/measured_data.h"

namespace crosstie::bench {
namespace {

namespace fs = std::filesystem;
constexpr int kRuns = 7;

std::vector<base::Image> images_in(const fs::path& folder, const std::string& extension, const std::string& starts_with) {
  std::vector<base::Image> images;
  if (folder.empty()) return images;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != extension || !entry.path().filename().string().starts_with(starts_with)) continue;
    if (auto image = base::read_image(entry.path()); image && image->bits() == 8) images.push_back(std::move(*image));
  }
  return images;
}

class AprilTag {
 public:
  AprilTag() : family_(tag36h11_create()), detector_(apriltag_detector_create()) {
    apriltag_detector_add_family(detector_, family_);
    detector_->quad_decimate = 1.0F;
    detector_->nthreads = 1;
  }
  AprilTag(const AprilTag&) = delete;
  AprilTag& operator=(const AprilTag&) = delete;
  ~AprilTag() {
    apriltag_detector_destroy(detector_);
    tag36h11_destroy(family_);
  }

  double millis(base::Image& image) const {
    image_u8_t view{image.width(), image.height(), image.width(), image.row<std::uint8_t>(0)};
    return millis_of([&] { apriltag_detections_destroy(apriltag_detector_detect(detector_, &view)); });
  }

  /// Of all tags; the library counts from the image's corner.
  std::vector<Eigen::Vector2d> centres(base::Image& image) const {
    image_u8_t view{image.width(), image.height(), image.width(), image.row<std::uint8_t>(0)};
    zarray_t* found = apriltag_detector_detect(detector_, &view);
    std::vector<Eigen::Vector2d> centres;
    for (int i = 0; i < zarray_size(found); ++i) {
      apriltag_detection_t* one = nullptr;
      zarray_get(found, i, static_cast<void*>(&one));
      centres.emplace_back(one->c[0] - 0.5, one->c[1] - 0.5);
    }
    apriltag_detections_destroy(found);
    return centres;
  }

 private:
  apriltag_family_t* family_;
  apriltag_detector_t* detector_;
};

void compare(const char* what, std::vector<base::Image> images) {
  if (images.empty()) {
    std::printf("%-44s skipped: no such photographs in CROSSTIE_DATA\n", what);
    return;
  }
  const markers::MarkerFamily family = *markers::marker_family("aicon14");
  const AprilTag april_tag;
  double ours = 0.0, peer = 0.0, megapixels = 0.0;
  for (base::Image& image : images) {
    std::vector<double> our_runs, peer_runs;
    for (int run = 0; run < kRuns; ++run) {
      our_runs.push_back(millis_of([&] { (void)markers::detect(image.view(), family); }));
      peer_runs.push_back(april_tag.millis(image));
    }
    ours += median_of(our_runs);
    peer += median_of(peer_runs);
    megapixels += 1e-6 * image.width() * image.height();
  }
  print_row(fmt::format("{}, {} images [ms/Mpx]", what, images.size()).c_str(), ours / megapixels, peer / megapixels);
}

/// Rendered markers side by side, each in a tile of its own, with what each truly shows.
struct Sheet {
  base::Image image;
  std::vector<Eigen::Vector2d> centres;
};

Sheet sheet_of(tests::MarkerScene scene, int columns, int rows, double noise, bool scattered) {
  Sheet sheet;
  const int size = scene.width_px;
  std::vector<double> levels(static_cast<std::size_t>(size) * static_cast<std::size_t>(size) *
                             static_cast<std::size_t>(columns * rows));
  for (int k = 0; k < columns * rows; ++k) {
    if (scattered) {
      scene.centre_px = {0.5 * size + 0.37 * std::sin(7.0 * k), 0.5 * size + 0.41 * std::cos(5.0 * k)};
      scene.roll_rad = 0.5 * k;
      scene.code = scene.family.codes.empty() ? 0 : scene.family.codes.at(static_cast<std::size_t>(k)).code;
    }
    const std::vector<double> tile = tests::rendered(scene);
    const int x0 = size * (k % columns), y0 = size * (k / columns);
    for (int y = 0; y < size; ++y) std::copy_n(tile.begin() + y * size, size, levels.begin() + (y0 + y) * size * columns + x0);
    sheet.centres.push_back(scene.centre_px + Eigen::Vector2d(x0, y0));
  }
  sheet.image = tests::photograph(levels, size * columns, size * rows, {noise, 1});
  return sheet;
}

/// Root mean square of the distances from the nearest true centre; more than 2 px off is no find of it.
std::string errors_of(const std::vector<Eigen::Vector2d>& found, const Sheet& sheet, double& rms_px) {
  double squares = 0.0;
  int count = 0;
  for (const Eigen::Vector2d& centre : sheet.centres) {
    double nearest = 4.0;
    for (const Eigen::Vector2d& one : found) nearest = std::min(nearest, (one - centre).squaredNorm());
    if (nearest >= 4.0) continue;
    squares += nearest;
    ++count;
  }
  rms_px = std::sqrt(squares / std::max(1, count));
  return fmt::format("{} of {}", count, sheet.centres.size());
}

std::vector<Eigen::Vector2d> centres_in(const base::Image& image, const markers::MarkerFamily& family) {
  std::vector<Eigen::Vector2d> centres;
  const auto found = markers::detect(image.view(), family);
  if (!found) return centres;
  for (const base::Observation& one : found->observations) centres.push_back(one.centre_px);
  return centres;
}

cv::Mat mat_of(base::Image& image) { return {image.height(), image.width(), CV_8UC1, image.row<std::uint8_t>(0)}; }

template <typename Work>
double median_millis(Work&& work) {
  std::vector<double> runs;
  for (int run = 0; run < kRuns; ++run) runs.push_back(millis_of(work));
  return median_of(runs);
}

void compare_tags() {
  tests::MarkerScene scene;
  scene.family = *markers::marker_family("apriltag:tag36h11");
  scene.dark_on_bright = true;
  scene.radius_px = 6.0;
  scene.width_px = scene.height_px = 120;
  scene.samples_per_px = 5;
  Sheet sheet = sheet_of(scene, 8, 6, 2.0, true);
  const double megapixels = 1e-6 * sheet.image.width() * sheet.image.height();
  std::vector<Eigen::Vector2d> ours, theirs;
  double our_rms = 0.0, their_rms = 0.0;
  const double our_millis = median_millis([&] { ours = centres_in(sheet.image, scene.family); });
  const std::string our_count = errors_of(ours, sheet, our_rms);
  const AprilTag april_tag;
  const double april_millis = median_millis([&] { theirs = april_tag.centres(sheet.image); });
  std::string count = errors_of(theirs, sheet, their_rms);
  print_row(fmt::format("tags: libapriltag [ms/Mpx]; {}, {}", our_count, count).c_str(), our_millis / megapixels,
            april_millis / megapixels);
  print_row("    error of centres [1e-3 px]", 1e3 * our_rms, 1e3 * their_rms);
  const auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
  const double aruco_millis = median_millis([&] {
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    cv::aruco::detectMarkers(mat_of(sheet.image), dictionary, corners, ids, parameters);
    theirs.clear();
    for (const auto& c : corners) {
      // The centre is where the diagonals meet.
      const Eigen::Vector2d a(c[0].x, c[0].y), b(c[1].x, c[1].y), d(c[2].x, c[2].y), e(c[3].x, c[3].y);
      Eigen::Matrix2d m;
      m << d - a, b - e;
      const Eigen::Vector2d at = m.inverse() * (b - a);
      theirs.emplace_back(a + at.x() * (d - a));
    }
  });
  count = errors_of(theirs, sheet, their_rms);
  print_row(fmt::format("tags: OpenCV aruco, subpix [ms/Mpx]; {}", count).c_str(), our_millis / megapixels,
            aruco_millis / megapixels);
  print_row("    error of centres [1e-3 px]", 1e3 * our_rms, 1e3 * their_rms);
}

void compare_dots() {
  tests::MarkerScene scene;
  scene.family = *markers::marker_family("ring10");
  scene.coded = false;
  scene.dark_on_bright = true;
  scene.width_px = scene.height_px = 60;
  scene.centre_px = {29.81, 30.27};
  Sheet sheet = sheet_of(scene, 11, 9, 2.0, false);
  const double megapixels = 1e-6 * sheet.image.width() * sheet.image.height();
  std::vector<Eigen::Vector2d> ours, theirs;
  const double our_millis = median_millis([&] { ours = centres_in(sheet.image, scene.family); });
  const double their_millis = median_millis([&] {
    std::vector<cv::Point2f> centres;
    cv::findCirclesGrid(mat_of(sheet.image), {11, 9}, centres);
    theirs.clear();
    for (const cv::Point2f& c : centres) theirs.emplace_back(c.x, c.y);
  });
  double our_rms = 0.0, their_rms = 0.0;
  const std::string our_count = errors_of(ours, sheet, our_rms), count = errors_of(theirs, sheet, their_rms);
  print_row(fmt::format("dots: findCirclesGrid [ms/Mpx]; {}, {}", our_count, count).c_str(), our_millis / megapixels,
            their_millis / megapixels);
  print_row("    error of centres [1e-3 px]", 1e3 * our_rms, 1e3 * their_rms);
}

void against_the_bound() {
  std::printf("%-44s %10s %10s %8s   the Cramer-Rao bound of the noise (2 grey levels of 160)\n", "what", "ours", "bound",
              "ratio");
  for (const double radius_px : {5.0, 8.0, 15.0}) {
    for (const double blur_px : {0.5, 1.2}) {
      tests::MarkerScene scene;
      scene.family = *markers::marker_family("ring10");
      scene.coded = false;
      scene.radius_px = radius_px;
      scene.blur_px = blur_px;
      scene.width_px = scene.height_px = static_cast<int>(2.0 * std::ceil(2.4 * radius_px + 4.0));
      scene.centre_px = {0.5 * scene.width_px + 0.23, 0.5 * scene.height_px - 0.31};
      constexpr int kPictures = 300;
      const std::vector<double> levels = tests::rendered(scene);
      double squares = 0.0;
      int count = 0;
      for (int k = 0; k < kPictures; ++k) {
        const base::Image picture =
            tests::photograph(levels, scene.width_px, scene.height_px, {2.0, static_cast<std::uint64_t>(k + 1)});
        const auto found = markers::detect(picture.view(), scene.family);
        if (!found || found->observations.size() != 1) continue;
        squares += (found->observations[0].centre_px - scene.centre_px).squaredNorm();
        ++count;
      }
      const double bound = std::sqrt(4.0 * tests::cramer_rao_bound(scene).trace());
      print_row(fmt::format("dot r {:.0f} px, blur {:.1f} px: error [1e-3 px]", radius_px, blur_px).c_str(),
                1e3 * std::sqrt(squares / count), 1e3 * bound);
    }
  }
}

}  // namespace
}  // namespace crosstie::bench

int main() {
  using namespace crosstie::bench;
  print_heading("libapriltag, tag36h11, decimate 1, one thread");
  compare("detect aicon-panel", images_in(crosstie::tests::measured_data("aicon-panel"), ".tif", ""));
  compare("detect htw-photo", images_in(crosstie::tests::measured_data("htw-photo"), ".jpg", "test_data_example"));
  print_heading("OpenCV and libapriltag on rendered images, one thread");
  cv::setNumThreads(1);
  compare_tags();
  compare_dots();
  against_the_bound();
  return 0;
}
