#include "base/point_list.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/measured_data.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::HasSubstr;
using tests::TemporaryFolder;

Result<PointList> list_of(const std::string& text, const PointListOptions& options = {}) {
  const TemporaryFolder folder;
  return read_point_list(folder.write("points.csv", text), options);
}

TEST(PointList, ReadsMillimetresSortedById) {
  const auto list = list_of("name,id,x_mm,y_mm,z_mm\nb,20,1,2,3\na,3,4,5,6.5\nc,0,7,8,9\n");
  ASSERT_TRUE(list) << list.error().message;
  ASSERT_EQ(list->points.size(), 3U);
  EXPECT_EQ(list->points[0].id, 0);
  EXPECT_EQ(list->points[1].xyz_mm, Eigen::Vector3d(4, 5, 6.5));
  EXPECT_FALSE(list->points[0].cov_mm2);
  EXPECT_EQ(list->find(20)->xyz_mm.x(), 1.0);
  EXPECT_EQ(list->find(4), nullptr);
}

TEST(PointList, ConvertsStatedUnits) {
  const auto metres = list_of("id x_m y_m z_m sigma_x_m sigma_y_m sigma_z_m\n1 0.5 1 2 0.001 0.002 0.003\n");
  ASSERT_TRUE(metres) << metres.error().message;
  EXPECT_EQ(metres->points[0].xyz_mm, Eigen::Vector3d(500, 1000, 2000));
  EXPECT_NEAR((*metres->points[0].cov_mm2)(2, 2), 9.0, 1e-12);
  const auto inches = list_of("id;x;y;z\n1;1;2;3\n", {.unit = "inch"});
  ASSERT_TRUE(inches) << inches.error().message;
  EXPECT_NEAR(inches->points[0].xyz_mm.y(), 50.8, 1e-12);
}

TEST(PointList, UnitsAreNeverGuessed) {
  const auto silent = list_of("id,x,y,z\n1,2,3,4\n");
  ASSERT_FALSE(silent);
  EXPECT_THAT(silent.error().message, HasSubstr("unit"));
  EXPECT_FALSE(list_of("id,x_mm,y_mm,z_mm\n1,2,3,4\n", {.unit = "m"})) << "contradiction";
  EXPECT_FALSE(list_of("id,x_mm,y_m,z_mm\n1,2,3,4\n")) << "mixed";
  EXPECT_FALSE(list_of("id,x_mm,y_mm,z_mm,x_m,y_m,z_m\n1,2,3,4,5,6,7\n")) << "two units";
  const auto cubits = list_of("id,x,y,z\n1,2,3,4\n", {.unit = "cubit"});
  ASSERT_FALSE(cubits);
  EXPECT_EQ(cubits.error().code, ErrorCode::kUsage);
  EXPECT_FALSE(list_of(" 1 1.5 2.5 3.5 fix fix fix 12 0\n", {.unit = "m"})) << "object lists are in mm";
}

TEST(PointList, ReadsCovariances) {
  const auto list =
      list_of("id,x_mm,y_mm,z_mm,cov_xx_mm2,cov_xy_mm2,cov_xz_mm2,cov_yy_mm2,cov_yz_mm2,cov_zz_mm2\n1,0,0,0,4,1,0,5,2,6\n");
  ASSERT_TRUE(list) << list.error().message;
  Eigen::Matrix3d expected;
  expected << 4, 1, 0, 1, 5, 2, 0, 2, 6;
  EXPECT_EQ(*list->points[0].cov_mm2, expected);
}

TEST(PointList, RefusesWithFileAndLine) {
  struct Case {
    const char* text;
    const char* message;
  };
  const Case cases[] = {
      {"id,x_mm,y_mm,z_mm\n1,0,0,0\n2,0,0,0\n1,1,1,1\n", "points.csv:4: id 1 stands already in line 2"},
      {"id,x_mm,y_mm,z_mm\n-1,0,0,0\n", "points.csv:2: id -1"},
      {"id,x_mm,y_mm,z_mm\nP7,0,0,0\n", "points.csv:2: id reads \"P7\""},
      {"id,x_mm,y_mm,z_mm\n1,nan,0,0\n", "points.csv:2: x_mm"},
      {"id,x_mm,y_mm,z_mm\n1,0,inf,0\n", "points.csv:2: y_mm"},
      {"id,x_m,y_m,z_m\n1,1e308,0,0\n", "points.csv:2: a value is too large"},
      {"id;x_mm;y_mm;z_mm\n1;1,5;0;0\n", "decimal"},
      {"id,x_mm,y_mm,z_mm\n1,1,5,0,0\n", "points.csv:2: too many cells"},
      {"id,x_mm,y_mm\n1,0,0\n", "column z_mm is missing"},
      {"nr,x_mm,y_mm,z_mm\n1,0,0,0\n", "column id is missing"},
      {"id,x_mm,y_mm,z_mm,sigma_x_mm\n1,0,0,0,1\n", "sigma_y_mm is missing"},
      {"id,x_mm,y_mm,z_mm,sigma_xmm,sigma_ymm,sigma_zmm\n1,0,0,0,1,1,1\n", "did you mean sigma_x_mm"},
      {"id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n1,0,0,0,1,-1,1\n", "sigma is negative"},
      {"id,x_mm,y_mm,z_mm,cov_xx_mm2,cov_xy_mm2,cov_xz_mm2,cov_yy_mm2,cov_yz_mm2,cov_zz_mm2\n1,0,0,0,1,2,0,1,0,1\n",
       "semidefinite"},
      {"1 2 3 4\n", "must name the columns"},
      {"1,2,3,4,5,6,7,8,9\n", "must name the columns"},
      {"1 1.5 2.5 3.5 0.1 0.1 0.1 12 1\n2 1.5 2.5 3.5 0.1 0.1 0.1\n", "points.csv:2: an object list has 9 to 11 cells"},
      {"1 1.5 2.5 3.5 0.1 fix 0.1 12 1\n", "some of the three"},
      {"1 1.5 2.5 3.5 0.1 0.1 0.1 12 1\n2 1,5 2.5 3.5 0.1 0.1 0.1 12 1\n", "points.csv:2: \"1,5\" is no finite number"},
      {"1 1.5 2.5 3.5 0.1 0.1 0.1 12 1\n1 1.5 2.5 3.5 0.1 0.1 0.1 12 1\n", "points.csv:2: id 1 stands already"},
      {"1.5 1.5 2.5 3.5 0.1 0.1 0.1 12 1\n", "is no id"},
      {"1 1.5 2.5 3.5 0.1 0.1 -0.1 12 1\n", "is no sigma"},
  };
  for (const Case& c : cases) {
    const auto list = list_of(c.text);
    ASSERT_FALSE(list) << c.text;
    EXPECT_EQ(list.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(list.error().message, HasSubstr(c.message)) << c.text;
  }
}

TEST(PointList, ReadsObjectLists) {
  const auto all_off = list_of(
      "   2   -0.2000   -0.1216   -0.3116   fix   fix   fix   99   0\r\n  3  81.9931  -0.8711  -0.2881  fix fix fix 124 0\r\n");
  ASSERT_TRUE(all_off) << all_off.error().message;
  ASSERT_EQ(all_off->points.size(), 2U) << "a flag that is set nowhere means nothing";
  EXPECT_FALSE(all_off->points[0].cov_mm2);
  EXPECT_EQ(all_off->points[1].xyz_mm.x(), 81.9931);

  const auto some_off = list_of(" 6 573.0039 -49.4291 -121.6922 0.0026 0.0029 0.0035 66 1 1 0\n 7 1 2 3 0.1 0.1 0.1 2 0 1 0\n");
  ASSERT_TRUE(some_off) << some_off.error().message;
  ASSERT_EQ(some_off->points.size(), 1U) << "7 took no part";
  EXPECT_NEAR((*some_off->points[0].cov_mm2)(1, 1), 0.0029 * 0.0029, 1e-18);
}

TEST(PointList, ReadsAiconsOwnFiles) {
  const auto panel = tests::measured_data("aicon-panel");
  const auto network = tests::measured_data("aicon-network");
  if (panel.empty() || network.empty()) GTEST_SKIP() << "no aicon-panel and aicon-network in CROSSTIE_DATA";
  const auto positions = read_point_list(panel / "Positions-3D-14bit_lookup.txt");
  ASSERT_TRUE(positions) << positions.error().message;
  for (int id = 2; id <= 74; ++id) EXPECT_NE(positions->find(id), nullptr) << id;
  EXPECT_EQ(positions->find(1), nullptr);
  EXPECT_EQ(positions->find(2)->xyz_mm, Eigen::Vector3d(-0.2, -0.1216, -0.3116));
  EXPECT_FALSE(positions->find(2)->cov_mm2);

  const auto objects = read_point_list(network / "example.obc");
  ASSERT_TRUE(objects) << objects.error().message;
  EXPECT_EQ(objects->points.size(), 150U);
  for (const int off : {1017, 1075, 1093, 1094, 1096, 1097, 1101}) EXPECT_EQ(objects->find(off), nullptr) << off;
  ASSERT_NE(objects->find(6), nullptr);
  EXPECT_NEAR((*objects->find(6)->cov_mm2)(2, 2), 0.0035 * 0.0035, 1e-18);
}

TEST(PointList, WhatIsWrittenReadsBack) {
  const TemporaryFolder folder;
  PointList list;
  for (int id : {3, 17, 2000}) {
    ReferencePoint point;
    point.id = id;
    point.xyz_mm = {0.1 * id, std::sqrt(2.0) * 1e3, -1e-7};
    list.points.push_back(point);
  }
  const auto write_and_read = [&] {
    EXPECT_TRUE(write_point_list(folder / "list.csv", list));
    const auto again = read_point_list(folder / "list.csv");
    EXPECT_TRUE(again) << again.error().message;
    return *again;
  };
  PointList again = write_and_read();
  EXPECT_FALSE(again.points[1].cov_mm2);
  EXPECT_EQ(again.points[1].xyz_mm, list.points[1].xyz_mm);

  for (auto& point : list.points) point.cov_mm2 = Eigen::Vector3d(1e-4, 2e-4, 3e-4).asDiagonal();
  again = write_and_read();
  EXPECT_LT((*again.points[0].cov_mm2 - *list.points[0].cov_mm2).norm(), 1e-19);
  EXPECT_EQ(tests::read_all(folder / "list.csv").find("cov_"), std::string::npos);

  (*list.points[2].cov_mm2)(0, 1) = (*list.points[2].cov_mm2)(1, 0) = 5e-5;
  again = write_and_read();
  EXPECT_EQ(*again.points[2].cov_mm2, *list.points[2].cov_mm2);

  list.points[0].cov_mm2.reset();  // then none is written
  again = write_and_read();
  EXPECT_FALSE(again.points[2].cov_mm2);
}

TEST(ScaleBars, AreReadWithDefaults) {
  const TemporaryFolder folder;
  const auto bars = read_scale_bars(folder.write("bars.csv",
                                                 "id_a,id_b,length_mm,sigma_mm,temperature_c,cte_per_k,role,certificate\n"
                                                 "11,52,1000.012,0.005,24.5,1.2e-6,check,\"DKD 4711, 2025\"\n"
                                                 "53,54,999.9,0.005,,,,\n"));
  ASSERT_TRUE(bars) << bars.error().message;
  EXPECT_EQ((*bars)[0].role, ScaleBarRole::kCheck);
  EXPECT_EQ((*bars)[0].certificate, "DKD 4711, 2025");
  EXPECT_NEAR((*bars)[0].length_at_temperature_mm(), 1000.012 * (1.0 + 1.2e-6 * 4.5), 1e-12);
  EXPECT_EQ((*bars)[1].role, ScaleBarRole::kUsed);
  EXPECT_EQ((*bars)[1].temperature_c, 20.0);
  ASSERT_TRUE(write_scale_bars(folder / "again.csv", *bars));
  const auto again = read_scale_bars(folder / "again.csv");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ((*again)[0].certificate, (*bars)[0].certificate);
  EXPECT_EQ((*again)[0].cte_per_k, 1.2e-6);
}

TEST(ScaleBars, AreRefusedWithFileAndLine) {
  const std::string header = "id_a,id_b,length_mm,sigma_mm,temperature_c,cte_per_k,role\n";
  const std::pair<std::string, const char*> cases[] = {
      {header + "1,1,1000,0.01,20,0,used\n", "bars.csv:2: both ends"},
      {header + "1,2,-5,0.01,20,0,used\n", "length_mm must be positive"},
      {header + "1,2,1000,0,20,0,used\n", "sigma_mm"},
      {header + "1,2,1000,-1,20,0,check\n", "sigma_mm is negative"},
      {header + "1,2,1000,0.01,20,11.5,used\n", "cte_per_k is implausible"},
      {header + "1,2,1000,0.01,293,0,used\n", "temperature_c is implausible"},
      {header + "1,2,1000,0.01,20,0,control\n", "role \"control\""},
      {header + "1,2,1000,0.01,20,0,used\n2,1,1001,0.01,20,0,used\n", "bars.csv:3: the bar 2-1 stands already"},
      {header + "1,2,nan,0.01,20,0,used\n", "bars.csv:2: length_mm"},
      {header + "-1,2,1000,0.01,20,0,used\n", "ids are 0 or larger"},
      {"id_a,id_b,length_mm\n1,2,3\n", "sigma_mm is missing"},
      {"id_a,id_b,length_inch,sigma_mm\n1,2,3,4\n", "unknown column length_inch"},
      {"id_a,id_b,lenght_mm,sigma_mm\n1,2,3,4\n", "did you mean length_mm"},
  };
  const TemporaryFolder folder;
  for (const auto& [text, message] : cases) {
    const auto bars = read_scale_bars(folder.write("bars.csv", text));
    ASSERT_FALSE(bars) << text;
    EXPECT_THAT(bars.error().message, HasSubstr(message)) << text;
  }
}

}  // namespace
}  // namespace crosstie::base
