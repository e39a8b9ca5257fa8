// YAML: one camera by OpenCV or ROS, chains of kalibr, pairs by OpenCV's stereo calibration. The first byte of an input chooses the reader.
#include "base/camera_file.h"
#include "base/kalibr.h"
#include "base/opencv_stereo.h"
#include "tests/fuzz/input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace crosstie;
  std::string_view input = fuzz::text_of(data, size);
  const std::size_t reader = fuzz::choose(input, 3);
  const auto path = fuzz::file("cameras.yaml", input);
  if (reader == 0) {
    fuzz::sensible(base::read_camera(path));
  } else if (reader == 1) {
    fuzz::sensible(base::read_kalibr_chain(path));
  } else {
    fuzz::sensible(base::read_opencv_stereo(path, path, 640, 480));
  }
  return 0;
}
