#include "app/verdicts.h"

#include <gtest/gtest.h>

namespace crosstie::app {
namespace {

using base::VerdictLevel;

TEST(Verdicts, FollowIso14253) {
  base::AdjustedNetwork network;
  network.redundancy = 200;  // sigma0 is then known to 5 %, U = 10 %
  const std::pair<double, VerdictLevel> cases[] = {{0.080, VerdictLevel::kOk},
                                                   {0.095, VerdictLevel::kWarning},
                                                   {0.105, VerdictLevel::kWarning},
                                                   {0.120, VerdictLevel::kFail}};
  for (const auto& [sigma0_px, level] : cases) {
    network.sigma0_px = sigma0_px;
    EXPECT_EQ(judge(network, {}).front().level, level) << sigma0_px;
  }
}

TEST(Verdicts, FailOnContradictingScaleBars) {
  base::AdjustedNetwork network;
  network.redundancy = 1000;
  network.scale_bars.resize(2);
  network.scale_bars[1].w = -12.0;
  EXPECT_EQ(outcome_of(judge(network, {})), Outcome::kVerdictFailed);
  network.scale_bars[1].w = -1.0;
  EXPECT_EQ(outcome_of(judge(network, {})), Outcome::kOk);
}

TEST(Verdicts, JudgeLengthsAgainstTheirOwnLimit) {
  base::Verification verification;
  verification.lengths = {{1, 2, 100.0, 100.03, 0.001, 0.055}, {1, 3, 1000.0, 1000.2, 0.001, 0.1}};
  EXPECT_TRUE(judge(verification, {}).empty()) << "without a limit of the job nothing is judged";
  JobLimits limits;
  limits.length_mpe_a_mm = 0.05;
  const auto verdicts = judge(verification, limits);
  ASSERT_EQ(verdicts.size(), 1U);
  EXPECT_DOUBLE_EQ(verdicts.front().limit, 0.1);
  EXPECT_EQ(verdicts.front().level, VerdictLevel::kFail);
}

}  // namespace
}  // namespace crosstie::app
