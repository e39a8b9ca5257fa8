// The detector and decoder of markers. An input is a family, a width and a number of bits per pixel, one byte each, and pixels.
#include <algorithm>
#include <string>

#include <Eigen/LU>

#include "base/image.h"
#include "markers/detect.h"
#include "markers/family.h"
#include "tests/fuzz/input.h"

namespace {

using namespace crosstie;

const markers::MarkerFamily& family(std::size_t choice) {
  static const std::vector<markers::MarkerFamily> all = [] {
    std::vector<markers::MarkerFamily> made;
    for (const char* name : {"ring10", "aicon12", "agisoft16", "apriltag:tag36h11", "apriltag:tag16h5"})
      made.push_back(*markers::marker_family(name));
    return made;
  }();
  return all[choice % all.size()];
}

void check(const base::ImageObservations& found, const markers::MarkerFamily& of, int width, int height) {
  for (const auto& one : found.observations) {
    fuzz::expect(one.centre_px.allFinite() && one.cov_px2.allFinite(), "centres and covariances are finite");
    fuzz::expect(one.centre_px.minCoeff() > -0.5 && one.centre_px.x() < width - 0.5 && one.centre_px.y() < height - 0.5,
                 "centres lie in the image");
    fuzz::expect(one.cov_px2(0, 0) > 0.0 && one.cov_px2.determinant() > 0.0, "covariances are positive definite");
    if (one.status == base::ObservationStatus::kCoded) fuzz::expect(of.code_of(one.id).has_value(), "ids are of the family");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 3 + 64) return 0;
  const auto& of = family(data[0]);
  const int width = 8 + data[1] % 120;
  const int bits = data[2] % 2 == 0 ? 8 : 16;
  const auto pixels = fuzz::text_of(data, size).substr(3);
  const std::size_t row_bytes = static_cast<std::size_t>(width * bits / 8);
  const int height = static_cast<int>(pixels.size() / row_bytes);
  if (height < 8) return 0;
  base::Image image(width, height, bits);
  for (int y = 0; y < height; ++y) {
    const auto row = pixels.substr(static_cast<std::size_t>(y) * row_bytes, row_bytes);
    std::copy(row.begin(), row.end(),
              reinterpret_cast<char*>(image.row<std::uint8_t>(0)) + static_cast<std::size_t>(y) * row_bytes);
  }
  const auto found = markers::detect(image.view(), of);
  if (fuzz::sensible(found)) check(*found, of, width, height);
  return 0;
}
