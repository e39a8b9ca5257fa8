#include "base/aicon_files.h"

#include <algorithm>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/table.h"
#include "tests/support/measured_data.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using crosstie::tests::TemporaryFolder;
using testing::HasSubstr;

template <typename T>
long count_active(const std::vector<T>& entries) {
  return std::count_if(entries.begin(), entries.end(), [](const T& e) { return e.active; });
}

TEST(AiconFiles, ReadsARealProject) {
  const auto folder = crosstie::tests::measured_data("aicon-network");
  if (folder.empty()) GTEST_SKIP() << "no aicon-network in CROSSTIE_DATA";
  const auto observations = read_aicon_image_points(folder / "example.phc");
  const auto points = read_aicon_object_points(folder / "example.obc");
  const auto images = read_aicon_images(folder / "example.eor");
  const auto cameras = read_aicon_cameras(folder / "example.ior");
  const auto scales = read_aicon_scales(folder / "example.scale");
  ASSERT_TRUE(observations) << observations.error().message;
  ASSERT_TRUE(points) << points.error().message;
  ASSERT_TRUE(images) << images.error().message;
  ASSERT_TRUE(cameras) << cameras.error().message;
  ASSERT_TRUE(scales) << scales.error().message;

  EXPECT_EQ(observations->size(), 10366U);
  EXPECT_EQ(count_active(*observations), 9976);
  EXPECT_EQ(points->size(), 157U);
  EXPECT_EQ(count_active(*points), 150);
  EXPECT_EQ(images->size(), 115U);
  ASSERT_EQ(cameras->size(), 1U);
  const AiconCamera& camera = cameras->front();
  EXPECT_DOUBLE_EQ(camera.c_mm, 28.78507);
  EXPECT_EQ(camera.principal_point_mm, Eigen::Vector2d(0.01735, 0.05669));
  EXPECT_DOUBLE_EQ(camera.a1, -1.09607e-4);
  EXPECT_DOUBLE_EQ(camera.c2, -3.12627e-5);
  EXPECT_EQ(camera.sensor_mm, Eigen::Vector2d(35.968, 23.979));
  EXPECT_EQ(camera.width_px, 8688);
  EXPECT_EQ(camera.height_px, 5792);
  ASSERT_EQ(scales->size(), 1U);
  EXPECT_EQ(scales->front().name, "Scalebar");
  EXPECT_EQ(scales->front().id_a, 506);
  EXPECT_EQ(scales->front().id_b, 507);
  EXPECT_EQ(scales->front().length_mm, 1389.688);
  EXPECT_EQ(scales->front().sigma_mm, 0.01);

  // The same observations as a program of others read them.
  const auto reference = read_table(folder / "reference_observations.csv");
  ASSERT_TRUE(reference) << reference.error().message;
  std::map<std::pair<int, int>, Eigen::Vector2d> by_ids;
  for (const auto& o : *observations) {
    if (o.active) by_ids[{o.image, o.point}] = o.xy_mm;
  }
  ASSERT_EQ(reference->rows.size(), 9972U);
  for (std::size_t row = 0; row < reference->rows.size(); ++row) {
    const auto found = by_ids.find({*reference->integer(row, 0), *reference->integer(row, 1)});
    ASSERT_NE(found, by_ids.end());
    EXPECT_EQ(found->second, Eigen::Vector2d(*reference->number(row, 2), *reference->number(row, 3)));
  }
  // Orientation as adjusted by others starts from these values; AICON's are rounded to 1e-5 mm and 1e-8 rad.
  const auto poses = read_table(folder / "reference_images.csv");
  ASSERT_TRUE(poses);
  ASSERT_EQ(poses->rows.size(), images->size());
  for (std::size_t row = 0; row < poses->rows.size(); ++row) {
    EXPECT_EQ(images->at(row).image, *poses->integer(row, 0));
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(images->at(row).position_mm[static_cast<int>(i)], *poses->number(row, 1 + i), 1e-3);
      EXPECT_NEAR(images->at(row).omega_phi_kappa_rad[static_cast<int>(i)], *poses->number(row, 4 + i), 1e-6);
    }
  }
}

TEST(AiconFiles, ObjectPointsKeepTheirFlags) {
  const TemporaryFolder folder;
  const auto file =
      folder.write("a.obc", "\xEF\xBB\xBF 6 1.5 -2 3 0.0026 0.0029 0.0035 66 1 1 0\r\n\n7 4 5 6 fix fix fix 0 0\n");
  const auto points = read_aicon_object_points(file);
  ASSERT_TRUE(points) << points.error().message;
  ASSERT_EQ(points->size(), 2U);
  EXPECT_EQ(points->at(0).sigma_mm, Eigen::Vector3d(0.0026, 0.0029, 0.0035));
  EXPECT_TRUE(points->at(0).active);
  EXPECT_TRUE(points->at(0).is_new);
  EXPECT_FALSE(points->at(0).datum);
  EXPECT_EQ(points->at(0).rays, 66);
  EXPECT_FALSE(points->at(1).sigma_mm);
  EXPECT_FALSE(points->at(1).active);
}

TEST(AiconFiles, WrittenObjectPointsReadBack) {
  const TemporaryFolder folder;
  PointList list;
  ReferencePoint point;
  point.id = 4;
  point.xyz_mm = {1.23456789, -2000.5, 3e-9};
  point.cov_mm2 = Eigen::Vector3d(0.01, 0.04, 0.09).asDiagonal();
  list.points.push_back(point);
  point.id = 900001;
  point.cov_mm2.reset();
  list.points.push_back(point);
  ASSERT_TRUE(write_aicon_object_points(folder / "a.obc", list));
  for (const auto& read : {read_point_list(folder / "a.obc")}) {
    ASSERT_TRUE(read) << read.error().message;
    ASSERT_EQ(read->points.size(), 2U);
    EXPECT_EQ(read->points[0].xyz_mm, Eigen::Vector3d(1.23456789, -2000.5, 3e-9));
    EXPECT_LT((*read->points[0].cov_mm2 - *list.points[0].cov_mm2).norm(), 1e-12);
    EXPECT_EQ(read->points[1].id, 900001);
    EXPECT_FALSE(read->points[1].cov_mm2);
  }
  const auto plain = read_aicon_object_points(folder / "a.obc");
  ASSERT_TRUE(plain) << plain.error().message;
  EXPECT_TRUE(plain->at(0).active);
}

TEST(AiconFiles, DamageIsNamedWithFileAndLine) {
  const TemporaryFolder folder;
  const auto message = [&](const char* name, const std::string& contents) {
    const auto file = folder.write(name, contents);
    const std::string ending = file.extension().string();
    const auto said = [](const auto& result) { return result ? std::string() : result.error().message; };
    if (ending == ".phc") return said(read_aicon_image_points(file));
    if (ending == ".obc") return said(read_aicon_object_points(file));
    if (ending == ".eor") return said(read_aicon_images(file));
    if (ending == ".ior") return said(read_aicon_cameras(file));
    return said(read_aicon_scales(file));
  };
  const std::string observation = "1 6 7.1 3.5 0.0001 0.0001 0 0 1 1 1\n";
  EXPECT_EQ(message("a.phc", observation), "");
  EXPECT_THAT(message("a.phc", ""), HasSubstr("holds nothing"));
  EXPECT_THAT(message("a.phc", observation + "1 7 7.1 x 0.1 0.1 0 0 1 1 1\n"), HasSubstr("a.phc:2: \"x\""));
  EXPECT_EQ(message("a.phc", observation + "1 6 7.2 3.5 0.0001 0.0001 0 0 1 0 1\n"), "") << "two candidates for a point";
  EXPECT_THAT(message("a.phc", observation + observation), HasSubstr("a.phc:2: this entry stands there twice"));
  EXPECT_THAT(message("a.phc", "1 6 7.1 3.5 0.0001 0.0001 0 0 1 1\n"), HasSubstr("a.phc:1: flag (internal) is missing"));
  EXPECT_THAT(message("a.phc", "1 6 7.1 3.5 0.0001 0.0001 0 0 1 1 1 1\n"), HasSubstr("a.phc:1: more columns"));
  EXPECT_THAT(message("a.phc", "1 6 inf 3.5 0.0001 0.0001 0 0 1 1 1\n"), HasSubstr("a.phc:1: \"inf\""));
  EXPECT_THAT(message("a.phc", "1 -6 7 3.5 0.0001 0.0001 0 0 1 1 1\n"), HasSubstr("a.phc:1: -6"));
  EXPECT_THAT(message("a.phc", "1 99999999999 7 3.5 0.0001 0.0001 0 0 1 1 1\n"), HasSubstr("a.phc:1: "));
  EXPECT_THAT(message("a.obc", "6 1 2 3 0.1 fix 0.1 66 1\n"), HasSubstr("a.obc:1: sigmas for some"));
  EXPECT_THAT(message("a.obc", "6 1 2 3 0.1 -1 0.1 66 1\n"), HasSubstr("a.obc:1: sigma is negative"));
  EXPECT_THAT(message("a.obc", "6 1 2 3 fix fix fix 1 1\n6 1 2 3 fix fix fix 1 1\n"), HasSubstr("a.obc:2: this entry"));
  EXPECT_THAT(message("a.eor", "1 1 0 0 0 0 0\n"), HasSubstr("a.eor:1: angle is missing"));
  const std::string camera = "1 -999 -28.7 0.01 0.05 -1e-004 1e-7 13.4\n0\n5e-6 -8e-6\n-7e-5 -3e-5\n35.9 23.9 8688 5792\n";
  EXPECT_EQ(message("a.ior", camera), "");
  EXPECT_THAT(message("a.ior", camera.substr(0, camera.rfind("35.9"))), HasSubstr("five lines"));
  EXPECT_THAT(message("a.ior", "1 -999 28.7" + camera.substr(12)), HasSubstr("a.ior:1: the principal distance"));
  EXPECT_EQ(message("a.scale", "0 \"long bar\" 5 6 100 0.01 1\n"), "");
  EXPECT_THAT(message("a.scale", "0 \"long bar 5 6 100 0.01 1\n"), HasSubstr("quotation mark"));
  EXPECT_THAT(message("a.scale", "0 \"long bar\" 5 5 100 0.01 1\n"), HasSubstr("same point"));
  EXPECT_THAT(message("a.scale", "0 \"long bar\" 5 6 -100 0.01 1\n"), HasSubstr("positive"));
}

}  // namespace
}  // namespace crosstie::base
