// verify --cloud and --edge, as a user calls them.

#include <cmath>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/ply.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

using ::testing::HasSubstr;

/// Points of a cylinder of radius 1000 about x, `off` outside of it.
base::Cloud shell(double off, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  base::Cloud cloud;
  for (int i = 0; i < 4000; ++i) {
    const double phi = uniform(random);
    const double x = 400.0 * uniform(random);
    cloud.points.emplace_back(x, (1000.0 + off) * std::sin(phi), (1000.0 + off) * std::cos(phi));
    cloud.normals.emplace_back(0.0, std::sin(phi), std::cos(phi));
  }
  return cloud;
}

std::string rim(double radius) {
  std::string text = "x_mm,y_mm,z_mm,nx,ny,nz,sigma_u_mm,sigma_v_mm\n";
  for (int i = 0; i < 720; ++i) {
    const double phi = i * 3.14159265358979 / 360.0;
    text += std::to_string(radius * std::cos(phi)) + "," + std::to_string(radius * std::sin(phi)) + ",0,0,0,1,0.02,0.02\n";
  }
  return text;
}

TEST(VerifySurface, ACloudAShellAndARim) {
  const TemporaryFolder folder;
  ASSERT_TRUE(base::write_ply(folder / "measured.ply", shell(0.1, 1)).has_value());
  ASSERT_TRUE(base::write_ply(folder / "reference.ply", shell(0.0, 2)).has_value());
  folder.write("measured.csv", rim(299.95));
  folder.write("reference.csv", rim(300.0));
  const auto run =
      run_program({"verify", "--cloud", (folder / "measured.ply").string(), "--surface", (folder / "reference.ply").string(),
                   "--shell", "cylinder", "--tolerance-mm", "0.2", "--edge", (folder / "measured.csv").string(),
                   "--edge-reference", (folder / "reference.csv").string(), "--out", (folder / "check").string()});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("points against a cloud"));
  const auto json = base::read_json(folder / "check" / "result.json");
  ASSERT_TRUE(json.has_value()) << json.error().message;
  const auto& surface = (*json)["surface"];
  EXPECT_NEAR(surface["mean_mm"].get<double>(), 0.1, 0.002) << "the curve between the points is followed";
  EXPECT_EQ(surface["in_tolerance"].get<double>(), 1.0);
  EXPECT_GT(surface["count"].get<int>(), 2500);
  EXPECT_EQ((*json)["shape"]["shape"], "cylinder");
  EXPECT_NEAR((*json)["shape"]["diameter_mm"].get<double>(), 2000.2, 1e-3) << "the points are exact";
  EXPECT_NEAR((*json)["edge"]["rms_mm"].get<double>(), 0.05, 0.002);
  for (const char* file : {"report.html", "surface.csv", "edge_deviations.csv"})
    EXPECT_TRUE(std::filesystem::exists(folder / "check" / file)) << file;
  EXPECT_FALSE(json->contains("points")) << "no points were compared";

  // The same files in each other's place are another comparison, not one that is up to date.
  const auto exchanged =
      run_program({"verify", "--cloud", (folder / "reference.ply").string(), "--surface", (folder / "measured.ply").string(),
                   "--shell", "cylinder", "--tolerance-mm", "0.2", "--edge", (folder / "reference.csv").string(),
                   "--edge-reference", (folder / "measured.csv").string(), "--out", (folder / "check").string()});
  ASSERT_EQ(exchanged.exit_code, 0) << exchanged.err;
  const auto other = base::read_json(folder / "check" / "result.json");
  ASSERT_TRUE(other.has_value()) << other.error().message;
  EXPECT_NEAR((*other)["surface"]["mean_mm"].get<double>(), -0.1, 0.002);
}

TEST(VerifySurface, WhatCannotBeComparedIsNamedAndNothingIsWritten) {
  const TemporaryFolder folder;
  base::Cloud metres = shell(0.0, 3);
  for (auto& p : metres.points) p /= 1000.0;
  ASSERT_TRUE(base::write_ply(folder / "metres.ply", metres).has_value());
  ASSERT_TRUE(base::write_ply(folder / "reference.ply", shell(0.0, 2)).has_value());
  folder.write("short.csv", "x_mm,y_mm,z_mm\n0,0,0\n");
  const std::string reference = (folder / "reference.ply").string();
  const std::string out = (folder / "check").string();
  const auto fails = [&](const std::vector<std::string>& words, int code, const std::string& text) {
    std::vector<std::string> all = {"verify", "--out", out};
    all.insert(all.end(), words.begin(), words.end());
    const auto run = run_program(all);
    EXPECT_EQ(run.exit_code, code) << run.err;
    EXPECT_THAT(run.err, HasSubstr(text));
    EXPECT_FALSE(std::filesystem::exists(out));
  };
  fails({"--cloud", (folder / "metres.ply").string(), "--surface", reference}, 3, "in one frame and unit");
  fails({"--cloud", reference}, 2, "--surface");
  fails({"--surface", reference}, 2, "need --cloud");
  fails({"--cloud", reference, "--shell", "cube"}, 2, "cone or cylinder");
  fails({"--cloud", reference, "--shell", "cone", "--best-fit"}, 2, "--best-fit needs --surface");
  fails({"--edge", (folder / "short.csv").string()}, 2, "go together");
  fails({"--edge", (folder / "short.csv").string(), "--edge-reference", (folder / "short.csv").string()}, 3,
        "needs the column nx");
  fails({"--cloud", (folder / "absent.ply").string(), "--surface", reference}, 5, "absent.ply");
  fails({}, 2, "nothing to verify");
}

}  // namespace
}  // namespace crosstie::tests
