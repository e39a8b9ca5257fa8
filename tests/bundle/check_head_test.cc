#include "bundle/check_head.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <gtest/gtest.h>

#include "tests/bundle/synthetic_head.h"

namespace crosstie::bundle {
namespace {

using Verdict = base::HeadCheck::Verdict;

/// How a head that was commissioned is judged after something happened to it.
struct Judged {
  int runs = 0;
  int rig = 0;
  int head_or_cross = 0;
  int holds = 0;
};

struct Happened {
  Eigen::Vector3d rig_turn_rad = Eigen::Vector3d::Zero();  ///< of the right camera about its own place
  Eigen::Vector3d rig_shift_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d head_shift_mm = Eigen::Vector3d::Zero();
  bool probe_again = false;
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
    pose.translation_mm += happened.head_shift_mm;
    base::Pose rig = head.right_from_left;
    rig.rotation = base::rotation_exp(happened.rig_turn_rad) * rig.rotation;
    rig.translation_mm = base::rotation_exp(happened.rig_turn_rad) * rig.translation_mm + happened.rig_shift_mm;
    auto pair = head.photographs(pose, "now", rig, random, head.plan.image_sigma_px);
    CheckInput input{.commissioning = &*known,
                     .axis_mm = axis_mm + head.plan.reading_sigma_mm * normal(random),
                     .left = pair[0],
                     .right = pair[1]};
    if (happened.probe_again) {
      input.probed_again = head.input.probed;
      for (auto& ball : input.probed_again) {
        const auto sphere =
            std::find_if(known->spheres.begin(), known->spheres.end(), [&](const auto& s) { return s.id == ball.id; });
        if (sphere == known->spheres.end()) continue;
        ball.centre_mm += 0.02 * Eigen::Vector3d(normal(random), normal(random), normal(random));
      }
    }
    const auto check = check_head(input);
    EXPECT_TRUE(check) << check.error().message;
    if (!check) continue;
    ++judged.runs;
    judged.rig += check->verdict == Verdict::kRig ? 1 : 0;
    judged.head_or_cross += check->verdict == Verdict::kHeadOrCross ? 1 : 0;
    judged.holds += check->verdict == Verdict::kHolds ? 1 : 0;
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
  for (const auto& [name, happened] : cases) {
    const Judged judged = judge(happened, 40, 500);
    std::printf("%s: %d of %d named the rig\n", name, judged.rig, judged.runs);
    EXPECT_GE(judged.rig, 38) << name;
  }
}

TEST(CheckHead, AccusesAnUnmovedHeadAtItsLevelOnly) {
  const Judged judged = judge({}, 100, 700);
  std::printf("unmoved: rig %d, head or cross %d, holds %d of %d\n", judged.rig, judged.head_or_cross, judged.holds,
              judged.runs);
  EXPECT_LE(judged.rig, 2);  // at 1e-3: 3 of 100 have a probability of 1.5e-4
  EXPECT_LE(judged.head_or_cross, 2);
}

TEST(CheckHead, SaysHeadOrCrossAndSeparatesThemByTheSpheresOnly) {
  const Judged judged = judge({.head_shift_mm = {0.0, 0.15, 0.1}}, 20, 900);
  EXPECT_GE(judged.head_or_cross, 19);
}

}  // namespace
}  // namespace crosstie::bundle
