// The state as the page reads it: every key of docs/live.md, whatever is known, and nothing that is no JSON.
#include <cmath>
#include <limits>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "app/live/live_status.h"

namespace crosstie::app {
namespace {

using nlohmann::json;
using Keys = std::set<std::string>;

Keys keys_of(const json& object) {
  Keys keys;
  for (const auto& [key, value] : object.items()) keys.insert(key);
  return keys;
}

const Keys kKeys = {"format",   "sequence", "time",   "job",     "stage", "stages",   "instruction",   "can",
                    "why_not",  "cameras",  "pairs",  "markers", "frame", "needed",   "axis",          "board",
                    "stations", "work",     "health", "drift",   "gaps",  "verdicts", "scene_version", "log"};
const Keys kCameraKeys = {"side",    "name",       "running",   "trouble",    "frames",     "dropped", "lost",
                          "swapped", "incomplete", "rate_hz",   "latency_ms", "exposure_s", "gain",    "temperature_c",
                          "warming", "width_px",   "height_px", "histogram",  "saturated",  "dark",    "focus",
                          "blur_px", "coded",      "uncoded",   "doubtful"};

LiveStatus full_status() {
  LiveStatus status;
  status.sequence = 41;
  status.time = "2026-11-28T11:20:03Z";
  status.job_name = "door frame, segment 3";
  status.job_folder = "segment";
  status.stage = LiveStage::kCommission;
  for (const LiveStage stage : {LiveStage::kCalibrate, LiveStage::kCommission, LiveStage::kScan})
    status.stages.push_back({.stage = stage, .state = "begun", .have = 2, .want = 5, .summary = "", .report = ""});
  status.stages[0].report = "results/calibrate/report.html";
  status.instruction = "Move the beam to X = 850 mm and press Next.";
  for (const char* name : {"next", "repeat", "undo", "finish", "cancel", "check"}) status.permissions.push_back({name, ""});
  status.permissions[1].why_not = "nothing was taken yet";
  status.cameras[0] = {.side = "left",
                       .name = "L",
                       .running = true,
                       .trouble = "",
                       .frames = 1234,
                       .latency_ms = 43.0,
                       .exposure_s = 0.01,
                       .temperature_c = 41.2,
                       .width_px = 1224,
                       .height_px = 1024,
                       .focus = 0.83,
                       .blur_px = 0.6,
                       .coded = 12,
                       .uncoded = 3,
                       .doubtful = 1};
  status.cameras[0].histogram[63] = 0.5F;
  status.cameras[1].side = "right";
  status.pairs = 1230;
  status.unmatched = 1;
  status.contradicted = 2;
  status.markers = {{.id = 12,
                     .left = true,
                     .right = true,
                     .xyz_mm = Eigen::Vector3d(1.0, 2.0, 3.0),
                     .sigma_mm = Eigen::Vector3d(0.01, 0.02, 0.03),
                     .w = 1.1},
                    {.id = 17, .doubtful = true}};
  status.frame = "machine";
  status.needed = NeededMarkers{.want = 5, .seen = 4, .missing = {17}};
  status.axis = {.source = "typed in", .typed = true, .position_mm = 850.04, .age_s = 2.1, .fresh = true, .trouble = ""};
  BoardStatus board;
  board.columns = 8;
  board.rows = 6;
  board.counts = {std::vector<int>(48, 1), std::vector<int>(48, 2)};
  board.poses = 12;
  board.tilted_left = 1;
  board.tilted_right = 2;
  board.tilted_up = 3;
  board.tilted_down = 4;
  board.rolled = 5;
  board.wanted = "Tilt the board.";
  board.cell = std::array<int, 2>{7, 0};
  board.cell_side = "right";
  status.board = board;
  status.stations = {{.name = "x0850",
                      .axis_mm = 850.0,
                      .measured_mm = 850.04,
                      .cross = "taken",
                      .scan = "done",
                      .epipolar_px = 0.031,
                      .epipolar_sigma_px = 0.002,
                      .current = true},
                     {.name = "x1700", .axis_mm = 1700.0, .cross = "missing", .scan = "none"}};
  status.work = WorkStatus{.what = "scan x0850", .stage = "decoding", .done = 3, .total = 18, .seconds = 4.2};
  status.health = {.level = "OK", .text = "head unchanged"};
  status.gaps = GapStatus{.count = 1, .length_mm = 83.0, .coverage = 0.96};
  status.verdicts = {{"seam_mm", 0.02, 0.1, "mm", "job.toml", base::VerdictLevel::kWarning}};
  status.scene_version = 7;
  status.log = {{"11:20:03", "warning", "text"}};
  return status;
}

TEST(LiveStatusJson, HasEveryKeyAndNullWhereNothingIsKnown) {
  const json empty = json::parse(status_json({}));
  EXPECT_EQ(keys_of(empty), kKeys);
  for (const char* key : {"frame", "needed", "board", "work", "gaps"}) EXPECT_TRUE(empty[key].is_null()) << key;
  for (const char* key : {"stages", "markers", "stations", "drift", "verdicts", "log"})
    EXPECT_EQ(empty[key], json::array()) << key;
  ASSERT_EQ(empty["cameras"].size(), 2U);
  EXPECT_EQ(keys_of(empty["cameras"][0]), kCameraKeys);
  for (const char* key : {"latency_ms", "temperature_c", "focus", "blur_px"})
    EXPECT_TRUE(empty["cameras"][0][key].is_null()) << key;
  EXPECT_EQ(empty["cameras"][0]["histogram"], json(std::vector<int>(64, 0)));
  EXPECT_EQ(empty["axis"],
            json::parse(R"({"source":"","typed":false,"position_mm":null,"age_s":null,"fresh":false,"trouble":""})"));
  EXPECT_EQ(empty["health"], json::parse(R"({"level":"NONE","text":""})"));
  EXPECT_EQ(empty["can"], json::object());
}

TEST(LiveStatusJson, SaysWhatIsKnown) {
  const json state = json::parse(status_json(full_status()));
  EXPECT_EQ(keys_of(state), kKeys);
  EXPECT_EQ(state["format"], "crosstie-live/1");
  EXPECT_EQ(state["sequence"], 41);
  EXPECT_EQ(state["time"], "2026-11-28T11:20:03Z");
  EXPECT_EQ(state["job"], json::parse(R"({"name":"door frame, segment 3","folder":"segment"})"));
  EXPECT_EQ(state["stage"], "commission");
  EXPECT_EQ(state["stages"][0],
            json::parse(R"({"name":"calibrate","title":"Calibrate the cameras","state":"begun","have":2,"want":5,"summary":"",)"
                        R"("report":"results/calibrate/report.html"})"));
  EXPECT_TRUE(state["stages"][1]["report"].is_null());
  EXPECT_EQ(state["stages"][2]["name"], "scan");
  EXPECT_EQ(keys_of(state["can"]), (Keys{"next", "repeat", "undo", "finish", "cancel", "check"}));
  EXPECT_EQ(keys_of(state["why_not"]), keys_of(state["can"]));
  EXPECT_EQ(state["can"]["next"], true);
  EXPECT_EQ(state["can"]["repeat"], false);
  EXPECT_EQ(state["why_not"]["repeat"], "nothing was taken yet");
  const json& camera = state["cameras"][0];
  EXPECT_EQ(keys_of(camera), kCameraKeys);
  EXPECT_EQ(camera["side"], "left");
  EXPECT_EQ(camera["frames"], 1234);
  EXPECT_EQ(camera["temperature_c"], 41.2);
  ASSERT_EQ(camera["histogram"].size(), 64U);
  EXPECT_EQ(camera["histogram"][63], 0.5);
  EXPECT_EQ(state["pairs"], json::parse(R"({"count":1230,"unmatched":1,"contradicted":2})"));
  EXPECT_EQ(state["markers"][0], json::parse(R"({"id":12,"state":"coded","left":true,"right":true,"xyz_mm":[1.0,2.0,3.0],)"
                                             R"("sigma_mm":[0.01,0.02,0.03],"w":1.1})"));
  EXPECT_EQ(state["markers"][1], json::parse(R"({"id":17,"state":"doubtful","left":false,"right":false,"xyz_mm":null,)"
                                             R"("sigma_mm":null,"w":null})"));
  EXPECT_EQ(state["frame"], "machine");
  EXPECT_EQ(state["needed"], json::parse(R"({"want":5,"seen":4,"missing":[17]})"));
  EXPECT_EQ(state["axis"],
            json::parse(R"({"source":"typed in","typed":true,"position_mm":850.04,"age_s":2.1,"fresh":true,"trouble":""})"));
  const json& board = state["board"];
  EXPECT_EQ(keys_of(board), (Keys{"columns", "rows", "left", "right", "poses", "tilts", "wanted", "cell", "cell_side"}));
  EXPECT_EQ(board["left"], json(std::vector<int>(48, 1)));
  EXPECT_EQ(board["right"], json(std::vector<int>(48, 2)));
  EXPECT_EQ(board["tilts"], json::parse(R"({"left":1,"right":2,"up":3,"down":4,"rolled":5})"));
  EXPECT_EQ(board["cell"], json::parse("[7,0]"));
  EXPECT_EQ(board["cell_side"], "right");
  EXPECT_EQ(state["stations"][0], json::parse(R"({"name":"x0850","axis_mm":850.0,"measured_mm":850.04,"cross":"taken",)"
                                              R"("scan":"done","epipolar_px":0.031,"current":true})"));
  EXPECT_TRUE(state["stations"][1]["measured_mm"].is_null());
  EXPECT_EQ(state["work"], json::parse(R"({"what":"scan x0850","stage":"decoding","done":3,"total":18,"seconds":4.2})"));
  EXPECT_EQ(state["health"], json::parse(R"({"level":"OK","text":"head unchanged"})"));
  EXPECT_EQ(state["drift"], json::parse(R"([{"station":"x0850","epipolar_px":0.031,"sigma_px":0.002}])"));
  EXPECT_EQ(state["gaps"], json::parse(R"({"count":1,"length_mm":83.0,"coverage":0.96})"));
  EXPECT_EQ(state["verdicts"], json::parse(R"([{"name":"seam_mm","value":0.02,"limit":0.1,"unit":"mm","source":"job.toml",)"
                                           R"("level":"WARNING"}])"));
  EXPECT_EQ(state["scene_version"], 7);
  EXPECT_EQ(state["log"], json::parse(R"([{"time":"11:20:03","level":"warning","text":"text"}])"));
}

TEST(LiveStatusJson, NumbersThatAreNotFiniteAreNullWhereverTheyStand) {
  LiveStatus status = full_status();
  for (const double value : {std::nan(""), std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()}) {
    status.cameras[0].rate_hz = value;
    status.cameras[0].latency_ms = value;
    status.cameras[0].histogram[5] = static_cast<float>(value);
    status.markers[0].xyz_mm->y() = value;
    status.markers[0].w = value;
    status.axis.age_s = value;
    status.stations[0].epipolar_sigma_px = value;
    status.work->seconds = value;
    status.gaps->coverage = value;
    status.verdicts[0].value = value;
    const json state = json::parse(status_json(status));
    EXPECT_TRUE(state["cameras"][0]["rate_hz"].is_null());
    EXPECT_TRUE(state["cameras"][0]["latency_ms"].is_null());
    EXPECT_TRUE(state["cameras"][0]["histogram"][5].is_null());
    EXPECT_TRUE(state["markers"][0]["xyz_mm"][1].is_null());
    EXPECT_EQ(state["markers"][0]["xyz_mm"][2], 3.0);
    EXPECT_TRUE(state["markers"][0]["w"].is_null());
    EXPECT_TRUE(state["axis"]["age_s"].is_null());
    EXPECT_TRUE(state["drift"][0]["sigma_px"].is_null());
    EXPECT_TRUE(state["work"]["seconds"].is_null());
    EXPECT_TRUE(state["gaps"]["coverage"].is_null());
    EXPECT_TRUE(state["verdicts"][0]["value"].is_null());
  }
}

TEST(LiveStatusJson, TextOfAnyBytesIsShownAndNothingElseIsLost) {
  LiveStatus status = full_status();
  const std::string bytes = "a\xFF\xC3(\xE2\x82 \"</script>\\\n\x01z";
  status.job_name = status.instruction = status.log[0].text = status.cameras[1].trouble = status.permissions[0].why_not = bytes;
  const std::string text = status_json(status);
  EXPECT_EQ(text.find('\n'), std::string::npos) << "one line: an event of the stream";
  const json state = json::parse(text);
  for (const json& shown : {state["job"]["name"], state["instruction"], state["log"][0]["text"], state["cameras"][1]["trouble"],
                            state["why_not"]["next"]}) {
    const auto said = shown.get<std::string>();
    EXPECT_THAT(said, testing::StartsWith("a\xEF\xBF\xBD"));
    EXPECT_THAT(said, testing::EndsWith(" \"</script>\\\n\x01z"));
  }
  EXPECT_EQ(state["can"]["next"], false);
}

TEST(LiveStatusJson, StagesAreNamedBothWays) {
  for (const LiveStage stage : {LiveStage::kCalibrate, LiveStage::kCommission, LiveStage::kScan})
    EXPECT_EQ(live_stage_from_name(live_stage_name(stage)), stage);
  for (const char* name : {"", "Scan", "scan ", "calibrat"}) EXPECT_EQ(live_stage_from_name(name), std::nullopt) << name;
}

}  // namespace
}  // namespace crosstie::app
