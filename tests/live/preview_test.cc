#include "live/preview.h"

#include <array>
#include <cstdint>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "fixtures/render.h"
#include "fixtures/scene.h"
#include "live/focus.h"
#include "markers/detect.h"
#include "markers/overlay.h"

namespace crosstie::live {
namespace {

/// The twin's cross as the left camera sees it, and the blur that it was rendered with.
struct Twin {
  markers::MarkerFamily family;
  devices::Frame frame;
  double blur_px = 0.0;
};

const Twin& twin() {
  static const Twin kTwin = [] {
    fixtures::Scene scene = fixtures::drawn(*fixtures::make_scene("segment"), 1);
    for (std::size_t v = 0; v < scene.views.size(); ++v) {
      if (scene.views[v].purpose != fixtures::Purpose::kStation) continue;
      const double lens_px = scene.cameras[static_cast<std::size_t>(scene.views[v].camera)].optics.blur_sigma_px;
      devices::Frame frame{{.id = 41, .device_time = {}, .host_time = {}}, *fixtures::render(scene, v, 3, 2), {}};
      return Twin{scene.family, std::move(frame), std::sqrt(lens_px * lens_px + 1.0 / 12.0)};
    }
    return Twin{};
  }();
  return kTwin;
}

/// By OpenCV's decoder: blue, green, red.
cv::Mat decoded(const std::string& jpeg) {
  return cv::imdecode(std::vector<unsigned char>(jpeg.begin(), jpeg.end()), cv::IMREAD_COLOR);
}

TEST(Preview, ShowsWhatTheDetectorFinds) {
  const auto picture = preview(twin().frame, {.family = twin().family});
  ASSERT_TRUE(picture) << picture.error().message;
  const auto found = markers::detect(twin().frame.image.view(), twin().family);
  ASSERT_GE(found->observations.size(), 20u);
  ASSERT_EQ(picture->observations.observations.size(), found->observations.size());
  for (std::size_t i = 0; i < found->observations.size(); ++i) {
    EXPECT_EQ(picture->observations.observations[i].id, found->observations[i].id);
    EXPECT_EQ(picture->observations.observations[i].centre_px, found->observations[i].centre_px);
  }
  EXPECT_EQ(picture->header.id, 41u);
  ASSERT_TRUE(picture->blur_px);
  EXPECT_NEAR(*picture->blur_px, twin().blur_px, 0.04);
  EXPECT_EQ(picture->focus, focus_number(twin().frame.image.view()));
  EXPECT_EQ(picture->saturated, found->saturated_fraction);
  EXPECT_EQ(picture->dark, found->dark_fraction);
  EXPECT_NEAR(std::accumulate(picture->histogram.begin(), picture->histogram.end(), 0.0), 1.0, 1e-5);
}

TEST(Preview, ThePictureIsTheOverlay) {
  const auto picture = preview(twin().frame, {.family = twin().family, .jpeg_quality = 95});
  ASSERT_TRUE(picture);
  const cv::Mat shown = decoded(picture->jpeg);
  ASSERT_EQ(shown.cols, twin().frame.image.width());
  ASSERT_EQ(shown.rows, twin().frame.image.height());
  const base::ColourImage drawn = markers::overlay(twin().frame.image.view(), picture->observations);
  double sum = 0.0;
  for (int y = 0; y < shown.rows; ++y) {
    for (int x = 0; x < shown.cols; ++x) {
      const auto at = 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(shown.cols) + static_cast<std::size_t>(x));
      for (int c = 0; c < 3; ++c) {
        const double difference =
            shown.at<cv::Vec3b>(y, x)[2 - c] - static_cast<double>(drawn.rgb[at + static_cast<std::size_t>(c)]);
        sum += difference * difference;
      }
    }
  }
  EXPECT_LT(std::sqrt(sum / (3.0 * static_cast<double>(shown.total()))), 4.0) << "grey levels, by the compression";
}

TEST(Preview, TooBrightIsRedAndTooDarkIsBlue) {
  for (const int bits : {8, 16}) {
    base::Image image(64, 48, bits);
    image.set_white_level(bits == 8 ? 255.0 : 4095.0);
    for (int y = 0; y < 48; ++y) {
      for (int x = 0; x < 64; ++x) {
        const double share = x < 16 ? 0.0 : x < 32 ? 1.0 : 0.5;
        if (bits == 8) {
          image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(255.0 * share);
        } else {
          image.row<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(4095.0 * share);
        }
      }
    }
    const auto picture = preview({{}, std::move(image), {}});
    ASSERT_TRUE(picture) << picture.error().message;
    EXPECT_EQ(picture->dark, 0.25);
    EXPECT_EQ(picture->saturated, 0.25);
    EXPECT_FLOAT_EQ(picture->histogram[0], 0.25F);
    EXPECT_FLOAT_EQ(picture->histogram[63], 0.25F);
    EXPECT_FLOAT_EQ(picture->histogram[31], 0.5F);
    EXPECT_FALSE(picture->blur_px);
    const cv::Mat shown = decoded(picture->jpeg);
    const cv::Vec3b dark = shown.at<cv::Vec3b>(24, 6), bright = shown.at<cv::Vec3b>(24, 24), grey = shown.at<cv::Vec3b>(24, 50);
    EXPECT_GT(dark[0], 120) << bits;
    EXPECT_LT(dark[2], 30) << bits;
    EXPECT_GT(bright[2], 225) << bits;
    EXPECT_LT(bright[0], 30) << bits;
    EXPECT_NEAR(grey[0], 127, 4) << bits;
    EXPECT_NEAR(grey[2], 127, 4) << bits;
  }
}

TEST(Preview, Refuses) {
  EXPECT_EQ(preview({}).error().code, base::ErrorCode::kBadInput);
  const devices::Frame frame{{}, base::Image(64, 48, 8), {}};
  EXPECT_EQ(preview(frame, {.jpeg_quality = 0}).error().code, base::ErrorCode::kUsage);
  EXPECT_EQ(preview(frame, {.detect = {.dark_level = 2.0}}).error().code, base::ErrorCode::kUsage);
}

}  // namespace
}  // namespace crosstie::live
