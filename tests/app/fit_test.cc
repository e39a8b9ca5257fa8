// The verb fit: what it reads, prints and refuses.
#include <cmath>
#include <filesystem>
#include <numbers>

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/ply.h"
#include "base/table.h"
#include "tests/app/run_verb.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using nlohmann::ordered_json;
using testing::ElementsAre;
using testing::HasSubstr;
using tests::TemporaryFolder;

tests::VerbAnswer fit(std::vector<std::string> words) {
  words.insert(words.begin(), "fit");
  return tests::run_verb(words);
}

ordered_json fit_json(std::vector<std::string> words) {
  words.emplace_back("--json");
  const tests::VerbAnswer run = fit(words);
  EXPECT_FALSE(run.error) << run.error->message;
  return run.error ? ordered_json() : ordered_json::parse(run.out);
}

std::string refusal(const std::vector<std::string>& words, ErrorCode code) {
  const tests::VerbAnswer run = fit(words);
  if (!run.error) return "was accepted: " + run.out;
  EXPECT_EQ(run.error->code, code) << run.error->message;
  EXPECT_EQ(run.out, "");
  return run.error->message;
}

/// A cylinder of radius 20 along z about (5, -3), with a ripple of 0.01 mm, in `unit_mm`.
std::vector<Eigen::Vector3d> cylinder(double unit_mm = 1.0) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 60; ++i) {
    const double phi = 2.0 * std::numbers::pi * i / 20.0;
    const double radius = 20.0 + 0.01 * std::cos(7.0 * i);
    points.emplace_back(Eigen::Vector3d(5.0 + radius * std::cos(phi), -3.0 + radius * std::sin(phi), 10.0 * (i / 20)) /
                        unit_mm);
  }
  return points;
}

std::string lines(const std::vector<Eigen::Vector3d>& points, const char* separator = " ") {
  std::string text;
  for (const Eigen::Vector3d& p : points) text += fmt::format("{}{}{}{}{}\n", p.x(), separator, p.y(), separator, p.z());
  return text;
}

void expect_cylinder(const ordered_json& result) {
  ASSERT_TRUE(result.is_object());
  EXPECT_EQ(result["shape"], "cylinder");
  EXPECT_NEAR(result["diameter_mm"].get<double>(), 40.0, 0.02);
  EXPECT_NEAR(result["point_mm"][0].get<double>(), 5.0, 0.02);
  EXPECT_NEAR(result["direction"][2].get<double>(), 1.0, 1e-5);
  EXPECT_EQ(result["count"], 60);
}

TEST(Fit, ReadsEveryKindOfFile) {
  const TemporaryFolder folder;
  const auto file = [&](const char* name, const std::string& text) { return folder.write(name, text).string(); };
  expect_cylinder(fit_json({"cylinder", file("a.xyz", lines(cylinder())), "--unit", "mm"}));
  expect_cylinder(fit_json({"cylinder", file("b.txt", lines(cylinder(1000.0), ", ")), "--unit", "m"}));
  expect_cylinder(fit_json({"cylinder", file("c.ds", "60\n" + lines(cylinder(25.4), "\t")), "--unit", "inch"}));
  expect_cylinder(fit_json({"cylinder", file("d.csv", "x_m,y_m,z_m\n" + lines(cylinder(1000.0), ","))}));
  expect_cylinder(
      fit_json({"cylinder", file("e.csv", "a;b;c\n" + lines(cylinder(), ";")), "--columns", "a,b,c", "--unit", "mm"}));
  std::string shuffled;
  std::string list = "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n";
  int id = 0;
  for (const Eigen::Vector3d& p : cylinder()) {
    shuffled += fmt::format("{} 17 {} {}\n", p.z(), p.x(), p.y());
    list += fmt::format("{},{},{},{},0.01,0.01,0.02\n", ++id, p.x(), p.y(), p.z());
  }
  expect_cylinder(fit_json({"cylinder", file("f.xyz", shuffled), "--columns", "3,4,1", "--unit", "mm"}));
  const ordered_json weighted = fit_json({"cylinder", file("g.csv", list)});
  expect_cylinder(weighted);
  EXPECT_TRUE(weighted["options"]["sigmas_of_points"].get<bool>());
  EXPECT_NEAR(weighted["sigmas"]["diameter_mm"].get<double>(), 2.0 * 0.01 / std::sqrt(60.0), 1e-4);
  base::Cloud cloud;
  cloud.frame = "machine";
  cloud.points = cylinder();
  ASSERT_TRUE(base::write_ply(folder / "h.ply", cloud));
  const ordered_json of_cloud = fit_json({"cylinder", (folder / "h.ply").string()});
  expect_cylinder(of_cloud);
  EXPECT_EQ(of_cloud["frame"], "machine");
}

TEST(Fit, WritesTheKeysThatResultsKeep) {
  const TemporaryFolder folder;
  const std::string file = folder.write("points.xyz", lines(cylinder())).string();
  const std::string out = (folder / "out").string();
  const ordered_json printed = fit_json({"cylinder", file, "--unit", "mm", "--out", out});
  const auto written = base::read_json(folder / "out/result.json");
  ASSERT_TRUE(written) << written.error().message;
  EXPECT_EQ(printed, *written);
  for (const char* key : {"format",      "verb",       "version", "unit",     "frame",     "inputs",      "options",
                          "verdicts",    "warnings",   "shape",   "point_mm", "direction", "diameter_mm", "apex_angle_rad",
                          "distance_mm", "params_cov", "rms_mm",  "form_mm",  "sigmas",    "count",       "rejected"}) {
    EXPECT_TRUE(printed.contains(key)) << key;
  }
  EXPECT_EQ(printed["format"], "crosstie-result/1");
  EXPECT_TRUE(printed["apex_angle_rad"].is_null());
  EXPECT_EQ(printed["params"], ordered_json({"u_mm", "v_mm", "a_rad", "b_rad", "size_mm"}));
  ASSERT_EQ(printed["params_cov"].size(), 15U);
  EXPECT_NEAR(printed["sigmas"]["diameter_mm"].get<double>(), 2.0 * std::sqrt(printed["params_cov"][14].get<double>()), 1e-12);
  const auto residuals = base::read_table(folder / "out/residuals.csv");
  ASSERT_TRUE(residuals) << residuals.error().message;
  ASSERT_EQ(residuals->rows.size(), 60U);
  double squares = 0.0;
  for (std::size_t i = 0; i < 60; ++i) squares += std::pow(*residuals->number(i, *residuals->column("residual_mm")), 2);
  EXPECT_NEAR(std::sqrt(squares / 60.0), printed["rms_mm"].get<double>(), 1e-12);
}

TEST(Fit, PrintsATableWithSigmasAndExpandedUncertainties) {
  const TemporaryFolder folder;
  const std::string file = folder.write("points.xyz", lines(cylinder())).string();
  const tests::VerbAnswer run = fit({"cylinder", file, "--unit", "mm"});
  ASSERT_FALSE(run.error) << run.error->message;
  EXPECT_THAT(run.out, HasSubstr("cylinder through 60 of 60 points, redundancy 55"));
  EXPECT_THAT(run.out, HasSubstr("U (k=2)"));
  EXPECT_THAT(run.out, HasSubstr("diameter"));
  const tests::VerbAnswer held = fit({"cylinder", file, "--unit", "mm", "--radius-mm", "20"});
  ASSERT_FALSE(held.error) << held.error->message;
  EXPECT_THAT(held.out, HasSubstr("held"));
}

TEST(Fit, LeavesStraysOutWhereAsked) {
  const TemporaryFolder folder;
  std::vector<Eigen::Vector3d> points = cylinder();
  for (int i = 0; i < 15; ++i) points[static_cast<std::size_t>(4 * i)] += Eigen::Vector3d(7.0 + i, 3.0 * i, -i);
  const std::string file = folder.write("points.xyz", lines(points)).string();
  const ordered_json result = fit_json({"cylinder", file, "--unit", "mm", "--robust"});
  ASSERT_TRUE(result.is_object());
  EXPECT_NEAR(result["diameter_mm"].get<double>(), 40.0, 0.02);
  EXPECT_GE(result["rejected"]["count"].get<int>(), 13);
  EXPECT_EQ(result["count"].get<int>() + result["rejected"]["count"].get<int>(), 60);
}

TEST(Fit, ConesHaveTheirFullAngle) {
  const TemporaryFolder folder;
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 60; ++i) {
    const double z = 10.0 * (i / 20);
    const double rho = 15.0 - z * std::tan(0.2);
    points.emplace_back(rho * std::cos(0.31 * i), rho * std::sin(0.31 * i), z);
  }
  const ordered_json result = fit_json({"cone", folder.write("points.xyz", lines(points)).string(), "--unit", "mm"});
  ASSERT_TRUE(result.is_object());
  EXPECT_NEAR(result["apex_angle_rad"].get<double>(), 0.4, 1e-9);
  EXPECT_NEAR(result["direction"][2].get<double>(), -1.0, 1e-9);
  EXPECT_TRUE(result["diameter_mm"].is_null());
}

TEST(Fit, RefusesWithOneClearLine) {
  const TemporaryFolder folder;
  const auto file = [&](const char* name, const std::string& text) { return folder.write(name, text).string(); };
  const std::string good = file("good.xyz", lines(cylinder()));
  EXPECT_THAT(refusal({"torus", good, "--unit", "mm"}, ErrorCode::kUsage), HasSubstr("torus"));
  EXPECT_THAT(refusal({"cylinder", good}, ErrorCode::kUsage), HasSubstr("does not say its unit"));
  EXPECT_THAT(refusal({"cylinder", good, "--unit", "furlong"}, ErrorCode::kUsage), HasSubstr("furlong"));
  EXPECT_THAT(refusal({"cylinder", good, "--unit", "mm", "--columns", "x,y"}, ErrorCode::kUsage), HasSubstr("three columns"));
  EXPECT_THAT(refusal({"cylinder", good, "--unit", "mm", "--columns", "x,y,z"}, ErrorCode::kUsage), HasSubstr("no header"));
  EXPECT_THAT(refusal({"cylinder", good, "--unit", "mm", "--columns", "1,2,4"}, ErrorCode::kBadInput), HasSubstr("good.xyz:1"));
  EXPECT_THAT(refusal({"plane", good, "--unit", "mm", "--radius-mm", "3"}, ErrorCode::kUsage), HasSubstr("no radius"));
  EXPECT_THAT(refusal({"cylinder", good, "--unit", "mm", "--radius-sigma-mm", "3"}, ErrorCode::kUsage),
              HasSubstr("--radius-mm"));
  EXPECT_THAT(refusal({"cylinder", good, "--unit", "mm", "--sigma-mm", "-1"}, ErrorCode::kUsage), HasSubstr("sigma"));
  EXPECT_THAT(refusal({"cylinder", good, "--unit", "mm", "--sigma-mm", "little"}, ErrorCode::kUsage), HasSubstr("--sigma-mm"));
  EXPECT_THAT(refusal({"line", good, "--unit", "mm"}, ErrorCode::kNoUniqueSolution), HasSubstr("good.xyz"));
  EXPECT_THAT(refusal({"plane", (folder / "absent").string(), "--unit", "mm"}, ErrorCode::kFileSystem), HasSubstr("absent"));
  const auto bad = [&](const std::string& text) {
    return refusal({"plane", file("bad.xyz", text), "--unit", "mm"}, ErrorCode::kBadInput);
  };
  EXPECT_THAT(bad("1 2 3\n4 nan 6\n7 8 9\n"), HasSubstr("bad.xyz:2"));
  EXPECT_THAT(bad("1 2 3\n4 5\n7 8 9\n"), HasSubstr("bad.xyz:2"));
  EXPECT_THAT(bad("4\n1 2 3\n4 5 7\n7 8 9\n"), HasSubstr("4 points are announced, 3 are there"));
  EXPECT_THAT(bad("x_m,y_m,z_m\n1,2,3\n4,5,6\n7,8,1\n"), HasSubstr("mm was stated"));
  EXPECT_THAT(bad("east north up\n1 2 3\n4 5 6\n7 8 1\n"), HasSubstr("no columns"));
  EXPECT_THAT(bad(""), HasSubstr("bad.xyz"));
  EXPECT_THAT(refusal({"plane", file("few.xyz", "1 2 3\n4 5 6\n"), "--unit", "mm"}, ErrorCode::kNoUniqueSolution),
              HasSubstr("2 points, at least 3"));
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

}  // namespace
}  // namespace crosstie::app
