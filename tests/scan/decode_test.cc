// Phases and their sigmas against what every pixel of a synthetic scan sees.
#include "scan/decode.h"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/scan/synthetic_scan.h"

namespace crosstie::scan {
namespace {

using base::PatternKind;
using base::PatternSequence;
using base::PhaseMap;
using base::PhaseStatus;
using tests::SyntheticScan;

base::Result<PhaseMap> decoded(const SyntheticScan& scene, const PatternSequence& sequence, std::uint64_t seed,
                               const DecodeOptions& options = {}, int camera = 0) {
  std::mt19937_64 random(seed);
  auto decoder = Decoder::make(sequence, scene.width, scene.height, options);
  if (!decoder) return tl::unexpected(decoder.error());
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    auto added = decoder->add(static_cast<int>(i), scene.image(camera, sequence, sequence.patterns[i], random));
    if (!added) return tl::unexpected(added.error());
  }
  return decoder->finish();
}

using Errors = tests::NormalisedErrors;

/// Of one plane.
Errors errors_of(const SyntheticScan& scene, const PhaseMap& map, base::ProjectorAxis axis, int camera = 0) {
  Errors errors;
  const base::PhasePlane& plane = *map.plane(axis);
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      const auto at = map.at(x, y);
      if (map.status[at] != PhaseStatus::kValid) continue;
      const auto seen = scene.seen(camera, x, y);
      if (!seen) {
        errors.add_far();
        continue;
      }
      const double truth = plane.fringes * (axis == base::ProjectorAxis::kX ? seen->u : seen->v);
      errors.add((static_cast<double>(plane.turns[at]) - truth) / static_cast<double>(plane.sigma_turns[at]));
    }
  }
  return errors;
}

TEST(Decode, SigmasAreTrueForEverySequence) {
  SyntheticScan scene;
  for (const int steps : {3, 4, 5, 8}) {
    for (const bool inverse : {false, true}) {
      DecodeOptions options;
      if (steps == 3) options.noise = base::GreyNoise{scene.read_sigma * scene.read_sigma + 1.0 / 12.0, scene.shot};
      const auto map = decoded(scene, tests::gray_and_fringes(24.0, steps, inverse, true), 11, options);
      ASSERT_TRUE(map) << map.error().message;
      for (const auto axis : {base::ProjectorAxis::kX, base::ProjectorAxis::kY}) {
        const Errors errors = errors_of(scene, *map, axis);
        SCOPED_TRACE(testing::Message() << steps << " steps, inverse " << inverse << ", axis " << base::axis_name(axis));
        EXPECT_GT(errors.count, 40000);
        EXPECT_EQ(errors.far, 0);
        EXPECT_NEAR(errors.rms(), 1.0, 0.03);
        EXPECT_NEAR(errors.mean(), 0.0, 0.03);
      }
    }
  }
}

TEST(Decode, NoiseOfTheCameraIsFound) {
  SyntheticScan scene;
  scene.bits = 16;
  scene.white = 4095.0;
  scene.ambient = 200.0;
  scene.amplitude = 900.0;
  scene.read_sigma = 5.0;
  scene.shot = 0.2;
  scene.albedo = [](double u, double v) { return 0.2 + 0.4 * (1.0 + std::sin(9.0 * u) * std::cos(7.0 * v)); };
  const auto map = decoded(scene, tests::gray_and_fringes(24.0, 6, false, false), 5);
  ASSERT_TRUE(map) << map.error().message;
  for (const double level : {400.0, 1000.0, 1600.0}) {
    EXPECT_NEAR(map->noise.variance(level) / (25.0 + 0.2 * level), 1.0, 0.05) << level;
  }
  EXPECT_NEAR(errors_of(scene, *map, base::ProjectorAxis::kX).rms(), 1.0, 0.03);
}

TEST(Decode, WhatIsCutOffBiasesNothing) {
  SyntheticScan scene;
  scene.albedo = [](double, double v) { return 0.8 + 0.9 * v; };  // from none to most samples saturated at their crest
  const auto map = decoded(scene, tests::gray_and_fringes(24.0, 8, false, false), 3);
  ASSERT_TRUE(map) << map.error().message;
  Errors cut;
  const auto& plane = *map->x;
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      const auto at = map->at(x, y);
      const auto seen = scene.seen(0, x, y);
      if (map->status[at] != PhaseStatus::kValid || !seen) continue;
      if (scene.albedo(0, seen->v) * (scene.ambient + 2.0 * scene.amplitude) < 260.0) continue;
      cut.add((static_cast<double>(plane.turns[at]) - plane.fringes * seen->u) / static_cast<double>(plane.sigma_turns[at]));
    }
  }
  ASSERT_GT(cut.count, 10000);
  EXPECT_LT(std::abs(cut.mean()), 0.2);
  EXPECT_EQ(cut.far, 0);
  EXPECT_NEAR(cut.rms(), 1.0, 0.1);
}

TEST(Decode, DarkPixelsAreLeftOutOrTrue) {
  SyntheticScan scene;
  scene.albedo = [](double u, double v) { return v > 0.7 ? 0.9 * u : 0.002 + 0.1 * u; };
  const auto map = decoded(scene, tests::gray_and_fringes(24.0, 8, true, false), 4);
  ASSERT_TRUE(map) << map.error().message;
  const Errors errors = errors_of(scene, *map, base::ProjectorAxis::kX);
  EXPECT_GT(errors.count, 20000);
  EXPECT_GT(map->counts[static_cast<std::size_t>(PhaseStatus::kDark)], 5000);
  EXPECT_LT(errors.far, errors.count / 10000);
  EXPECT_NEAR(errors.rms(), 1.0, 0.06);
}

TEST(Decode, SeveralSetsOfFringesReplaceTheGrayCode) {
  SyntheticScan scene;
  PatternSequence sequence;
  sequence.x.fringes = {28.0, 27.0, 23.0};
  for (int set = 0; set < 3; ++set) {
    for (int step = 0; step < 4; ++step) {
      base::Pattern pattern;
      pattern.kind = PatternKind::kFringe;
      pattern.frequency = set;
      pattern.shift = step / 4.0;
      sequence.patterns.push_back(pattern);
    }
  }
  const auto map = decoded(scene, sequence, 6);
  ASSERT_TRUE(map) << map.error().message;
  const Errors errors = errors_of(scene, *map, base::ProjectorAxis::kX);
  EXPECT_GT(errors.count, 40000);
  EXPECT_LE(errors.far, 1);
  EXPECT_NEAR(errors.rms(), 1.0, 0.03);
}

TEST(Decode, ExposuresAreFused) {
  SyntheticScan scene;
  scene.amplitude = 40.0;
  scene.ambient = 5.0;
  scene.albedo = [](double u, double) { return 0.3 + 3.0 * u * u; };
  PatternSequence sequence = tests::gray_and_fringes(24.0, 6, false, false);
  const auto one = decoded(scene, sequence, 7);
  ASSERT_TRUE(one) << one.error().message;
  const std::size_t count = sequence.patterns.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (sequence.patterns[i].kind != PatternKind::kFringe) continue;
    sequence.patterns.push_back(sequence.patterns[i]);
    sequence.patterns.back().exposure = 4.0;
  }
  const auto both = decoded(scene, sequence, 7);
  ASSERT_TRUE(both) << both.error().message;
  const Errors errors = errors_of(scene, *both, base::ProjectorAxis::kX);
  EXPECT_LT(errors.far, 10);
  EXPECT_NEAR(errors.rms(), 1.0, 0.04);
  double better = 0.0;
  for (std::size_t i = 0; i < both->status.size(); ++i) {
    if (one->status[i] == PhaseStatus::kValid && both->status[i] == PhaseStatus::kValid) {
      better = std::max(better, static_cast<double>(one->x->sigma_turns[i] / both->x->sigma_turns[i]));
    }
  }
  EXPECT_GT(better, 2.0);
}

TEST(Decode, GammaIsMeasuredAndTakenOut) {
  SyntheticScan scene;
  scene.gamma = 1.15;
  scene.bits = 16;
  scene.white = 4095.0;
  scene.ambient = 200.0;
  scene.amplitude = 1500.0;
  scene.read_sigma = 4.0;
  scene.shot = 0.0;
  const auto sequence = tests::gray_and_fringes(24.0, 4, false, false);
  DecodeOptions options;
  options.max_residual_ratio = 0.0;
  const auto corrected = decoded(scene, sequence, 8, options);
  options.correct_ripple = false;
  const auto plain = decoded(scene, sequence, 8, options);
  ASSERT_TRUE(corrected && plain);
  const auto rms = [&](const PhaseMap& map) {
    double sum = 0.0;
    int count = 0;
    for (int y = 0; y < scene.height; ++y) {
      for (int x = 0; x < scene.width; ++x) {
        const auto seen = scene.seen(0, x, y);
        if (map.status[map.at(x, y)] != PhaseStatus::kValid || !seen) continue;
        sum += std::pow(static_cast<double>(map.x->turns[map.at(x, y)]) - 24.0 * seen->u, 2);
        ++count;
      }
    }
    return std::sqrt(sum / count);
  };
  EXPECT_GT(corrected->x->ripple_turns, 1e-3);
  const double noise =
      4.0 / std::sqrt(2.0) / (2.0 * std::numbers::pi * 1500.0);  // sqrt(2 / N) sigma / (2 pi B), B a little less
  EXPECT_GT(rms(*plain), 3.0 * noise);
  EXPECT_LT(rms(*corrected), 1.1 * noise);
}

TEST(Decode, OffsetOfAForeignCodeIsFound) {
  SyntheticScan scene;
  PatternSequence shown = tests::gray_and_fringes(24.0, 4, false, false);
  shown.x.word_offset = 0.3;
  std::mt19937_64 random(9);
  PatternSequence known = shown;
  known.x.word_offset.reset();
  auto decoder = Decoder::make(known, scene.width, scene.height, {});
  ASSERT_TRUE(decoder);
  for (std::size_t i = 0; i < shown.patterns.size(); ++i) {
    ASSERT_TRUE(decoder->add(static_cast<int>(i), scene.image(0, shown, shown.patterns[i], random)));
  }
  const auto map = decoder->finish();
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_NEAR(*map->x->word_offset, 0.3, 0.05);
  EXPECT_GT(map->x->word_agreement, 0.95);
  EXPECT_EQ(errors_of(scene, *map, base::ProjectorAxis::kX).far, 0);
}

TEST(Decode, WhatDoesNotBelongTogetherIsRefused) {
  const SyntheticScan scene;
  const PatternSequence sequence = tests::gray_and_fringes(24.0, 4, false, false);
  std::mt19937_64 random(10);
  std::vector<base::Image> images;
  for (const auto& pattern : sequence.patterns) images.push_back(scene.image(0, sequence, pattern, random));
  const auto attempt = [&](const std::vector<std::size_t>& order) -> std::string {
    auto decoder = Decoder::make(sequence, scene.width, scene.height, {});
    for (std::size_t i = 0; i < order.size(); ++i) {
      if (auto added = decoder->add(static_cast<int>(i), images[order[i]]); !added) return added.error().message;
    }
    const auto map = decoder->finish();
    return map ? "" : map.error().message;
  };
  EXPECT_EQ(attempt({0, 1, 2, 3, 4, 5, 6, 7, 8, 9}), "");
  EXPECT_THAT(attempt({0, 1, 2, 3, 4, 5, 6, 7, 8}), testing::HasSubstr("image 10 of the sequence is missing"));
  EXPECT_THAT(attempt({0, 1, 2, 3, 5, 4, 6, 7, 8, 9}), testing::HasSubstr("does not agree with the fringes"));
  EXPECT_THAT(attempt({0, 1, 2, 3, 4, 5, 9, 8, 7, 6}), testing::HasSubstr("does not agree with the fringes"));
  EXPECT_THAT(attempt({0, 2, 1, 3, 4, 5, 6, 7, 8, 9}), testing::HasSubstr("is not where the phases go on"));
  EXPECT_THAT(attempt({1, 0, 2, 3, 4, 5, 6, 7, 8, 9}), testing::HasSubstr("is not where the phases go on"));
  auto decoder = Decoder::make(sequence, scene.width, scene.height, {});
  EXPECT_THAT(decoder->add(0, base::Image(100, 100, 8)).error().message, testing::HasSubstr("100 x 100"));
}

TEST(Decode, SameBytesForAnyNumberOfThreads) {
  const SyntheticScan scene;
  DecodeOptions options;
  options.threads = 1;
  const auto sequence = tests::gray_and_fringes(24.0, 5, false, true);
  const auto one = decoded(scene, sequence, 12, options);
  options.threads = 7;
  const auto many = decoded(scene, sequence, 12, options);
  ASSERT_TRUE(one && many);
  EXPECT_EQ(one->status, many->status);
  EXPECT_EQ(one->x->sigma_turns, many->x->sigma_turns);
  EXPECT_EQ(one->noise.read, many->noise.read);
  for (std::size_t i = 0; i < one->status.size(); ++i) {
    if (one->status[i] == PhaseStatus::kValid) {
      ASSERT_EQ(one->x->turns[i], many->x->turns[i]);
    }
  }
}

}  // namespace
}  // namespace crosstie::scan
