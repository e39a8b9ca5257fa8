// Patterns as a projector shows them, read back by decoding them as if a camera saw each projector pixel in one of its own.
#include "scan/patterns.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scan/decode.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::scan {
namespace {

/// Every projector pixel's coordinate from the patterns themselves, and the largest difference from the right one [periods].
double largest_error(const PatternOptions& options) {
  const auto sequence = make_patterns(options);
  EXPECT_TRUE(sequence) << sequence.error().message;
  if (!sequence) return 1e9;
  DecodeOptions how;
  how.noise = base::GreyNoise{0.3, 0.0};  // of rounding to whole levels, twice
  how.correct_ripple = false;
  how.max_residual_ratio = 0.0;
  how.max_movement_px = 0.0;  // rounding is no noise
  auto decoder = Decoder::make(*sequence, options.width_px, options.height_px, how);
  for (std::size_t i = 0; i < sequence->patterns.size(); ++i) {
    base::Image image = render_pattern(options, *sequence, sequence->patterns[i]);
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) {  // a projector with gamma, and a camera that it does not saturate
        std::uint8_t& grey = image.row<std::uint8_t>(y)[x];
        grey = static_cast<std::uint8_t>(std::lround(20.0 + 200.0 * std::pow(grey / 255.0, options.gamma)));
      }
    }
    EXPECT_TRUE(decoder->add(static_cast<int>(i), std::move(image)));
  }
  const auto map = decoder->finish();
  EXPECT_TRUE(map) << map.error().message;
  if (!map) return 1e9;
  double largest = 0.0;
  for (const auto axis : {base::ProjectorAxis::kX, base::ProjectorAxis::kY}) {
    const base::PhasePlane* plane = map->plane(axis);
    if (plane == nullptr) continue;
    for (int y = 0; y < options.height_px; ++y) {
      for (int x = 0; x < options.width_px; ++x) {
        const double at = axis == base::ProjectorAxis::kX ? (x + 0.5) / options.width_px : (y + 0.5) / options.height_px;
        const double error = std::abs(static_cast<double>(plane->turns[map->at(x, y)]) - at * plane->fringes);
        largest = std::max(largest, std::isnan(error) ? 1e9 : error);
      }
    }
  }
  return largest;
}

TEST(Patterns, EveryProjectorPixelReadsItsOwnCoordinate) {
  PatternOptions options;
  options.width_px = 200;
  options.height_px = 130;
  for (const double period : {13.0, 16.0, 32.0, 200.0}) {
    for (const int steps : {4, 5, 8}) {
      for (const bool complementary : {false, true}) {
        options.periods_px = {period};
        options.steps = steps;
        options.complementary = complementary;
        EXPECT_LT(largest_error(options), 0.01) << period << " " << steps << " " << complementary;
      }
    }
  }
}

TEST(Patterns, SeveralSetsTellTheFringesTogether) {
  PatternOptions options;
  options.width_px = 400;
  options.height_px = 130;
  options.y = false;
  options.periods_px = {16.0, 17.0, 20.5};
  options.steps = 5;
  EXPECT_LT(largest_error(options), 0.01);
}

TEST(Patterns, GammaIsPrecompensated) {
  PatternOptions options;
  options.width_px = 320;
  options.height_px = 40;
  options.y = false;
  options.steps = 4;
  options.gamma = 2.2;
  EXPECT_LT(largest_error(options), 0.01);
}

TEST(Patterns, ManifestReadsBack) {
  PatternOptions options;
  options.width_px = 1024;
  options.height_px = 768;
  options.exposures = {1.0, 4.0};
  const auto sequence = make_patterns(options);
  ASSERT_TRUE(sequence);
  // white, black and the first fringes twice; x: 32 fringes, 64 words; y: 24 fringes, 48 words; each bit with its inverse; 8 steps at two exposures
  EXPECT_EQ(sequence->patterns.size(), 6U + 2 * 6 + 16 + 2 * 6 + 16);
  const tests::TemporaryFolder folder;
  ASSERT_TRUE(base::write_pattern_manifest(folder / "patterns.json", *sequence));
  const auto again = base::read_pattern_manifest(folder / "patterns.json");
  ASSERT_TRUE(again) << again.error().message;
  ASSERT_EQ(again->patterns.size(), sequence->patterns.size());
  for (std::size_t i = 0; i < sequence->patterns.size(); ++i) {
    const base::Pattern& a = sequence->patterns[i];
    const base::Pattern& b = again->patterns[i];
    EXPECT_EQ(a.kind, b.kind);
    EXPECT_EQ(a.axis, b.axis);
    EXPECT_EQ(a.bit, b.bit);
    EXPECT_EQ(a.shift, b.shift);
    EXPECT_EQ(a.exposure, b.exposure);
    EXPECT_EQ(a.files, b.files);
    EXPECT_EQ(a.repeat, b.repeat);
  }
  EXPECT_EQ(again->x.fringes, sequence->x.fringes);
  EXPECT_EQ(again->y.gray_bits, 6);
  EXPECT_EQ(again->x.word_offset, 0.0);
}

TEST(Patterns, WhatNoProjectorCouldShowIsRefused) {
  PatternOptions options;
  options.width_px = 1024;
  options.height_px = 768;
  const auto message = [&] {
    const auto made = make_patterns(options);
    return made ? std::string() : made.error().message;
  };
  EXPECT_EQ(message(), "");
  options.steps = 2;
  EXPECT_THAT(message(), testing::HasSubstr("2 steps"));
  options.steps = 8;
  options.periods_px = {1.0};
  EXPECT_THAT(message(), testing::HasSubstr("a period of 1 px"));
  options.periods_px = {16.0};
  options.x = options.y = false;
  EXPECT_THAT(message(), testing::HasSubstr("neither direction"));
  options.x = true;
  options.width_px = 0;
  EXPECT_THAT(message(), testing::HasSubstr("0 x 768"));
}

}  // namespace
}  // namespace crosstie::scan
