#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/observation.h"
#include "base/result.h"
#include "devices/frame.h"
#include "markers/detect.h"

namespace crosstie::live {

/// What is shown of a frame.
struct PreviewOptions {
  /// Markers that are looked for; nothing: none are.
  std::optional<markers::MarkerFamily> family = {};
  /// How, and which levels are painted red and blue.
  markers::DetectOptions detect = {};
  /// [-] libjpeg's quality of the picture, 1 to 100. Default: 80, where outlines of one pixel stay clear at 1.5 bits a pixel or less.
  int jpeg_quality = 80;

  /// Error kUsage with the name of the member that is out of its domain.
  [[nodiscard]] base::Result<> validate() const;
};

/// How long the steps of one picture took [ms].
struct PreviewMillis {
  double detect = 0.0;
  double judge = 0.0;  ///< histogram, shares, focus
  double draw = 0.0;
  double encode = 0.0;
};

/// One frame of one camera as the operator sees it.
struct CameraPicture {
  devices::FrameHeader header;
  int width_px = 0;
  int height_px = 0;
  std::string jpeg;                   ///< a JPEG file; see preview()
  std::array<float, 64> histogram{};  ///< shares of the pixels in equal bins from 0 to the white level
  double saturated = 0.0;             ///< share of the pixels at or above DetectOptions::saturated_level
  double dark = 0.0;                  ///< at or below DetectOptions::dark_level
  std::optional<double> focus;        ///< focus_number(); nothing where no edge tells it
  std::optional<double>
      blur_px;  ///< median of the read markers' edges: standard deviation, lens and pixel; nothing without any
  base::ImageObservations observations;  ///< without names of image and camera
  double latency_ms = 0.0;               ///< from FrameHeader::host_time to the picture's publication; set by PreviewLoop
  PreviewMillis millis;
};

/// Judges and draws one frame: saturated pixels red, dark ones blue, markers outlined with their ids (coded green, uncoded cyan, doubtful
/// yellow; markers::overlay), as a JPEG. The marker observations are those of markers::detect, as they are in a measurement.
/// Pure; safe to call from several threads. Errors: those of PreviewOptions::validate() and markers::detect(); kBadInput for no image.
[[nodiscard]] base::Result<CameraPicture> preview(const devices::Frame& frame, const PreviewOptions& options = {});

}  // namespace crosstie::live
