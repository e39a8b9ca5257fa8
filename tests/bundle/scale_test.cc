#include <cmath>

#include <gtest/gtest.h>

#include "bundle/adjust.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

const base::AdjustedScaleBar& bar_of(const base::AdjustedNetwork& result, int id_a) {
  for (const auto& bar : result.scale_bars) {
    if (bar.bar.id_a == id_a) return bar;
  }
  std::abort();
}

bool warns(const base::AdjustedNetwork& result, const std::string& code) {
  for (const auto& warning : result.warnings) {
    if (warning.code == code) return true;
  }
  return false;
}

TEST(Scale, BarsAreCorrectedForTemperature) {
  auto synthetic = tests::make_synthetic({});
  // The same bar, certified at 20 degrees and photographed at 40: steel is 0.23 per mille longer then.
  for (auto& bar : synthetic.network.scale_bars) {
    bar.temperature_c = 40.0;
    bar.cte_per_k = 11.5e-6;
    bar.length_mm /= 1.0 + 20.0 * 11.5e-6;
  }
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->scale, "scale bars");
  EXPECT_EQ(result->conditions, 6);
  for (const auto& bar : result->scale_bars) {
    EXPECT_NEAR(bar.measured_mm, synthetic.distance(bar.bar.id_a, bar.bar.id_b), 0.04);
    EXPECT_LT(std::abs(bar.w), 3.5);
  }
}

TEST(Scale, ADefiningLengthIsExactAndACheckIsCompared) {
  auto synthetic = tests::make_synthetic({.depth_mm = 0.0});
  auto& bars = synthetic.network.scale_bars;
  bars[0].role = base::ScaleBarRole::kDefines;
  bars[0].sigma_mm = 0.0;
  bars[0].length_mm = synthetic.distance(bars[0].id_a, bars[0].id_b);
  bars[1].role = base::ScaleBarRole::kCheck;
  bars[1].length_mm = synthetic.distance(bars[1].id_a, bars[1].id_b) + 0.2;
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->scale, "defined by 10-39");
  EXPECT_EQ(result->conditions, 7);
  const auto& defining = bar_of(*result, 10);
  EXPECT_NEAR(defining.measured_mm, bars[0].length_mm, 1e-9);
  EXPECT_LT(defining.sigma_mm, 1e-7);
  const auto& check = bar_of(*result, bars[1].id_a);
  EXPECT_GT(check.sigma_mm, 1e-4);
  EXPECT_NEAR(check.measured_mm - bars[1].length_mm, -0.2, 0.05);
  EXPECT_TRUE(warns(*result, "check_bar"));
}

TEST(Scale, ACheckTellsNothingToTheAdjustment) {
  auto synthetic = tests::make_synthetic({});
  synthetic.network.scale_bars[1].role = base::ScaleBarRole::kCheck;
  const auto first = adjust(synthetic.network);
  synthetic.network.scale_bars[1].length_mm += 5.0;
  const auto second = adjust(synthetic.network);
  ASSERT_TRUE(first && second);
  for (std::size_t i = 0; i < first->points.size(); ++i) EXPECT_EQ(first->points[i].xyz_mm, second->points[i].xyz_mm);
}

TEST(Scale, AFreeScaleIsAUnitNetwork) {
  auto synthetic = tests::make_synthetic({.bars = false});
  synthetic.network.scale_is_free = true;
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->scale, "free");
  EXPECT_EQ(result->conditions, 7);
  double sum = 0.0;
  for (const auto& point : result->points) sum += point.xyz_mm.norm();
  EXPECT_NEAR(sum / static_cast<double>(result->points.size()), 1.0, 1e-9);
}

TEST(Scale, BarsThatContradictEachOtherAreBothNamed) {
  auto synthetic = tests::make_synthetic({});
  synthetic.network.scale_bars[1].length_mm *= 1.005;
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result) << result.error().message;
  for (const auto& warning : result->warnings) {
    if (warning.code != "contradicting_bars") continue;
    for (const auto& bar : synthetic.network.scale_bars) {
      EXPECT_NE(warning.message.find(std::to_string(bar.id_a) + "-" + std::to_string(bar.id_b)), std::string::npos)
          << warning.message;
    }
  }
  EXPECT_TRUE(warns(*result, "contradicting_bars"));
  // The image points at the bars' ends are not blamed for it.
  EXPECT_LT(result->rejected.size(), 5U);
}

TEST(Scale, OneBarAloneIsSaidToBeUnchecked) {
  auto synthetic = tests::make_synthetic({});
  synthetic.network.scale_bars.pop_back();
  const auto result = adjust(synthetic.network);
  ASSERT_TRUE(result);
  EXPECT_TRUE(warns(*result, "one_scale_bar"));
}

TEST(Scale, WithoutAnyThereIsNoSolution) {
  const auto synthetic = tests::make_synthetic({.bars = false});
  const auto result = adjust(synthetic.network);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution);
  EXPECT_NE(result.error().message.find("scale"), std::string::npos);
}

TEST(Scale, ImpossibleBarsAreRefused) {
  auto synthetic = tests::make_synthetic({});
  auto& bar = synthetic.network.scale_bars[0];
  const base::ScaleBar good = bar;
  bar.sigma_mm = 0.0;
  EXPECT_EQ(adjust(synthetic.network).error().code, base::ErrorCode::kBadInput);
  bar = good;
  bar.id_b = bar.id_a;
  EXPECT_EQ(adjust(synthetic.network).error().code, base::ErrorCode::kBadInput);
  bar = good;
  bar.length_mm = -1.0;
  EXPECT_EQ(adjust(synthetic.network).error().code, base::ErrorCode::kBadInput);
  bar = good;
  bar.role = base::ScaleBarRole::kDefines;  // beside a used one
  EXPECT_EQ(adjust(synthetic.network).error().code, base::ErrorCode::kBadInput);
}

}  // namespace
}  // namespace crosstie::bundle
