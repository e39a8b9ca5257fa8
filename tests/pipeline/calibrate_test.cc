// From corners in a file to lenses and rig through the program, held against published values of the same corners.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/calibration_reader.h"
#include "base/file.h"
#include "tests/support/measured_data.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

using testing::HasSubstr;

class CalibratePairs : public testing::Test {
 protected:
  void SetUp() override {
    if (measured_data("stereo-boards").empty()) GTEST_SKIP() << "no stereo-boards in CROSSTIE_DATA";
    corners_ = (measured_data("stereo-boards") / "opencv-corners.vnl").string();
  }

  /// The call on the 13 pairs of OpenCV's samples; `changed` options come last and win.
  ProgramRun calibrate(const std::vector<std::string>& changed = {}, const std::string& left = "left*",
                       const std::string& right = "right*", const std::string& corners = "") {
    std::vector<std::string> words = {"calibrate",      "--corners",    corners.empty() ? corners_ : corners,
                                      "--camera",       "left=" + left, "--camera",
                                      "right=" + right, "--out",        (folder_ / "out").string()};
    const auto says = [&changed](const char* option) {
      return std::find(changed.begin(), changed.end(), option) != changed.end();
    };
    for (const auto& [option, value] :
         {std::pair{"--pattern", "9x6"}, std::pair{"--pitch-mm", "25"}, std::pair{"--size", "640x480"},
          std::pair{"--lens", "opencv4"}, std::pair{"--board", "rigid"}}) {
      if (!says(option)) words.insert(words.end(), {option, value});
    }
    words.insert(words.end(), changed.begin(), changed.end());
    return run_bounded(words);
  }

  TemporaryFolder folder_;
  std::string corners_;
};

TEST_F(CalibratePairs, MeetTheValuesOnWhichOpenCvAndMrcalAgree) {
  const ProgramRun run = calibrate();
  EXPECT_THAT(run.exit_code, testing::AnyOf(0, 1)) << run.err;
  const auto read = base::read_calibration(folder_ / "out");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_NEAR(read->cameras[0].camera.focal_px().x(), 533.5625, 1e-3);
  EXPECT_NEAR(read->rig->baseline_mm, 83.183, 1e-3);
  for (const char* file : {"report.html", "corners.csv", "views.csv", "board.csv", "left.cameramodel", "right.cameramodel"}) {
    EXPECT_TRUE(std::filesystem::exists(folder_ / "out" / file)) << file;
  }
}

TEST_F(CalibratePairs, AreTheSameBytesOnOneThreadAndAnswerFromTheResultTheSecondTime) {
  calibrate({"--no-validation"});
  const std::string first = read_all(folder_ / "out/result.json");
  ASSERT_FALSE(first.empty());
  EXPECT_THAT(calibrate({"--no-validation"}).err, HasSubstr("up to date"));
  std::filesystem::remove_all(folder_ / "out");
  calibrate({"--no-validation", "--threads", "1"});
  EXPECT_EQ(read_all(folder_ / "out/result.json"), first);
}

TEST_F(CalibratePairs, RefuseWhatContradictsThem) {
  struct Case {
    std::vector<std::string> options;
    int exit_code;
    const char* message;
  };
  for (const Case& one :
       {Case{{"--pattern", "9x7"}, 3, "54"}, Case{{"--pattern", "6x9"}, 3, "columns"},
        Case{{"--pitch-mm", "0.984", "--baseline-mm", "83"}, 3, "inches"}, Case{{"--pitch-mm", "0"}, 2, "--pitch-mm"},
        Case{{"--pattern", "9"}, 2, "9x6"}, Case{{"--lens", "opencv9"}, 2, "opencv12"}, Case{{"--board", "bent"}, 2, "rigid"},
        Case{{"--bend-sigma-mm", "1"}, 2, "rigid"}}) {
    const ProgramRun run = calibrate(one.options);
    EXPECT_EQ(run.exit_code, one.exit_code) << one.message << ": " << run.err;
    EXPECT_THAT(run.err, HasSubstr(one.message));
    EXPECT_FALSE(std::filesystem::exists(folder_ / "out")) << one.message;
  }
}

TEST_F(CalibratePairs, SwappedAndUnpairedCamerasAreToldOf) {
  calibrate({"--no-validation"}, "right*", "left*");
  EXPECT_THAT(read_all(folder_ / "out/result.json"), HasSubstr("cameras_swapped"));
  calibrate({"--no-validation"}, "left0*", "right1*");
  EXPECT_THAT(read_all(folder_ / "out/result.json"), HasSubstr("no_pairs"));
}

TEST_F(CalibratePairs, OneViewIsNoCalibration) {
  const ProgramRun run = calibrate({}, "left01*", "right01*");
  EXPECT_EQ(run.exit_code, 4) << run.err;
}

TEST_F(CalibratePairs, NoImageOfACameraAndDamagedCornersAreRefused) {
  EXPECT_EQ(calibrate({}, "middle*").exit_code, 3);
  folder_.write("bad.vnl", "left01.jpg 10 20 0\nleft01.jpg ten 20 0\n");
  const ProgramRun run = calibrate({}, "left*", "right*", (folder_ / "bad.vnl").string());
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_THAT(run.err, HasSubstr("bad.vnl:2"));
}

}  // namespace
}  // namespace crosstie::tests
