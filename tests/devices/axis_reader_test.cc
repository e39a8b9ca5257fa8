#include "devices/axis_reader.h"

#include <chrono>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/devices/manual_clock.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using std::chrono::milliseconds;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(FreshReading, AStaleReadingIsRefusedWithItsAge) {
  const HostTime time(std::chrono::seconds(100));
  const AxisState state{"axis of the test", AxisReading{850.04, time}, "the cable is out"};
  EXPECT_EQ(fresh_reading(state, time, 2.0)->position_mm, 850.04);
  EXPECT_TRUE(fresh_reading(state, time + milliseconds(2000), 2.0));
  const auto stale = fresh_reading(state, time + milliseconds(2001), 2.0);
  ASSERT_FALSE(stale);
  EXPECT_EQ(stale.error().code, ErrorCode::kDevice);
  EXPECT_THAT(stale.error().message, AllOf(HasSubstr("axis of the test"), HasSubstr("850.040 mm"), HasSubstr("2.0 s old"),
                                           HasSubstr("the cable is out")));
}

TEST(FreshReading, AnAbsentReadingIsRefused) {
  const auto absent = fresh_reading({"axis of the test", std::nullopt, ""}, HostTime(), 2.0);
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, ErrorCode::kDevice);
  EXPECT_THAT(absent.error().message, AllOf(HasSubstr("axis of the test"), HasSubstr("no reading yet")));
}

TEST(FreshReading, ALimitThatLimitsNothingIsRefused) {
  const AxisState state{"axis", AxisReading{}, ""};
  for (const double limit_s : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    ASSERT_FALSE(fresh_reading(state, HostTime(), limit_s)) << limit_s;
    EXPECT_EQ(fresh_reading(state, HostTime(), limit_s).error().code, ErrorCode::kUsage);
  }
}

TEST(TypedAxis, APositionAgesAndIsForgotten) {
  tests::ManualClock clock;
  TypedAxis axis(clock.clock());
  EXPECT_FALSE(axis.state().latest);
  ASSERT_TRUE(axis.enter(-12.5));
  clock.advance(milliseconds(1500));
  EXPECT_EQ(fresh_reading(axis.state(), clock.now(), 2.0)->position_mm, -12.5);
  EXPECT_FALSE(fresh_reading(axis.state(), clock.now(), 1.0));
  axis.forget();
  EXPECT_FALSE(axis.state().latest);
}

TEST(TypedAxis, APositionThatIsNotFiniteIsRefused) {
  TypedAxis axis;
  ASSERT_TRUE(axis.enter(7.0));
  EXPECT_EQ(axis.enter(std::numeric_limits<double>::quiet_NaN()).error().code, ErrorCode::kUsage);
  EXPECT_EQ(axis.state().latest->position_mm, 7.0);
}

TEST(SimulatedAxis, FollowsItsFunctionOfTime) {
  tests::ManualClock clock;
  const HostTime start = clock.now();
  bool answers = true;
  SimulatedAxis axis(
      [&](HostTime time) -> base::Result<double> {
        if (!answers) return base::fail(ErrorCode::kDevice, "emergency stop");
        return 100.0 * seconds_between(start, time);  // mm, at 100 mm/s
      },
      clock.clock());
  EXPECT_EQ(axis.state().latest->position_mm, 0.0);
  clock.advance(milliseconds(250));
  EXPECT_DOUBLE_EQ(axis.state().latest->position_mm, 25.0);
  EXPECT_EQ(axis.state().latest->time, clock.now());

  answers = false;
  clock.advance(milliseconds(1000));
  const AxisState state = axis.state();
  EXPECT_DOUBLE_EQ(state.latest->position_mm, 25.0);
  EXPECT_EQ(seconds_between(state.latest->time, clock.now()), 1.0);
  EXPECT_THAT(state.trouble, HasSubstr("emergency stop"));
}

}  // namespace
}  // namespace crosstie::devices
