// Every reason for which a command is refused, in every stage, and the order of reasons where several hold.
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/live/guidance.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr LiveStage kStages[] = {LiveStage::kCalibrate, LiveStage::kCommission, LiveStage::kScan};

/// A machine at station a of three, where nothing is in the way of anything.
Situation all_well(LiveStage stage) {
  Situation now;
  now.stage = stage;
  now.board->taken.resize(4);
  now.stations = std::vector<StationShots>{{.name = "a", .axis_mm = 100.0, .wants_cross = true, .wants_scan = true},
                                           {.name = "b", .axis_mm = 600.0, .wants_cross = true, .wants_scan = false},
                                           {.name = "c", .axis_mm = 900.0, .wants_cross = false, .wants_scan = true}};
  now.calibrated = now.commissioned = now.needs_commissioning = now.has_projector = true;
  now.axis = devices::AxisReading{100.0, {}};
  now.axis_sigma_mm = 0.005;
  now.last = "cross a";
  now.last_station = "a";
  return now;
}

StationShots& station(Situation& now, std::size_t index) { return (*now.stations)[index]; }

struct Case {
  const char* command;
  std::vector<LiveStage> stages;
  std::function<void(Situation&)> change;
  const char* why_not;
};

TEST(WhyNot, NothingIsInTheWayWhereAllIsWell) {
  for (const LiveStage stage : kStages) {
    Situation now = all_well(stage);
    const Guidance guidance = guide(now);
    for (const char* command : {"next", "repeat", "undo", "check"})
      EXPECT_THAT(guidance.why_not(command), IsEmpty()) << command << " in " << live_stage_name(stage);
    EXPECT_THAT(guidance.why_not("fly"), HasSubstr("no such command"));
    EXPECT_THAT(guidance.why_not("cancel"), Not(IsEmpty()));
    for (StationShots& one : *now.stations) one.cross_taken = one.scan_taken = true;
    EXPECT_THAT(guide(now).why_not("finish"), IsEmpty());
  }
}

TEST(WhyNot, EachReasonIsToldOfEachCommand) {
  const std::vector<LiveStage> all(std::begin(kStages), std::end(kStages));
  const std::vector<LiveStage> at_stations = {LiveStage::kCommission, LiveStage::kScan};
  const auto taking = [](Situation& now) { now.taking = "cross b"; };
  const auto computing = [](Situation& now) { now.computing = "commission"; };
  const auto lost = [](Situation& now) { now.cameras_trouble = "the left camera is lost"; };
  const auto silent = [](Situation& now) { now.axis = base::fail(ErrorCode::kDevice, "no reading yet"); };
  const auto far = [](Situation& now) { now.axis = devices::AxisReading{120.1, {}}; };
  const auto all_taken = [](Situation& now) {
    for (StationShots& one : *now.stations) one.cross_taken = one.scan_taken = true;
  };
  const auto no_stations = [](Situation& now) { now.stations->clear(); };
  const auto broken_stations = [](Situation& now) { now.stations = base::fail(ErrorCode::kBadInput, "no manifest"); };
  const auto not_commissioned = [](Situation& now) { now.commissioned = false; };
  const std::vector<Case> cases = {
      {"next", all, taking, "cross b is being taken"},
      {"next", all, lost, "the left camera is lost"},
      {"next", at_stations, silent, "no reading yet"},
      {"next", at_stations, far, "the beam stands at X = 120.1 mm, station a is at 100.0 mm"},
      {"next", at_stations, all_taken, "all stations are taken; choose one"},
      {"next", at_stations, no_stations, "the job has no station for this"},
      {"next", at_stations, broken_stations, "no manifest"},
      {"next",
       {LiveStage::kCalibrate},
       [](Situation& now) { now.board = base::fail(ErrorCode::kBadInput, "no [board]"); },
       "no [board]"},
      {"next", {LiveStage::kScan}, [](Situation& now) { now.has_projector = false; }, "there is no projector"},
      {"next", {LiveStage::kScan}, [](Situation& now) { now.calibrated = false; }, "the cameras are not calibrated yet"},
      {"next", {LiveStage::kScan}, not_commissioned, "the machine is not commissioned yet"},
      {"next",
       {LiveStage::kScan},
       [](Situation& now) { station(now, 0).cross_taken = true, now.axis->position_mm = 100.1; },
       "0.100 mm from where station a was photographed already"},
      {"next",
       {LiveStage::kCommission},
       [](Situation& now) { station(now, 0).scan_taken = true, now.axis->position_mm = 99.9; },
       "0.100 mm from where station a was photographed already"},
      {"repeat", all, taking, "cross b is being taken"},
      {"repeat", all, computing, "commission is being computed; wait, or cancel it"},
      {"repeat", all, [](Situation& now) { now.last.clear(); }, "nothing was taken yet that could be repeated"},
      {"repeat", all, lost, "the left camera is lost"},
      {"repeat", at_stations, silent, "no reading yet"},
      {"repeat", at_stations, far, "station a is at 100.0 mm"},
      {"repeat", {LiveStage::kScan}, [](Situation& now) { now.has_projector = false; }, "there is no projector"},
      {"undo", all, taking, "cross b is being taken"},
      {"undo", all, computing, "commission is being computed"},
      {"undo", all, [](Situation& now) { now.last.clear(); }, "nothing was taken yet that could be undone"},
      {"finish", all, taking, "cross b is being taken"},
      {"finish", all, computing, "commission is being computed"},
      {"finish",
       {LiveStage::kCalibrate},
       [](Situation& now) { now.board->taken.resize(2); },
       "2 pairs of the board are too few"},
      {"finish", {LiveStage::kCommission}, [](Situation& now) { now.calibrated = false; }, "not calibrated"},
      {"finish", {LiveStage::kScan}, not_commissioned, "not commissioned"},
      {"finish", at_stations, [](Situation&) {}, "2 of 2 stations are missing"},
      {"finish", at_stations, [](Situation& now) { station(now, 0).cross_taken = station(now, 0).scan_taken = true; },
       "1 of 2 stations is missing"},
      {"finish", at_stations, no_stations, "the job has no station for this"},
      {"check", all, not_commissioned, "not commissioned"},
      {"check", all, computing, "commission is being computed"},
      {"check", all, taking, "cross b is being taken"},
      {"check", all, lost, "the left camera is lost"},
      {"check", all, silent, "no reading yet"},
  };
  for (const Case& one : cases) {
    for (const LiveStage stage : one.stages) {
      Situation now = all_well(stage);
      one.change(now);
      const Guidance guidance = guide(now);
      EXPECT_THAT(guidance.why_not(one.command), HasSubstr(one.why_not)) << one.command << " in " << live_stage_name(stage);
      EXPECT_THAT(guidance.instruction, Not(IsEmpty()));
      EXPECT_EQ(guidance.permissions.size(), 6U);
    }
  }
}

TEST(WhyNot, WhatNeedsNoCameraOrBeamIsNotHeldUpByThem) {
  for (const LiveStage stage : kStages) {
    Situation now = all_well(stage);
    now.cameras_trouble = "lost";
    now.axis = base::fail(ErrorCode::kDevice, "silent");
    for (StationShots& one : *now.stations) one.cross_taken = one.scan_taken = true;
    EXPECT_THAT(guide(now).why_not("undo"), IsEmpty());
    EXPECT_THAT(guide(now).why_not("finish"), IsEmpty());
    now.computing = "calibrate";
    EXPECT_THAT(guide(now).why_not("cancel"), IsEmpty());
  }
  for (const LiveStage stage : kStages) {
    Situation now = all_well(stage);
    now.computing = "scan a";
    EXPECT_THAT(guide(now).why_not("next"), IsEmpty()) << "the next one may be taken while another is computed";
  }
  Situation no_cross = all_well(LiveStage::kScan);
  no_cross.commissioned = no_cross.needs_commissioning = false;
  EXPECT_THAT(guide(no_cross).why_not("next"), IsEmpty()) << "a job without a cross is scanned in the rig's frame";
  Situation board = all_well(LiveStage::kCalibrate);
  board.axis = base::fail(ErrorCode::kDevice, "silent");
  EXPECT_THAT(guide(board).why_not("next"), IsEmpty()) << "the board is held anywhere";
  EXPECT_THAT(guide(board).why_not("repeat"), IsEmpty());
}

TEST(Stations, TheFirstThatLacksTheStagesShotElseTheChosenOne) {
  Situation now = all_well(LiveStage::kCommission);
  EXPECT_EQ(guide(now).station->name, "a");
  EXPECT_EQ(guide(now).want, 2) << "c has no cross";
  station(now, 0).cross_taken = true;
  EXPECT_EQ(guide(now).station->name, "b");
  EXPECT_EQ(guide(now).have, 1);
  now.stage = LiveStage::kScan;
  EXPECT_EQ(guide(now).station->name, "a") << "photographed, not scanned";
  station(now, 0).scan_taken = true;
  EXPECT_EQ(guide(now).station->name, "c");
  now.selected = "a";
  EXPECT_EQ(guide(now).station->name, "a") << "to be taken again";
  now.selected = "b";
  EXPECT_EQ(guide(now).station->name, "c") << "b has no scan";
  now.selected.clear();
  station(now, 2).scan_taken = true;
  EXPECT_FALSE(guide(now).station);
  now.stage = LiveStage::kCalibrate;
  EXPECT_FALSE(guide(now).station);
}

TEST(Stations, TheReachIsThatOfOneStationAndNoMore) {
  for (const double off_mm : {-kStationReach_mm, -0.1, 0.0, 19.9, kStationReach_mm}) {
    Situation now = all_well(LiveStage::kCommission);
    now.axis->position_mm += off_mm;
    EXPECT_THAT(guide(now).why_not("next"), IsEmpty()) << off_mm;
    now.axis->position_mm = 100.0 + (off_mm < 0.0 ? -1.0 : 1.0) * (kStationReach_mm + 1e-6);
    EXPECT_THAT(guide(now).why_not("next"), Not(IsEmpty()));
  }
}

TEST(Stations, OneStopIsMetWithinWhatItsReadingsExplain) {
  // Two readings of sigma s differ by sqrt(2) s; less than 0.02 mm no control shows.
  EXPECT_DOUBLE_EQ(same_stop_mm(0.0), 0.02);
  EXPECT_DOUBLE_EQ(same_stop_mm(0.003), 0.02);
  EXPECT_NEAR(same_stop_mm(0.1), 0.1 * std::sqrt(2.0) * 4.5, 1e-12);
  for (const double sigma_mm : {0.0, 0.02, 0.5}) {
    Situation now = all_well(LiveStage::kScan);
    now.axis_sigma_mm = sigma_mm;
    station(now, 0).cross_taken = true;
    now.axis->position_mm = 100.0 + 0.999 * same_stop_mm(sigma_mm);
    EXPECT_THAT(guide(now).why_not("next"), IsEmpty());
    now.axis->position_mm = 100.0 - 1.001 * same_stop_mm(sigma_mm);
    EXPECT_THAT(guide(now).why_not("next"), HasSubstr("was photographed already (100.000 mm)"));
  }
}

TEST(Instruction, SaysWhatToDoInEachState) {
  Situation now = all_well(LiveStage::kCalibrate);
  EXPECT_EQ(guide(now).instruction,
            "Hold the board before both cameras, tilted as never before. Hold it still and press Next.");
  now.board->taken.resize(kWantedPoses);
  now.wanted_pose = "Roll it.";
  EXPECT_EQ(guide(now).instruction, "Roll it. Hold it still and press Next.") << "many poses are not all poses";
  now.wanted_pose.clear();
  EXPECT_EQ(guide(now).instruction, "The cameras are calibrated. Go on with the machine.");
  now.calibrated = false;
  EXPECT_EQ(guide(now).instruction, "Enough. Press Finish to calibrate.");

  now = all_well(LiveStage::kCommission);
  EXPECT_EQ(guide(now).instruction, "Station a: do both cameras see the cross, and does it stand still? Press Next.");
  now.axis->position_mm = 300.0;
  EXPECT_EQ(guide(now).instruction, "Move the beam to X = 100.0 mm for station a.");
  now.taking = "cross a";
  EXPECT_EQ(guide(now).instruction, "Do not move: cross a is being taken.");
  now.taking.clear();
  for (StationShots& one : *now.stations) one.cross_taken = one.scan_taken = true;
  EXPECT_EQ(guide(now).instruction, "The machine is commissioned. Go on with the hole.");
  now.commissioned = false;
  EXPECT_EQ(guide(now).instruction, "All stations are taken. Press Finish to commission the machine.");
  now.stage = LiveStage::kScan;
  now.commissioned = true;
  EXPECT_EQ(guide(now).instruction, "All stations are taken. Press Finish for the hole's edge and the torch's path.");
  now.measured = true;
  EXPECT_EQ(guide(now).instruction, "The hole is measured: its report shows edge and path.");
  now.stations->clear();
  EXPECT_EQ(guide(now).instruction, "The job has no station to scan.");
  now.stage = LiveStage::kCommission;
  EXPECT_EQ(guide(now).instruction, "The job has no station with a cross.");

  now = all_well(LiveStage::kScan);
  EXPECT_EQ(guide(now).instruction, "Station a: does everything stand still? Press Next.");
  now.selected = "a";
  now.scanned = {"a"};
  EXPECT_THAT(guide(now).instruction, HasSubstr("It is scanned already."));
}

/// Moving the beam mends neither lost cameras nor a machine that is not commissioned.
TEST(Instruction, DoesNotSendTheBeamWhereItStands) {
  Situation now = all_well(LiveStage::kScan);
  now.cameras_trouble = "the left camera is lost";
  EXPECT_EQ(guide(now).instruction, "The left camera is lost.");
  now.commissioned = false;
  EXPECT_EQ(guide(now).instruction, "The machine is not commissioned yet.");
  now.calibrated = false;
  EXPECT_EQ(guide(now).instruction, "The cameras are not calibrated yet.");
  now.has_projector = false;
  EXPECT_EQ(guide(now).instruction, "There is no projector.");
  now = all_well(LiveStage::kScan);
  now.axis = base::fail(ErrorCode::kDevice, "nobody typed a position");
  EXPECT_EQ(guide(now).instruction, "Move the beam to X = 100.0 mm for station a.") << "and tell where it stands";
}

}  // namespace
}  // namespace crosstie::app
