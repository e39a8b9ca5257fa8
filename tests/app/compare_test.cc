// The verb compare: what it reads, prints, writes and refuses.
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/camera_file.h"
#include "base/json_file.h"
#include "base/table.h"
#include "tests/app/run_verb.h"
#include "tests/support/synthetic_calibration.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using testing::HasSubstr;
using tests::TemporaryFolder;
using tests::VerbAnswer;

VerbAnswer compare(std::vector<std::string> words) {
  words.insert(words.begin(), "compare");
  return tests::run_verb(words);
}

/// Two models that differ by 2 px of focal length and principal point, with sigmas of 0.2 to 0.4 px; results' folders of both.
class Compare : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(base::write_cameramodel(a_, tests::calibrated_camera(0.0)));
    ASSERT_TRUE(base::write_cameramodel(b_, tests::calibrated_camera(2.0)));
    ASSERT_TRUE(base::write_opencv_yaml(yaml_, tests::calibrated_camera(2.0)));
    for (const char* name : {"one", "two"}) fs::create_directories(folder_ / name);
    ASSERT_TRUE(base::write_cameramodel(folder_ / "one/hand.cameramodel", tests::calibrated_camera(0.0)));
    ASSERT_TRUE(base::write_cameramodel(folder_ / "two/left.cameramodel", tests::calibrated_camera(0.0)));
    ASSERT_TRUE(base::write_cameramodel(folder_ / "two/right.cameramodel", tests::calibrated_camera(2.0)));
  }

  std::string refusal(const std::vector<std::string>& words, ErrorCode code) {
    const VerbAnswer answer = compare(words);
    if (!answer.error) return "was accepted: " + answer.out;
    EXPECT_EQ(answer.error->code, code) << answer.error->message;
    return answer.error->message;
  }

  TemporaryFolder folder_;
  std::string a_ = (folder_ / "a.cameramodel").string();
  std::string b_ = (folder_ / "b.cameramodel").string();
  std::string yaml_ = (folder_ / "b.yaml").string();
  std::string one_ = (folder_ / "one").string();
  std::string two_ = (folder_ / "two").string();
};

TEST_F(Compare, SaysWhetherTheDifferenceIsMoreThanItsPrediction) {
  const VerbAnswer differing = compare({a_, b_});
  ASSERT_FALSE(differing.error) << differing.error->message;
  EXPECT_EQ(differing.outcome, Outcome::kVerdictFailed);
  EXPECT_THAT(differing.out, HasSubstr("MORE than the covariances of both predict"));
  EXPECT_THAT(differing.out, HasSubstr("at infinity"));
  const VerbAnswer same = compare({a_, two_, "--camera", "left", "--distance-mm", "1300"});
  ASSERT_FALSE(same.error) << same.error->message;
  EXPECT_EQ(same.outcome, Outcome::kOk);
  EXPECT_THAT(same.out, HasSubstr("no more than the covariances"));
  EXPECT_THAT(same.out, HasSubstr("at 1300 mm"));
  const VerbAnswer unknown = compare({a_, yaml_});
  ASSERT_FALSE(unknown.error) << unknown.error->message;
  EXPECT_EQ(unknown.outcome, Outcome::kOk);
  EXPECT_THAT(unknown.out, HasSubstr("no prediction"));
}

TEST_F(Compare, ChoosesCamerasOfResults) {
  EXPECT_THAT(compare({one_, two_, "--camera", "hand", "--camera", "right"}).out, HasSubstr("two/right.cameramodel"));
  EXPECT_THAT(compare({two_, two_, "--camera", "left", "--camera", "right"}).out, HasSubstr("two/right.cameramodel"));
  EXPECT_THAT(compare({one_, b_}).out, HasSubstr("one/hand.cameramodel"));
  EXPECT_THAT(refusal({one_, two_}, ErrorCode::kUsage), HasSubstr("left, right"));
  EXPECT_THAT(refusal({two_, two_, "--camera", "middle"}, ErrorCode::kUsage), HasSubstr("no camera middle"));
  EXPECT_THAT(refusal({a_, b_, "--camera", "left"}, ErrorCode::kUsage), HasSubstr("1 given, 0 of A and B hold"));
  EXPECT_THAT(refusal({a_, two_, "--camera", "left", "--camera", "right"}, ErrorCode::kUsage),
              HasSubstr("2 given, 1 of A and B holds"));
}

TEST_F(Compare, WritesAResult) {
  const std::string out = (folder_ / "out").string();
  const VerbAnswer answer = compare({a_, b_, "--out", out, "--columns", "16"});
  ASSERT_FALSE(answer.error) << answer.error->message;
  const auto result = base::read_json(folder_ / "out/result.json");
  ASSERT_TRUE(result) << result.error().message;
  for (const char* key : {"format", "verb", "inputs", "options", "verdicts", "a", "b", "distance_mm", "b_from_a", "cells",
                          "rms_px", "max_px", "rms_before_px", "quantiles", "test"}) {
    EXPECT_TRUE(result->contains(key)) << key;
  }
  EXPECT_EQ((*result)["inputs"].size(), 2U);
  EXPECT_EQ((*result)["verdicts"][0]["level"], "FAIL");
  const auto table = base::read_table(folder_ / "out/difference.csv");
  ASSERT_TRUE(table) << table.error().message;
  ASSERT_EQ(table->rows.size(), 16U * 13U);
  double squares = 0.0;
  int cells = 0;
  for (std::size_t i = 0; i < table->rows.size(); ++i) {
    if (*table->integer(i, *table->column("compared")) == 0) continue;
    ++cells;
    for (const char* name : {"dx_px", "dy_px"}) squares += std::pow(*table->number(i, *table->column(name)), 2);
  }
  EXPECT_EQ(cells, (*result)["cells"]);
  EXPECT_NEAR(std::sqrt(squares / cells), (*result)["rms_px"].get<double>(), 1e-12);
  EXPECT_THAT(tests::read_all(folder_ / "out/report.html"), HasSubstr("Predicted sigma of the difference"));
}

TEST_F(Compare, RefusesWhatIsNoModel) {
  EXPECT_THAT(refusal({a_, (folder_ / "absent").string()}, ErrorCode::kFileSystem), HasSubstr("absent"));
  EXPECT_THAT(refusal({a_, folder_.write("bad.cameramodel", "{ 'lensmodel': 3 }").string()}, ErrorCode::kBadInput),
              HasSubstr("bad.cameramodel"));
  fs::create_directories(folder_ / "empty");
  EXPECT_THAT(refusal({a_, (folder_ / "empty").string()}, ErrorCode::kBadInput), HasSubstr("no camera model"));
  EXPECT_THAT(refusal({a_, b_, "--distance-mm", "0"}, ErrorCode::kUsage), HasSubstr("--distance-mm"));
  EXPECT_THAT(refusal({a_, b_, "--columns", "2"}, ErrorCode::kUsage), HasSubstr("4 to 400"));
  ASSERT_TRUE(
      base::write_cameramodel(folder_ / "small.cameramodel", *base::Camera::nominal(base::LensModel::kOpenCv5, 64, 48, 60)));
  EXPECT_THAT(refusal({a_, (folder_ / "small.cameramodel").string()}, ErrorCode::kBadInput), HasSubstr("64 x 48"));
}

}  // namespace
}  // namespace crosstie::app
