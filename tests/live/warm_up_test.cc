#include "live/warm_up.h"

#include <chrono>
#include <cmath>
#include <limits>
#include <vector>

#include <gtest/gtest.h>

namespace crosstie::live {
namespace {

/// Readings every 5 s of 30 + 12 (1 - exp(-t / 20 min)) degrees C, in steps of 0.1 K.
std::vector<TemperatureReading> switched_on(double seconds) {
  std::vector<TemperatureReading> readings;
  for (double t = 0.0; t <= seconds; t += 5.0) {
    const double c = 30.0 + 12.0 * (1.0 - std::exp(-t / 1200.0));
    readings.push_back({devices::HostTime(devices::to_nanoseconds(1000.0 + t)), std::round(10.0 * c) / 10.0});
  }
  return readings;
}

TEST(WarmUp, AnExponentialRiseIsWarmingUntilItIsSlow) {
  // The mean slope over the 600 s before t is 12 (exp(-(t - 600) / 1200) - exp(-t / 1200)) K in 10 minutes: 0.5 at t = 3262 s.
  const auto early = judge_warm_up(switched_on(1200.0));
  ASSERT_TRUE(early && early->k_per_10_min);
  EXPECT_TRUE(early->warming);
  EXPECT_NEAR(*early->k_per_10_min, 12.0 * (std::exp(-0.5) - std::exp(-1.0)), 0.1);
  EXPECT_GT(early->sigma_k_per_10_min, 0.0);
  EXPECT_TRUE(judge_warm_up(switched_on(3000.0))->warming);
  EXPECT_FALSE(judge_warm_up(switched_on(3600.0))->warming);
  EXPECT_NEAR(*early->temperature_c, 30.0 + 12.0 * (1.0 - std::exp(-1.0)), 0.051);
}

TEST(WarmUp, TooShortIsNotJudged) {
  const auto nothing = judge_warm_up({});
  ASSERT_TRUE(nothing);
  EXPECT_FALSE(nothing->temperature_c);
  const auto brief = judge_warm_up(switched_on(170.0));
  EXPECT_TRUE(brief->temperature_c);
  EXPECT_FALSE(brief->k_per_10_min);
  EXPECT_FALSE(brief->warming);
  EXPECT_TRUE(judge_warm_up(switched_on(185.0))->warming);
}

TEST(WarmUp, CoolingAndStandingStillAreNoWarmingUp) {
  std::vector<TemperatureReading> falling = switched_on(1200.0);
  for (TemperatureReading& one : falling) one.temperature_c = 80.0 - one.temperature_c;
  const auto cooling = judge_warm_up(falling);
  EXPECT_FALSE(cooling->warming);
  EXPECT_LT(*cooling->k_per_10_min, -2.0);
  for (TemperatureReading& one : falling) one.temperature_c = 41.0;
  EXPECT_NEAR(*judge_warm_up(falling)->k_per_10_min, 0.0, 1e-9);
}

TEST(WarmUp, OptionsOutOfTheirDomain) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const WarmUpOptions& options : {WarmUpOptions{.most_k_per_10_min = 0.0}, WarmUpOptions{.most_k_per_10_min = nan},
                                       WarmUpOptions{.window_s = nan}, WarmUpOptions{.least_s = 700.0}}) {
    const auto refused = judge_warm_up({}, options);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, base::ErrorCode::kUsage);
  }
}

}  // namespace
}  // namespace crosstie::live
