// The verb plan: predicted sigmas against draws of the twin, what other surveys give, what it refuses.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/scene_plan.h"
#include "app/scene_variants.h"
#include "base/json_file.h"
#include "tests/app/run_verb.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using testing::HasSubstr;
using tests::TemporaryFolder;

fixtures::Scene scene(const char* name) { return *fixtures::make_scene(name); }

/// The machine with fewer poses of the board, so that many draws take little time, and with an axis whose errors are all found or none.
fixtures::Scene small_machine() {
  fixtures::Scene machine = scene("machine");
  machine.board->rig_from_board.resize(12);
  machine.machine->axis.ebx_rad = {150e-6};
  machine.machine->axis.eyx_mm = {};
  return machine;
}

/// Every third photograph of the cross.
fixtures::Scene small_network() {
  fixtures::Scene cross = scene("cross");
  std::size_t at = 0;
  std::erase_if(cross.views, [&](const fixtures::View&) { return at++ % 3 != 0; });
  return cross;
}

void expect_confirmed(const base::Rehearsal& rehearsal) {
  EXPECT_EQ(rehearsal.failed, 0) << rehearsal.first_failure;
  for (const base::RehearsedQuantity& one : rehearsal.quantities) {
    EXPECT_TRUE(one.holds()) << one.name << ": " << one.square << " of " << one.dof << " (" << one.low << " to " << one.high
                             << ")";
  }
}

TEST(Plan, SigmasOfACommissioningAreThoseOfItsDraws) {
  Session session(true, 0, {});
  const auto plan = plan_scene(small_machine(), {.variants = false, .rehearsals = 10}, session);
  ASSERT_TRUE(plan) << plan.error().message;
  ASSERT_TRUE(plan->rehearsal);
  EXPECT_EQ(plan->rehearsal->quantities.size(), 5U);  // rig by the board, three poses of the head, rig after
  expect_confirmed(*plan->rehearsal);
  ASSERT_EQ(plan->points.size(), 2U);
  for (const base::PlannedPoint& point : plan->points) EXPECT_GT(point.frame_cov_mm2.trace(), 0.0);
  // Twice the noise in all that is seen, with the same cross, probe and axis: sigmas grow, but not to more than twice.
  const auto noisy =
      plan_scene(small_machine(), {.survey = {.image_sigma_px = 0.06, .corner_sigma_px = 0.12}, .variants = false}, session);
  ASSERT_TRUE(noisy) << noisy.error().message;
  const double ratio = noisy->machine->direction_sigma_rad / plan->machine->direction_sigma_rad;
  EXPECT_GT(ratio, 1.0);
  EXPECT_LE(ratio, 2.0);
}

TEST(Plan, SigmasOfANetworkAreThoseOfItsDraws) {
  Session session(true, 0, {});
  const auto plan = plan_scene(small_network(), {.variants = false, .rehearsals = 8}, session);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_FALSE(plan->machine);
  ASSERT_TRUE(plan->network && plan->rehearsal);
  ASSERT_EQ(plan->rehearsal->quantities.size(), 1U);
  EXPECT_EQ(plan->rehearsal->quantities[0].dof, 3 * 44 - 6);  // the markers of the cross, less the frame
  expect_confirmed(*plan->rehearsal);
}

TEST(Plan, OtherSurveysGiveOtherSigmas) {
  // More of everything is never worse; the predictions are those of the changed scene itself.
  Session session(true, 0, {});
  const fixtures::Scene machine = small_machine();
  const SurveyOptions survey;
  const auto variants = scene_variants(machine, survey);
  const auto count = [&](const char* what) {
    return std::count_if(variants.begin(), variants.end(), [&](const SceneVariant& one) { return one.what == what; });
  };
  EXPECT_EQ(count("stations"), 6);
  EXPECT_EQ(count("spheres"), 6);  // 3 to 8: four there, as many half-way along the arms
  EXPECT_EQ(count("markers"), 3);
  EXPECT_EQ(count("image sigma"), 3);
  EXPECT_EQ(count("photographs"), 0);  // the campaign's list is taken
  const auto sigma = [&](const char* what, const std::string& value) {
    const auto found = std::find_if(variants.begin(), variants.end(),
                                    [&](const SceneVariant& one) { return one.what == what && one.value == value; });
    const auto plan = plan_scene(found->scene, {.survey = found->options, .variants = false}, session);
    EXPECT_TRUE(plan) << plan.error().message;
    return plan ? plan->machine->direction_sigma_rad : 0.0;
  };
  EXPECT_GT(sigma("stations", "3"), sigma("stations", "9"));
  EXPECT_GT(sigma("spheres", "3"), sigma("spheres", "8"));
  const auto networks = scene_variants(small_network(), survey);
  const auto six = std::find_if(networks.begin(), networks.end(),
                                [](const SceneVariant& one) { return one.what == "photographs" && one.value == "6"; });
  ASSERT_NE(six, networks.end());
  const auto fewer = plan_scene(six->scene, {.variants = false}, session);
  const auto all = plan_scene(small_network(), {.variants = false}, session);
  ASSERT_TRUE(fewer && all);
  EXPECT_GT(fewer->network->median_mm, all->network->median_mm);
  EXPECT_EQ(with_stations(machine, 3).machine->stations[1].axis_mm, 500.0);
}

tests::VerbAnswer plan(std::vector<std::string> words) {
  words.insert(words.begin(), "plan");
  return tests::run_verb(words);
}

TEST(Plan, WritesAResult) {
  const TemporaryFolder folder;
  const auto answer = plan({"cross", "--image-sigma-px", "0.02", "--no-variants", "--out", (folder / "plan").string()});
  ASSERT_FALSE(answer.error) << answer.error->message;
  EXPECT_THAT(answer.out, HasSubstr("network     48 points"));
  const auto result = base::read_json(folder / "plan/result.json");
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ((*result)["verb"], "plan");
  EXPECT_TRUE((*result)["machine"].is_null());
  EXPECT_GE((*result)["network"]["points"].size(), 44U);
  EXPECT_EQ((*result)["options"]["image_sigma_px"], 0.02);
  EXPECT_EQ((*result)["variants"].size(), 0U);
  EXPECT_THAT(tests::read_all(folder / "plan/report.html"), HasSubstr("Points of the network"));
}

TEST(Plan, RefusesWhatItCannotPlan) {
  const auto refusal = [](const std::vector<std::string>& words, ErrorCode code) {
    const auto answer = plan(words);
    if (!answer.error) return "was accepted: " + answer.out;
    EXPECT_EQ(answer.error->code, code) << answer.error->message;
    return answer.error->message;
  };
  EXPECT_THAT(refusal({"portal"}, ErrorCode::kUsage), HasSubstr("portal"));
  EXPECT_THAT(refusal({"cross", "--stations", "5"}, ErrorCode::kUsage), HasSubstr("no machine"));
  EXPECT_THAT(refusal({"machine", "--stations", "1"}, ErrorCode::kUsage), HasSubstr("--stations"));
  EXPECT_THAT(refusal({"cross", "--image-sigma-px", "0"}, ErrorCode::kUsage), HasSubstr("--image-sigma-px"));
  EXPECT_THAT(refusal({"cross", "--rehearse", "0"}, ErrorCode::kUsage), HasSubstr("--rehearse"));
  EXPECT_THAT(refusal({"machine", "--point", "1,2"}, ErrorCode::kUsage), HasSubstr("three coordinates"));
  EXPECT_THAT(refusal({"machine", "--point", "1,2,x"}, ErrorCode::kUsage), HasSubstr("three coordinates"));
  EXPECT_THAT(refusal({"cross", "--no-variants", "--point", "1,2,3"}, ErrorCode::kUsage), HasSubstr("no machine"));
}

}  // namespace
}  // namespace crosstie::app
