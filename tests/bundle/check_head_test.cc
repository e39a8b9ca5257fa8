#include "bundle/check_head.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "tests/bundle/seeds.h"
#include "tests/bundle/synthetic_head.h"

namespace crosstie::bundle {
namespace {

using Verdict = base::HeadCheck::Verdict;

/// How a head that was commissioned is judged after something happened to it.
struct Judged {
  int runs = 0;
  int rig = 0;
  int head_or_cross = 0;
  int head = 0;
  int cross = 0;
  int holds = 0;
  int baseline_seen = 0;
  int untested = 0;  ///< the cross was not seen, and that is said
};

struct Happened {
  Eigen::Vector3d rig_turn_rad = Eigen::Vector3d::Zero();  ///< of the right camera about its own place
  Eigen::Vector3d rig_shift_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d head_shift_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d cross_shift_mm = Eigen::Vector3d::Zero();
  bool probe_again = false;
  bool cross_out_of_view = false;  ///< other markers in its place, of which nothing is known
};

Judged judge(const Happened& happened, int seeds, std::uint64_t first) {
  Judged judged;
  for (int i = 0; i < seeds; ++i) {
    const tests::SyntheticHead head = tests::make_head({}, first + static_cast<std::uint64_t>(i));
    const auto known = commission(head.input);
    EXPECT_TRUE(known) << known.error().message;
    if (!known) continue;
    std::mt19937_64 random(first * 31 + static_cast<std::uint64_t>(i));
    std::normal_distribution<double> normal;
    const double axis_mm = 600.0 + 5.0 * i;
    base::Pose pose = head.machine_from_rig(axis_mm);
    // What the head sees of a cross that moved is what it sees after it moved the other way itself.
    pose.translation_mm += happened.head_shift_mm - happened.cross_shift_mm;
    base::Pose rig = head.right_from_left;
    rig.rotation = base::rotation_exp(happened.rig_turn_rad) * rig.rotation;
    rig.translation_mm = base::rotation_exp(happened.rig_turn_rad) * rig.translation_mm + happened.rig_shift_mm;
    auto pair = head.photographs(pose, "now", rig, random, head.plan.image_sigma_px);
    for (auto& image : pair) {
      for (auto& seen : image.observations) seen.id += happened.cross_out_of_view ? 1000 : 0;
    }
    CheckInput input{.commissioning = &*known,
                     .axis_mm = axis_mm + head.plan.reading_sigma_mm * normal(random),
                     .left = pair[0],
                     .right = pair[1]};
    if (happened.probe_again) {
      input.probed_again = head.input.probed;
      for (auto& ball : input.probed_again) {
        ball.centre_mm = head.sphere(ball.id) + happened.cross_shift_mm +
                         head.plan.sphere_sigma_mm * Eigen::Vector3d(normal(random), normal(random), normal(random));
      }
    }
    const auto check = check_head(input);
    EXPECT_TRUE(check) << check.error().message;
    if (!check) continue;
    ++judged.runs;
    judged.rig += check->verdict == Verdict::kRig ? 1 : 0;
    judged.head_or_cross += check->verdict == Verdict::kHeadOrCross ? 1 : 0;
    judged.head += check->verdict == Verdict::kHead ? 1 : 0;
    judged.cross += check->verdict == Verdict::kCross ? 1 : 0;
    judged.holds += check->verdict == Verdict::kHolds ? 1 : 0;
    judged.baseline_seen += check->rig_seen[3] ? 1 : 0;
    judged.untested += std::any_of(check->warnings.begin(), check->warnings.end(),
                                   [](const auto& warning) { return warning.code == "cross_not_seen"; })
                           ? 1
                           : 0;
  }
  return judged;
}

TEST(CheckHead, NamesARigThatMoved) {
  const struct {
    const char* name;
    Happened happened;
  } cases[] = {{"pitch 50 urad", {.rig_turn_rad = {50e-6, 0, 0}}},
               {"roll 50 urad", {.rig_turn_rad = {0, 0, 50e-6}}},
               {"x 0.1 mm", {.rig_shift_mm = {0.1, 0, 0}}},
               {"y 0.1 mm", {.rig_shift_mm = {0, 0.1, 0}}},
               {"z 0.1 mm", {.rig_shift_mm = {0, 0, 0.1}}}};
  const int seeds = tests::seeds(10);
  for (const auto& [name, happened] : cases) {
    const Judged judged = judge(happened, seeds, 500);
    std::printf("%s: %d of %d named the rig\n", name, judged.rig, judged.runs);
    EXPECT_GE(judged.rig, std::ceil(0.95 * seeds)) << name;
  }
}

TEST(CheckHead, AccusesAnUnmovedHeadAtItsLevelOnly) {
  const Judged judged = judge({.probe_again = true}, tests::seeds(40), 700);
  std::printf("unmoved: rig %d, head or cross %d, head %d, cross %d, holds %d of %d\n", judged.rig, judged.head_or_cross,
              judged.head, judged.cross, judged.holds, judged.runs);
  EXPECT_LE(judged.rig, 2);  // at 1e-3: 3 of 100 have a probability of 1.5e-4
  EXPECT_LE(judged.head_or_cross + judged.head + judged.cross, 2);
}

TEST(CheckHead, SaysHeadOrCrossWhereOnePairIsAllThereIs) {
  const Judged judged = judge({.head_shift_mm = {0.0, 0.15, 0.1}}, tests::seeds(10), 900);
  EXPECT_GE(judged.head_or_cross, std::ceil(0.95 * judged.runs));
}

TEST(CheckHead, TellsTheHeadFromTheCrossByItsSpheresProbedAgain) {
  const int seeds = tests::seeds(10);
  const Judged head = judge({.head_shift_mm = {0.0, 0.15, 0.1}, .probe_again = true}, seeds, 1100);
  EXPECT_GE(head.head, std::ceil(0.95 * seeds));
  // The cross and its spheres move together: the head sees it, and so does the probe.
  const Judged cross = judge({.cross_shift_mm = {0.0, 0.15, 0.1}, .probe_again = true}, seeds, 1200);
  EXPECT_GE(cross.cross, std::ceil(0.95 * seeds));
  EXPECT_EQ(cross.rig, 0);
}

TEST(CheckHead, WithoutTheCrossEpipolarDistancesNameTheRigByPitchAndRoll) {
  const int seeds = tests::seeds(10);
  // Roll of 50 urad is found in four of five: 40 markers by their epipolar distances alone tell no more.
  for (const auto& [name, happened] :
       {std::pair{"pitch 50 urad", Happened{.rig_turn_rad = {50e-6, 0, 0}, .cross_out_of_view = true}},
        std::pair{"roll 100 urad", Happened{.rig_turn_rad = {0, 0, 100e-6}, .cross_out_of_view = true}},
        std::pair{"y 0.1 mm", Happened{.rig_shift_mm = {0, 0.1, 0}, .cross_out_of_view = true}}}) {
    const Judged judged = judge(happened, seeds, 1300);
    std::printf("without the cross, %s: %d of %d named the rig\n", name, judged.rig, judged.runs);
    EXPECT_GE(judged.rig, std::ceil(0.95 * seeds)) << name;
  }
  const Judged unmoved = judge({.cross_out_of_view = true}, tests::seeds(30), 1400);
  std::printf("without the cross, unmoved: rig %d of %d\n", unmoved.rig, unmoved.runs);
  EXPECT_LE(unmoved.rig, 2);
  // The baseline's length moves no point off its epipolar curve: it is said that nothing is known of it.
  const Judged longer =
      judge({.rig_shift_mm = {-0.5 * std::cos(0.3), 0, 0.5 * std::sin(0.3)}, .cross_out_of_view = true}, 3, 1500);
  EXPECT_EQ(longer.rig, 0);
  EXPECT_EQ(longer.baseline_seen, 0);
  EXPECT_EQ(longer.untested, longer.runs);
}

TEST(CheckHead, NeedsMarkersAndAReadingInTheTravel) {
  const tests::SyntheticHead head = tests::make_head({}, 3);
  const auto known = commission(head.input);
  ASSERT_TRUE(known);
  std::mt19937_64 random(1);
  auto pair = head.photographs(head.machine_from_rig(700.0), "now", head.right_from_left, random, 0.03);
  CheckInput input{.commissioning = &*known, .axis_mm = 700.0, .left = pair[0], .right = pair[1]};
  ASSERT_TRUE(check_head(input));
  input.axis_mm = 1400.0;
  EXPECT_EQ(check_head(input).error().code, base::ErrorCode::kBadInput);
  input.axis_mm = 700.0;
  input.left.observations.resize(2);
  input.right.observations.resize(2);
  const auto none = check_head(input);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, base::ErrorCode::kNoUniqueSolution);
}

}  // namespace
}  // namespace crosstie::bundle
