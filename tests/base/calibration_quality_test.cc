#include "base/calibration_quality.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/synthetic_calibration.h"
#include "tests/support/synthetic_quality.h"

namespace crosstie::base {
namespace {

TEST(CalibrationQuality, ItsKeysAreNullWhereThereIsNone) {
  const auto json = calibration_quality_json({}, {"left", "right"});
  EXPECT_TRUE(json.at("uncertainty").is_null());
  EXPECT_TRUE(json.at("change").is_null());
  EXPECT_EQ(json.at("epipolar").size(), 0U);
}

TEST(CalibrationQuality, HoldsUncertaintyPairsAndChange) {
  const Calibration calibration = crosstie::tests::synthetic_calibration();
  const auto json = calibration_quality_json(crosstie::tests::synthetic_quality(calibration), {"left", "right"});
  EXPECT_EQ(json.at("uncertainty").at("distance_mm"), 480.0);
  EXPECT_EQ(json.at("uncertainty").at("cameras").at(1).at("name"), "right");
  const auto& sigma = json.at("uncertainty").at("cameras").at(0).at("sigma_px");
  EXPECT_LT(sigma.at("median").get<double>(), sigma.at("max").get<double>());
  EXPECT_TRUE(json.at("uncertainty").at("points_on_boards").at("sigma_depth_mm").at("p95").is_number());
  EXPECT_EQ(json.at("epipolar").size(), calibration.stations.size());
  EXPECT_EQ(json.at("change").at("rig").at("change").size(), 6U);
  EXPECT_EQ(json.at("change").at("cameras").at(0).at("limit_px"), 0.09);
  EXPECT_NE(json.at("change").at("cameras").at(1).at("failure"), "");
}

TEST(MapFigures, CountWhatCountsAndIsKnown) {
  Eigen::VectorXd values(6);
  values << 5.0, 1.0, std::nan(""), 2.0, 3.0, 99.0;
  const MapFigures figures = map_figures(values, {1, 1, 1, 1, 1, 0});
  EXPECT_EQ(figures.median, 2.0);  // the smallest that half of 1 2 3 5 do not exceed
  EXPECT_EQ(figures.p95, 5.0);
  EXPECT_EQ(figures.max, 5.0);
  EXPECT_TRUE(std::isnan(map_figures(values, {0, 0, 1, 0, 0, 0}).median));
}

}  // namespace
}  // namespace crosstie::base
