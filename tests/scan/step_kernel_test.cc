// The sums of an edge's fit, which run in vectors, against a plain loop, for every instruction set that this machine has.
#include "scan/detail/step_kernel.h"

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <hwy/targets.h>

namespace crosstie::scan::detail {
namespace {

TEST(StepKernel, SumsAreThoseOfAPlainLoop) {
  constexpr std::size_t kCount = 163;
  constexpr std::size_t kPadded = 168;
  constexpr double kBlur = 0.7;
  constexpr std::array<double, kMostSteps> kPlaces = {-0.8, 0.3, 2.1};
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> place(-7.0, 7.0), level(-100.0, 100.0);
  std::vector<double> across(kPadded, kBeforeAll_px);
  std::array<std::vector<double>, kMostEdgeImages> levels;
  for (auto& image : levels) image.assign(kPadded, 0.0);
  for (std::size_t i = 0; i < kCount; ++i) {
    across[i] = place(random);
    for (auto& image : levels) image[i] = level(random);
  }
  const auto distribution = [&](std::size_t i, std::size_t j) {
    return 0.5 * std::erfc(-(across[i] - kPlaces[j]) / kBlur / std::numbers::sqrt2);
  };
  const auto density = [&](std::size_t i, std::size_t j) {
    const double t = (across[i] - kPlaces[j]) / kBlur;
    return std::exp(-0.5 * t * t) / (kBlur * std::sqrt(2.0 * std::numbers::pi));
  };
  const auto sum = [&](const auto& term) {
    double all = 0.0;
    for (std::size_t i = 0; i < kCount; ++i) all += term(i);
    return all;
  };
  constexpr double kNear = 2e-5;  // the table's 1e-9 over all pixels and levels
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    for (std::size_t steps = 1; steps <= kMostSteps; ++steps) {
      for (std::size_t images = 1; images <= kMostEdgeImages; ++images) {
        SCOPED_TRACE(testing::Message() << hwy::TargetName(target) << ", " << steps << " steps, " << images << " images");
        const StepSamples samples{across.data(), {levels[0].data(), levels[1].data(), levels[2].data()}, kPadded, images};
        const StepSums sums = sum_steps(samples, kBlur, kPlaces.data(), steps);
        for (std::size_t j = 0; j < steps; ++j) {
          EXPECT_NEAR(sums.step[j], sum([&](std::size_t i) { return distribution(i, j); }), kNear);
          EXPECT_NEAR(sums.slope[j], sum([&](std::size_t i) { return density(i, j); }), kNear);
          for (std::size_t l = 0; l < steps; ++l) {
            EXPECT_NEAR(sums.cross[j][l], sum([&](std::size_t i) { return distribution(i, j) * density(i, l); }), kNear);
            if (l > j) continue;
            EXPECT_NEAR(sums.steps[j][l], sum([&](std::size_t i) { return distribution(i, j) * distribution(i, l); }), kNear);
            EXPECT_NEAR(sums.slopes[j][l], sum([&](std::size_t i) { return density(i, j) * density(i, l); }), kNear);
          }
          for (std::size_t image = 0; image < images; ++image) {
            EXPECT_NEAR(sums.by_step[image][j], sum([&](std::size_t i) { return distribution(i, j) * levels[image][i]; }),
                        kNear);
            EXPECT_NEAR(sums.by_slope[image][j], sum([&](std::size_t i) { return density(i, j) * levels[image][i]; }), kNear);
          }
        }
      }
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
}

}  // namespace
}  // namespace crosstie::scan::detail
