#include "base/verdict.h"

#include <limits>

#include <gtest/gtest.h>

#include "base/observation.h"
#include "base/version.h"

namespace crosstie::base {
namespace {

TEST(Verdict, FollowsIso14253) {
  EXPECT_EQ(judge_upper_limit(0.7, 1.0, 0.2), VerdictLevel::kOk);
  EXPECT_EQ(judge_upper_limit(0.9, 1.0, 0.2), VerdictLevel::kWarning);
  EXPECT_EQ(judge_upper_limit(1.0, 1.0, 0.0), VerdictLevel::kOk);
  EXPECT_EQ(judge_upper_limit(1.1, 1.0, 0.2), VerdictLevel::kWarning);
  EXPECT_EQ(judge_upper_limit(1.3, 1.0, 0.2), VerdictLevel::kFail);
}

TEST(Verdict, NothingThatIsNoNumberPasses) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(judge_upper_limit(nan, 1.0, 0.0), VerdictLevel::kFail);
  EXPECT_EQ(judge_upper_limit(0.0, nan, 0.0), VerdictLevel::kFail);
  EXPECT_EQ(judge_upper_limit(0.0, 1.0, nan), VerdictLevel::kFail);
}

TEST(Verdict, NamesAreThoseOfTheDocuments) {
  EXPECT_EQ(verdict_level_name(VerdictLevel::kWarning), "WARNING");
  EXPECT_EQ(status_name(ObservationStatus::kUnreadable), "unreadable");
  EXPECT_EQ(version().find('.'), 1U);
}

}  // namespace
}  // namespace crosstie::base
