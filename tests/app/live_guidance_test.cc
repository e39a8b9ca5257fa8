// What the operator is told to do, and why something cannot be done.
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/guidance.h"
#include "app/live/live_status.h"

namespace crosstie::app {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

StationShots station(const std::string& name, double axis_mm) {
  return {.name = name, .axis_mm = axis_mm, .wants_cross = true, .wants_scan = true};
}

Situation at_station(LiveStage stage, double position_mm) {
  Situation now;
  now.stage = stage;
  now.stations = std::vector<StationShots>{station("x0", 0.0), station("x500", 500.0)};
  now.calibrated = now.commissioned = now.needs_commissioning = now.has_projector = true;
  now.axis = devices::AxisReading{position_mm, {}};
  now.axis_sigma_mm = 0.005;
  return now;
}

TEST(Guidance, TheBoardIsTakenUntilThereIsEnough) {
  Situation now;
  now.board->taken.resize(2);
  now.wanted_pose = "Hold the board in the middle.";
  Guidance guidance = guide(now);
  EXPECT_THAT(guidance.instruction, HasSubstr("Hold the board in the middle. Hold it still and press Next."));
  EXPECT_THAT(guidance.why_not("next"), IsEmpty());
  EXPECT_THAT(guidance.why_not("finish"), HasSubstr("2 pairs of the board are too few"));
  EXPECT_THAT(guidance.why_not("undo"), HasSubstr("nothing was taken yet"));
  EXPECT_THAT(guidance.why_not("fly"), HasSubstr("no such command"));
  now.board->taken.resize(kWantedPoses);
  now.wanted_pose.clear();
  now.last = "board 25";
  guidance = guide(now);
  EXPECT_THAT(guidance.instruction, HasSubstr("Press Finish"));
  EXPECT_THAT(guidance.why_not("finish"), IsEmpty());
  EXPECT_THAT(guidance.why_not("undo"), IsEmpty());
  now.cameras_trouble = "the left camera is lost";
  guidance = guide(now);
  EXPECT_THAT(guidance.why_not("next"), HasSubstr("the left camera is lost"));
  EXPECT_THAT(guidance.why_not("undo"), IsEmpty()) << "needs no camera";
  now.board = base::fail(base::ErrorCode::kBadInput, "no board in the job");
  EXPECT_THAT(guide(now).why_not("next"), HasSubstr("no board in the job"));
}

TEST(Guidance, AStationIsTakenOnlyWhereTheBeamStands) {
  Situation now = at_station(LiveStage::kCommission, 3.0);
  Guidance guidance = guide(now);
  ASSERT_TRUE(guidance.station);
  EXPECT_EQ(guidance.station->name, "x0");
  EXPECT_THAT(guidance.why_not("next"), IsEmpty()) << "within reach of the plan";
  now = at_station(LiveStage::kCommission, 500.0);
  guidance = guide(now);
  EXPECT_THAT(guidance.why_not("next"), HasSubstr("the beam stands at X = 500.0 mm, station x0 is at 0.0 mm"));
  EXPECT_THAT(guidance.instruction, HasSubstr("Move the beam to X = 0.0 mm"));
  now.selected = "x500";
  EXPECT_THAT(guide(now).why_not("next"), IsEmpty());
  now.axis = base::fail(base::ErrorCode::kDevice, "the reading is 20 s old");
  EXPECT_THAT(guide(now).why_not("next"), HasSubstr("20 s old"));
  EXPECT_THAT(guide(now).why_not("check"), HasSubstr("20 s old"));
}

TEST(Guidance, AStopThatWasPhotographedAlreadyIsMetExactly) {
  Situation now = at_station(LiveStage::kScan, 0.01);
  now.stations->front().cross_taken = true;
  EXPECT_THAT(guide(now).why_not("next"), IsEmpty());
  now.axis = devices::AxisReading{0.5, {}};
  EXPECT_THAT(guide(now).why_not("next"), HasSubstr("0.500 mm from where station x0 was photographed already"));
  EXPECT_DOUBLE_EQ(same_stop_mm(0.0), 0.02);
  EXPECT_NEAR(same_stop_mm(0.01), 0.0636, 1e-4);
}

TEST(Guidance, EachStageNeedsTheOneBefore) {
  Situation now = at_station(LiveStage::kScan, 0.0);
  now.commissioned = false;
  EXPECT_THAT(guide(now).why_not("next"), HasSubstr("not commissioned"));
  now.needs_commissioning = false;
  EXPECT_THAT(guide(now).why_not("next"), IsEmpty());
  now.calibrated = false;
  EXPECT_THAT(guide(now).why_not("next"), HasSubstr("not calibrated"));
  now.has_projector = false;
  EXPECT_THAT(guide(now).why_not("next"), HasSubstr("no projector"));
  now = at_station(LiveStage::kCommission, 0.0);
  now.calibrated = false;
  for (StationShots& one : *now.stations) one.cross_taken = true;
  EXPECT_THAT(guide(now).why_not("finish"), HasSubstr("not calibrated"));
}

TEST(Guidance, WhileSomethingRunsNothingElseBegins) {
  Situation now = at_station(LiveStage::kScan, 0.0);
  EXPECT_THAT(guide(now).why_not("cancel"), HasSubstr("nothing is running"));
  now.last = "scan x0";
  now.last_station = "x0";
  now.computing = "scan x0";
  Guidance guidance = guide(now);
  EXPECT_THAT(guidance.why_not("next"), IsEmpty()) << "the next station may be taken while one is computed";
  EXPECT_THAT(guidance.why_not("undo"), HasSubstr("scan x0 is being computed"));
  EXPECT_THAT(guidance.why_not("cancel"), IsEmpty());
  now.taking = "scan x500";
  guidance = guide(now);
  EXPECT_THAT(guidance.why_not("next"), HasSubstr("scan x500 is being taken"));
  EXPECT_THAT(guidance.instruction, HasSubstr("Do not move"));
}

TEST(Guidance, AllTakenIsTheTimeToFinish) {
  Situation now = at_station(LiveStage::kScan, 0.0);
  now.stations->front().scan_taken = true;
  EXPECT_THAT(guide(now).why_not("finish"), HasSubstr("1 of 2 stations is missing"));
  now.stations->back().scan_taken = true;
  const Guidance guidance = guide(now);
  EXPECT_THAT(guidance.why_not("finish"), IsEmpty());
  EXPECT_THAT(guidance.why_not("next"), HasSubstr("choose one to take it again"));
  EXPECT_EQ(guidance.have, 2);
}

TEST(LiveStatus, IsOneLineOfJsonWhateverItHolds) {
  LiveStatus status;
  status.job_name = "a\nb \xFF \"c\"";
  status.axis.position_mm = std::nan("");
  status.permissions = {{"next", "not now"}, {"undo", ""}};
  status.markers.push_back({.id = 7, .doubtful = true, .left = true});
  status.stations.push_back({.name = "x0", .axis_mm = 1.5, .epipolar_px = 0.03});
  const std::string json = status_json(status);
  EXPECT_EQ(json.find('\n'), std::string::npos);
  for (const char* part : {R"("format":"crosstie-live/1")", R"("can":{"next":false,"undo":true})", R"("next":"not now")",
                           R"("position_mm":null)", R"("state":"doubtful","left":true,"right":false,"xyz_mm":null)",
                           R"("drift":[{"station":"x0","epipolar_px":0.03,"sigma_px":null}])", R"("board":null)"}) {
    EXPECT_THAT(json, HasSubstr(part));
  }
}

}  // namespace
}  // namespace crosstie::app
