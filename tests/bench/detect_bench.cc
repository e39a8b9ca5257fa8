// Detection on real photographs, already decoded, on one thread: markers::detect against libapriltag (tag36h11, decimate 1).
// Both look at every pixel for shapes that they then measure; the photographs hold coded rings and no tags.

#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>

extern "C" {
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
}

#include "markers/detect.h"
#include "tests/bench/table.h"
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

}  // namespace
}  // namespace crosstie::bench

int main() {
  using namespace crosstie::bench;
  print_heading("libapriltag, tag36h11, decimate 1, one thread");
  compare("detect aicon-panel", images_in(crosstie::tests::measured_data("aicon-panel"), ".tif", ""));
  compare("detect htw-photo", images_in(crosstie::tests::measured_data("htw-photo"), ".jpg", "test_data_example"));
  return 0;
}
