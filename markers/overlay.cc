#include "markers/overlay.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <string>
#include <vector>

#include <opencv2/imgproc.hpp>

namespace crosstie::markers {
namespace {

constexpr std::array<std::uint8_t, 3> kOverExposed = {255, 0, 0};
constexpr std::array<std::uint8_t, 3> kUnderExposed = {0, 0, 160};
constexpr int kSubPixelBits = 4;

using Colour = std::array<std::uint8_t, 3>;

/// The colour of every grey level.
template <typename Sample>
std::vector<Colour> colours_of_levels(double white_level, const OverlayOptions& options) {
  const double high = options.saturated_level * white_level;
  const double low = options.dark_level * white_level;
  const double scale = 255.0 / white_level;
  std::vector<Colour> colours(std::size_t{1} << (8 * sizeof(Sample)));
  for (std::size_t level = 0; level < colours.size(); ++level) {
    const auto grey = static_cast<double>(level);
    if (grey >= high) {
      colours[level] = kOverExposed;
    } else if (grey <= low) {
      colours[level] = kUnderExposed;
    } else {
      colours[level].fill(static_cast<std::uint8_t>(std::min(255.0, grey * scale)));
    }
  }
  return colours;
}

template <typename Sample>
void paint_levels(const base::ImageView& image, const OverlayOptions& options, base::ColourImage& picture) {
  const std::vector<Colour> colours = colours_of_levels<Sample>(image.white_level, options);
  std::uint8_t* out = picture.rgb.data();
  for (int y = 0; y < image.height; ++y) {
    const Sample* row = image.row<Sample>(y);
    for (int x = 0; x < image.width; ++x, out += 3) {
      const Colour& colour = colours[row[x]];
      out[0] = colour[0];
      out[1] = colour[1];
      out[2] = colour[2];
    }
  }
}

cv::Scalar colour_of(base::ObservationStatus status) {
  switch (status) {
    case base::ObservationStatus::kCoded:
      return {0, 255, 0};
    case base::ObservationStatus::kUncoded:
      return {0, 255, 255};
    default:
      return {255, 255, 0};
  }
}

cv::Point fixed_point(double x, double y) {
  constexpr double kScale = 1 << kSubPixelBits;
  return {static_cast<int>(std::lround(x * kScale)), static_cast<int>(std::lround(y * kScale))};
}

void draw(const base::Observation& observation, cv::Mat& canvas) {
  const cv::Scalar colour = colour_of(observation.status);
  const double x = observation.centre_px.x();
  const double y = observation.centre_px.y();
  const int thickness = observation.semi_major_px > 40.0 ? 2 : 1;
  constexpr double kScale = 1 << kSubPixelBits;
  // A tag has no ellipse; its cross marks it.
  if (observation.semi_major_px > 0.0)
    cv::ellipse(canvas, fixed_point(x, y),
                cv::Size(static_cast<int>(std::lround(observation.semi_major_px * kScale)),
                         static_cast<int>(std::lround(observation.semi_minor_px * kScale))),
                observation.angle_rad * 180.0 / std::numbers::pi, 0.0, 360.0, colour, thickness, cv::LINE_AA, kSubPixelBits);
  const double arm = observation.semi_minor_px > 0.0 ? std::clamp(0.3 * observation.semi_minor_px, 2.0, 12.0) : 8.0;
  cv::line(canvas, fixed_point(x - arm, y), fixed_point(x + arm, y), colour, 1, cv::LINE_AA, kSubPixelBits);
  cv::line(canvas, fixed_point(x, y - arm), fixed_point(x, y + arm), colour, 1, cv::LINE_AA, kSubPixelBits);
  if (observation.id == base::kNoId) return;
  const std::string text = std::to_string(observation.id);
  const double size = std::clamp(observation.semi_major_px / 16.0, 0.5, 2.0);
  const cv::Point at(static_cast<int>(x + std::max(1.3 * observation.semi_major_px, arm)) + 1,
                     static_cast<int>(y + 8.0 * size));
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, size, {0, 0, 0}, 3, cv::LINE_AA);
  cv::putText(canvas, text, at, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
}

}  // namespace

base::ColourImage overlay(const base::ImageView& image, const base::ImageObservations& observations,
                          const OverlayOptions& options) {
  base::ColourImage picture;
  picture.width = image.width;
  picture.height = image.height;
  picture.rgb.resize(3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  if (image.bits == 8) {
    paint_levels<std::uint8_t>(image, options, picture);
  } else {
    paint_levels<std::uint16_t>(image, options, picture);
  }
  cv::Mat canvas(picture.height, picture.width, CV_8UC3, picture.rgb.data());
  for (const base::Observation& observation : observations.observations) draw(observation, canvas);
  return picture;
}

}  // namespace crosstie::markers
