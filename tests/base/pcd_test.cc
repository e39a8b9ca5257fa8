// A PCD file byte by byte, as the Point Cloud Library reads it.
#include "base/pcd.h"

#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

TEST(Pcd, HoldsEveryFieldUnderItsName) {
  const tests::TemporaryFolder folder;
  Cloud cloud;
  cloud.frame = "rig";
  cloud.points = {{1.0, 2.0, 3.0}, {-4.5, 0.25, 1200.125}};
  cloud.normals = {{0.0, 0.0, -1.0}, {0.0, 1.0, 0.0}};
  cloud.cov_mm2 = {Eigen::Matrix3d::Identity(), 2.0 * Eigen::Matrix3d::Identity()};
  cloud.fields = {{"sigma_mm", {0.5, 0.25}}, {"row", {7.0, 8.0}}};
  ASSERT_TRUE(write_pcd(folder / "cloud.pcd", cloud));
  const auto bytes = read_file(folder / "cloud.pcd", 1U << 20U);
  ASSERT_TRUE(bytes);
  EXPECT_THAT(*bytes,
              testing::HasSubstr("\nVERSION 0.7\nFIELDS x y z normal_x normal_y normal_z cov_xx cov_xy cov_xz cov_yy cov_yz "
                                 "cov_zz sigma_mm row\n"));
  EXPECT_THAT(*bytes, testing::HasSubstr("\nWIDTH 2\nHEIGHT 1\n"));
  EXPECT_THAT(*bytes, testing::HasSubstr("# unit mm\n# frame rig\n"));
  const std::string start = "DATA binary\n";
  const std::size_t at = bytes->find(start) + start.size();
  ASSERT_EQ(bytes->size() - at, 2U * 14U * 4U);
  std::vector<float> values(28);
  std::memcpy(values.data(), bytes->data() + at, values.size() * sizeof(float));
  EXPECT_EQ(values[14], -4.5F);
  EXPECT_EQ(values[16], 1200.125F);
  EXPECT_EQ(values[18], 1.0F);  // normal_y
  EXPECT_EQ(values[20], 2.0F);  // cov_xx
  EXPECT_EQ(values[26], 0.25F);
  EXPECT_EQ(values[27], 8.0F);
}

TEST(Pcd, ListsThatDoNotFitAreRefused) {
  const tests::TemporaryFolder folder;
  Cloud cloud;
  cloud.points = {{1.0, 2.0, 3.0}};
  cloud.fields = {{"sigma_mm", {0.5, 0.25}}};
  EXPECT_FALSE(write_pcd(folder / "cloud.pcd", cloud));
  cloud.fields = {{"two words", {0.5}}};
  EXPECT_FALSE(write_pcd(folder / "cloud.pcd", cloud));
  cloud.fields = {{"beyond_a_float", {1e39}}};
  EXPECT_FALSE(write_pcd(folder / "cloud.pcd", cloud));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace crosstie::base
