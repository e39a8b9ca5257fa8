#include "live/preview.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <fmt/format.h>

#include "live/detail/jpeg.h"
#include "live/detail/levels.h"
#include "live/focus.h"
#include "markers/detection.h"
#include "markers/overlay.h"
#include "math/median.h"

namespace crosstie::live {
namespace {

/// Milliseconds since it was last asked.
class Lap {
 public:
  double operator()() {
    const auto now = std::chrono::steady_clock::now();
    return std::chrono::duration<double, std::milli>(now - std::exchange(begin_, now)).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// Of the markers that were read; of all dots where none was.
std::optional<double> blur_of(const markers::Detection& found) {
  std::vector<double> read, all;
  for (std::size_t i = 0; i < found.blur_px.size(); ++i) {
    if (!(found.blur_px[i] > 0.0)) continue;
    all.push_back(found.blur_px[i]);
    if (found.observations.observations[i].status == base::ObservationStatus::kCoded) read.push_back(found.blur_px[i]);
  }
  if (all.empty()) return std::nullopt;
  return math::median(read.empty() ? all : read);
}

}  // namespace

base::Result<> PreviewOptions::validate() const {
  if (jpeg_quality < 1 || jpeg_quality > 100) {
    return base::fail(base::ErrorCode::kUsage, fmt::format("preview: jpeg_quality is {}, not in 1..100", jpeg_quality));
  }
  return detect.validate();
}

base::Result<CameraPicture> preview(const devices::Frame& frame, const PreviewOptions& options) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  if (frame.image.empty()) return base::fail(base::ErrorCode::kBadInput, "preview: a frame without an image");
  const base::ImageView image = frame.image.view();
  CameraPicture picture;
  picture.header = frame.header;
  picture.width_px = image.width;
  picture.height_px = image.height;

  Lap lap;
  if (options.family) {
    auto found = markers::detect_in_detail(image, *options.family, options.detect);
    if (!found) return base::fail(std::move(found));
    picture.blur_px = blur_of(*found);
    picture.observations = std::move(found->observations);
  }
  picture.millis.detect = lap();

  const detail::LevelCounts levels(image);
  picture.histogram = levels.histogram();
  picture.saturated = levels.share_from(options.detect.saturated_level * image.white_level);
  picture.dark = levels.share_to(options.detect.dark_level * image.white_level);
  picture.focus = focus_number(image, options.detect.saturated_level);
  picture.millis.judge = lap();

  const base::ColourImage drawn =
      markers::overlay(image, picture.observations,
                       {.saturated_level = options.detect.saturated_level, .dark_level = options.detect.dark_level});
  picture.millis.draw = lap();

  auto jpeg = detail::encode_jpeg(drawn, options.jpeg_quality);
  if (!jpeg) return base::fail(std::move(jpeg));
  picture.jpeg = *std::move(jpeg);
  picture.millis.encode = lap();
  return picture;
}

}  // namespace crosstie::live
