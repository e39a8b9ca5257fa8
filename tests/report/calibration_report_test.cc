#include "report/calibration_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/table.h"
#include "report/calibration_tables.h"
#include "tests/report/markup.h"
#include "tests/support/synthetic_calibration.h"
#include "tests/support/synthetic_quality.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::report {
namespace {

using testing::HasSubstr;
using testing::Not;

ReportContext context() { return {"Camera calibration", "head", {"calibrate", "rig", {}, {}, {}}, "{}"}; }

TEST(CalibrationReport, ShowsWhatDecides) {
  const std::string html = calibration_report(tests::synthetic_calibration(), {}, context());
  for (const char* what : {"Baseline", "How well it predicts", "Odd against even", "LENSMODEL_OPENCV8", "chosen", "mrcal 2.2",
                           "B-17", "valid until 2027-03-01", "31.5", "Coverage of camera right", "right_15",
                           "the board was not found in it", "k = 2", "high_correlation"}) {
    EXPECT_THAT(html, HasSubstr(what));
  }
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(CalibrationReport, ShowsUncertaintyPairsAndChange) {
  const base::Calibration calibration = tests::synthetic_calibration();
  const base::CalibrationQuality quality = tests::synthetic_quality(calibration);
  const std::string html = calibration_report(calibration, quality, context());
  EXPECT_EQ(tests::markup_error(html), std::nullopt);
  for (const char* what :
       {"Uncertainty over the image", "480 mm away", "Sigma of a projection, camera right",
        "The same on the object, camera left", "Sigma of a point in the rig", "Sigma of a point against the boards",
        "Pairs of images", "Since the earlier calibration", "january/results/calibrate", "baseline (was 119.200 mm)",
        "Change over its sigma, camera left", "3 of 80 cells in common"}) {
    EXPECT_THAT(html, HasSubstr(what));
  }
  EXPECT_THAT(html, Not(HasSubstr("nan")));
  const tests::TemporaryFolder folder;
  ASSERT_TRUE(write_map_tables(folder.path(), calibration, *quality.maps));
  const auto map = base::read_table(folder / "uncertainty.csv");
  ASSERT_TRUE(map) << map.error().message;
  EXPECT_EQ(map->rows.size(), 160U);
  const auto points = base::read_table(folder / "triangulation.csv");
  ASSERT_TRUE(points) << points.error().message;
  EXPECT_EQ(points->rows.size(), 80U);
  EXPECT_EQ(points->rows[3][2], "");
}

TEST(CalibrationReport, ACameraAloneWithANominalBoardAndNoValidationSaysSo) {
  base::Calibration calibration = tests::synthetic_calibration();
  calibration.rig.reset();
  calibration.validation.reset();
  calibration.ladder.clear();
  calibration.detectors.clear();
  calibration.second_opinion.reset();
  calibration.board.board.free = false;
  const std::string html = calibration_report(calibration, {}, context());
  EXPECT_THAT(html, HasSubstr("Not validated"));
  EXPECT_THAT(html, HasSubstr("taken as nominal"));
  EXPECT_THAT(html, Not(HasSubstr("id=\"rig\"")));
}

TEST(CalibrationTables, HoldEveryCornerAndWhyItTookNoPart) {
  const tests::TemporaryFolder folder;
  const base::Calibration calibration = tests::synthetic_calibration();
  base::BoardImage image{"left_03", "left", 1280, 1024, {}};
  for (int i = 0; i < 88; ++i) image.corners.push_back({i, {10.0 + i, 20.0}, 0.0});
  base::BoardImage unseen{"right_15", "right", 1280, 1024, {{0, {1.0, 2.0}, 0.0}}};
  ASSERT_TRUE(write_calibration_tables(folder.path(), calibration, std::vector{image, unseen}));
  const auto corners = base::read_table(folder / "corners.csv");
  ASSERT_TRUE(corners) << corners.error().message;
  ASSERT_EQ(corners->rows.size(), 89U);
  const std::size_t why = *corners->column("rejected_because");
  EXPECT_THAT(corners->rows.back()[why], HasSubstr("not found"));
  const auto board = base::read_table(folder / "board.csv");
  ASSERT_TRUE(board);
  EXPECT_EQ(board->rows.size(), 88U);
}

}  // namespace
}  // namespace crosstie::report
