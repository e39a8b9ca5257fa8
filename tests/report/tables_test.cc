#include "report/tables.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "base/table.h"
#include "base/verification.h"
#include "tests/report/synthetic_network.h"

namespace crosstie::report {
namespace {

class Tables : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() / (std::string("crosstie_tables_") + info->name());
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  base::Table read(const std::string& name) {
    auto table = base::read_table(folder_ / name);
    EXPECT_TRUE(table) << (table ? "" : table.error().message);
    return table ? *table : base::Table();
  }

  std::filesystem::path folder_;
};

TEST_F(Tables, BundleTablesReadBackExactly) {
  base::AdjustedNetwork network = tests::synthetic_network();
  network.rejected[0].reason = "blunder, \"gross\"";
  ASSERT_TRUE(write_bundle_tables(folder_, network));
  const base::Table points = read("points.csv");
  ASSERT_EQ(points.rows.size(), network.points.size());
  for (std::size_t i = 0; i < points.rows.size(); ++i) {
    EXPECT_EQ(*points.integer(i, *points.column("id")), network.points[i].id);
    EXPECT_EQ(*points.number(i, *points.column("y_mm")), network.points[i].xyz_mm.y());
    EXPECT_EQ(*points.number(i, *points.column("cov_yz_mm2")), network.points[i].cov_mm2(1, 2));
    EXPECT_EQ(*points.number(i, *points.column("angle_rad")), network.points[i].angle_rad);
  }
  const base::Table residuals = read("residuals.csv");
  ASSERT_EQ(residuals.rows.size(), network.residuals.size());
  EXPECT_EQ(*residuals.number(5, *residuals.column("residual_y_px")), network.residuals[5].residual_px.y());
  EXPECT_EQ(read("images.csv").rows.size(), 24u);
  EXPECT_EQ(read("cameras.csv").rows.size(), 18u);
  EXPECT_EQ(read("scale_bars.csv").rows.size(), 2u);
  EXPECT_EQ(*points.number(3, *points.column("max_px")), network.points[3].max_px);
  EXPECT_EQ(*points.number(3, *points.column("least_redundancy")), network.points[3].least_redundancy);
  const base::Table cameras = read("cameras.csv");
  EXPECT_EQ(cameras.rows[0][*cameras.column("significance_p")], "") << "a focal length is not tested";
  EXPECT_EQ(*cameras.number(6, *cameras.column("significance_p")), 0.069);
  const base::Table rigs = read("rigs.csv");
  ASSERT_EQ(rigs.rows.size(), 2u);
  EXPECT_EQ(*rigs.number(1, *rigs.column("x_mm")), 412.5078);
  EXPECT_DOUBLE_EQ(*rigs.number(1, *rigs.column("sigma_rotation_z_rad")), 3e-5);
  EXPECT_EQ(*read("control.csv").number(0, 1), 0.0123);
  EXPECT_EQ(read("rejected.csv").rows[0][2], "blunder, \"gross\"");
}

TEST_F(Tables, TablesWithoutRowsHaveTheirHeader) {
  ASSERT_TRUE(write_bundle_tables(folder_, {}));
  ASSERT_TRUE(write_verification_tables(folder_, {}));
  for (const char* name : {"points.csv", "images.csv", "cameras.csv", "residuals.csv", "scale_bars.csv", "rejected.csv",
                           "rigs.csv", "control.csv", "deviations.csv", "lengths.csv"}) {
    const base::Table table = read(name);
    EXPECT_TRUE(table.rows.empty()) << name;
    EXPECT_GE(table.columns.size(), 4u) << name;
  }
}

TEST_F(Tables, VerificationTables) {
  base::Verification verification;
  base::Deviation one;
  one.id = 11;
  one.deviation_mm = {0.1, -0.2, 0.2};
  verification.points.push_back(one);
  verification.lengths.push_back({11, 52, 812.5, 812.53, 0.004, 0.06});
  ASSERT_TRUE(write_verification_tables(folder_, verification));
  const base::Table deviations = read("deviations.csv");
  EXPECT_DOUBLE_EQ(*deviations.number(0, *deviations.column("d3_mm")), 0.3);
  const base::Table lengths = read("lengths.csv");
  EXPECT_NEAR(*lengths.number(0, *lengths.column("error_mm")), 0.03, 1e-12);
}

TEST_F(Tables, AMissingFolderIsAnError) {
  EXPECT_EQ(write_bundle_tables(folder_ / "none", {}).error().code, base::ErrorCode::kFileSystem);
}

}  // namespace
}  // namespace crosstie::report
