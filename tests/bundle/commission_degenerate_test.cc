// What does not determine the head's place, and what contradicts itself: refused with the reason, never answered.

#include <algorithm>
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/bundle/synthetic_head.h"
#include "tests/support/normalised_square.h"

namespace crosstie::bundle {
namespace {

using base::ErrorCode;
using testing::HasSubstr;

constexpr double kInch_mm = 25.4;

CommissionInput three_stations() {
  tests::HeadPlan plan;
  plan.stations = 3;
  return tests::make_head(plan, 5).input;
}

struct Refusal {
  const char* name;
  ErrorCode code;
  const char* reason;
  std::function<void(CommissionInput&)> change;
};

void in_inches(std::vector<base::ReferencePoint>& points) {
  for (auto& point : points) point.xyz_mm /= kInch_mm;
}

/// Leaves the coordinates of the balls that count, by ball: "XYZ", "Z", "".
void count_only(CommissionInput& input, const std::vector<std::string>& masks) {
  for (std::size_t i = 0; i < input.probed.size(); ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) input.probed[i].axes[axis] = masks[i].find("XYZ"[axis]) != std::string::npos;
  }
}

const Refusal kRefusals[] = {
    {"one station", ErrorCode::kNoUniqueSolution, "the axis needs two", [](auto& in) { in.stations.resize(1); }},
    {"all stations at one reading, and there", ErrorCode::kNoUniqueSolution, "have the axis reading",
     [](auto& in) {
       in.stations[1] = in.stations[0];
       in.stations.resize(2);
       in.stations[1].name = "again";
       for (auto image : std::vector<base::ImageObservations>(in.images)) {
         if (image.image != in.stations[0].left && image.image != in.stations[0].right) continue;
         image.image = "again_" + image.image;
         in.images.push_back(image);
       }
       in.stations[1].left = "again_" + in.stations[0].left;
       in.stations[1].right = "again_" + in.stations[0].right;
     }},
    {"one reading at two places", ErrorCode::kBadInput, "one of the readings is wrong",
     [](auto& in) { in.stations[1].axis_mm = in.stations[0].axis_mm; }},
    {"readings in inches", ErrorCode::kBadInput, "readings are in inches",
     [](auto& in) {
       for (auto& station : in.stations) station.axis_mm /= kInch_mm;
     }},
    {"readings in metres", ErrorCode::kBadInput, "readings are in metres",
     [](auto& in) {
       for (auto& station : in.stations) station.axis_mm /= 1000.0;
     }},
    {"the photographs of one station belong to another", ErrorCode::kBadInput, "x0350_l belongs to two stations",
     [](auto& in) { in.stations[1].left = in.stations[0].left; }},
    {"left and right photographs swapped", ErrorCode::kBadInput, "left and right photographs are swapped",
     [](auto& in) {
       for (auto& station : in.stations) std::swap(station.left, station.right);
     }},
    {"no marker of the cross is seen", ErrorCode::kNoUniqueSolution, "compare the ids",
     [](auto& in) {
       for (auto& marker : in.cross.markers) marker.id += 500;
     }},
    {"photographs of another size", ErrorCode::kBadInput, "its camera was calibrated with",
     [](auto& in) { in.images[0].width_px = 2048; }},
    {"two balls", ErrorCode::kNoUniqueSolution, "needs three", [](auto& in) { in.probed.resize(2); }},
    {"balls on one line", ErrorCode::kNoUniqueSolution, "on one line",
     [](auto& in) {
       // The four balls of the list lie across each other: three new ones on one arm.
       const base::Pose machine_from_cross{Eigen::Quaterniond::Identity(), {850.0, 300.0, -250.0}};
       in.cross.spheres.resize(3);
       in.probed.resize(3);
       for (std::size_t i = 0; i < 3; ++i) {
         in.cross.spheres[i].centre_mm = {-600.0 + 600.0 * static_cast<double>(i), 0.0, 0.0};
         in.probed[i].centre_mm =
             machine_from_cross * Eigen::Vector3d((1.0 + in.cross.growth()) * in.cross.spheres[i].centre_mm);
       }
     }},
    {"spheres with each other's ids", ErrorCode::kBadInput, "swapped",
     [](auto& in) { std::swap(in.probed[0].id, in.probed[1].id); }},
    {"a sphere probed twice", ErrorCode::kBadInput, "given twice", [](auto& in) { in.probed.push_back(in.probed[0]); }},
    {"spheres in inches", ErrorCode::kBadInput, "one of the two is in inches",
     [](auto& in) {
       for (auto& ball : in.probed) ball.centre_mm /= kInch_mm;
     }},
    {"markers of the cross in inches", ErrorCode::kNoUniqueSolution, "no pose of the head explains its markers",
     [](auto& in) { in_inches(in.cross.markers); }},
    {"X and Y of the machine exchanged", ErrorCode::kBadInput, "not along X",
     [](auto& in) {
       for (auto& ball : in.probed)
         ball.centre_mm = Eigen::Vector3d(-ball.centre_mm.y(), ball.centre_mm.x(), ball.centre_mm.z());
     }},
    {"six coordinates on two balls", ErrorCode::kNoUniqueSolution, "leave the machine frame free",
     [](auto& in) {
       count_only(in, {"XYZ", "XYZ", "", ""});
     }},
    {"six coordinates of which none holds Y", ErrorCode::kNoUniqueSolution, "leave the machine frame free",
     [](auto& in) {
       count_only(in, {"ZX", "ZX", "ZX", ""});
     }},
    {"five coordinates", ErrorCode::kNoUniqueSolution, "leave the machine frame free",
     [](auto& in) {
       count_only(in, {"ZY", "Z", "ZY", ""});
     }},
    {"no sigma of the readings", ErrorCode::kBadInput, "sigma of an axis reading", [](auto& in) { in.reading_sigma_mm = 0.0; }},
    {"a marker of the cross without sigmas", ErrorCode::kBadInput, "no sigmas",
     [](auto& in) { in.cross.markers[3].cov_mm2.reset(); }},
    {"a reading that is not finite", ErrorCode::kBadInput, "not finite",
     [](auto& in) { in.stations[0].axis_mm = std::numeric_limits<double>::quiet_NaN(); }},
};

TEST(CommissionDegenerate, IsRefusedWithItsReason) {
  const CommissionInput good = three_stations();
  ASSERT_TRUE(commission(good));
  for (const Refusal& refusal : kRefusals) {
    CommissionInput input = good;
    refusal.change(input);
    const auto result = commission(input);
    ASSERT_FALSE(result) << refusal.name;
    EXPECT_EQ(result.error().code, refusal.code) << refusal.name << ": " << result.error().message;
    EXPECT_THAT(result.error().message, HasSubstr(refusal.reason)) << refusal.name;
  }
}

TEST(CommissionDegenerate, AWrongReadingAmongFiveIsNamedAndTakesNoPart) {
  const tests::SyntheticHead head = tests::make_head({}, 6);
  CommissionInput input = head.input;
  input.stations[3].axis_mm += 10.0;
  const auto result = commission(input);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->stations.size(), 4U);
  const bool named = std::any_of(result->rejected.begin(), result->rejected.end(), [&](const auto& rejected) {
    return rejected.subject.find(input.stations[3].name) != std::string::npos &&
           rejected.reason.find("wrong") != std::string::npos;
  });
  EXPECT_TRUE(named);
}

TEST(CommissionDegenerate, TwoStationsGiveAStraightAxisAndAreWarnedOf) {
  tests::HeadPlan plan;
  plan.stations = 2;
  double square = 0.0;
  constexpr int kSeeds = 12;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const tests::SyntheticHead head = tests::make_head(plan, 300 + static_cast<std::uint64_t>(seed));
    const auto result = commission(head.input);
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_TRUE(
        std::any_of(result->warnings.begin(), result->warnings.end(), [](const auto& w) { return w.code == "few_stations"; }));
    const auto pose = result->frame.at(result->frame.axis.middle_mm());
    ASSERT_TRUE(pose);
    square +=
        tests::normalised_square(pose->machine_from_rig, head.machine_from_rig(result->frame.axis.middle_mm()), pose->cov);
  }
  // 72 squares of standard normal values: 99.9 % lie between 37 and 118.
  EXPECT_GT(square, 37.0);
  EXPECT_LT(square, 118.0);
}

TEST(CommissionDegenerate, ThreeTwoOneHoldsItsSixCoordinates) {
  CommissionInput input = three_stations();
  count_only(input, {"ZY", "Z", "ZY", "X"});
  // The priors of small motions lie along the machine's axes. A turn of the frame by sigma / lever = 4e-5 rad changes their sum of
  // squares in the same proportion, which pulls the balls by some 4e-5 of a sigma of 0.02 mm: a nanometre. Without them nothing pulls.
  for (const bool small_motions : {false, true}) {
    const auto result = commission(input, {.small_motions = small_motions});
    ASSERT_TRUE(result) << result.error().message;
    EXPECT_THAT(result->datum, HasSubstr("minimal"));
    for (const auto& sphere : result->spheres) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double residual_mm = sphere.residual_mm(static_cast<Eigen::Index>(axis));
        EXPECT_NEAR(sphere.axes[axis] ? residual_mm : 0.0, 0.0, small_motions ? 1e-5 : 1e-6) << sphere.id;
      }
      EXPECT_FALSE(sphere.left_out_mm) << "nothing controls a minimal frame";
    }
  }
}

TEST(CommissionDegenerate, BallsInOnePlaneAndACrossWithoutDepthStillDo) {
  CommissionInput input = three_stations();
  // Exactly flat: the list's heights become those of a plane, and so do the photographs' true places.
  tests::HeadPlan plan;
  plan.stations = 3;
  plan.depth = 0.0;
  const tests::SyntheticHead head = tests::make_head(plan, 9);
  const auto result = commission(head.input);
  ASSERT_TRUE(result) << result.error().message;
  const auto pose = result->frame.at(result->frame.axis.middle_mm());
  const base::Vector6d error = base::difference(pose->machine_from_rig, head.machine_from_rig(result->frame.axis.middle_mm()));
  for (Eigen::Index i = 0; i < 6; ++i) EXPECT_LT(std::abs(error(i)), 5.0 * std::sqrt(pose->cov(i, i))) << i;
}

}  // namespace
}  // namespace crosstie::bundle
