// The whole job on the twin's segment through the program, from the board to the torch's path: held against the twin's truth.

#include <cmath>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_file.h"
#include "base/stitching_reader.h"
#include "base/table.h"
#include "fixtures/machine.h"
#include "fixtures/simulate.h"
#include "math/distributions.h"
#include "tests/support/normalised_square.h"
#include "tests/support/program.h"
#include "tests/support/true_rim.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using testing::HasSubstr;
using tests::column;
using tests::run_program;
using tests::TemporaryFolder;
using tests::triples;
using tests::TrueRim;

/// The scene "segment" as it comes, done once; shared by all tests of this file.
class SegmentJob : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    const auto simulated = fixtures::simulate(*fixtures::make_scene("segment"), job(), {.seed = kSeed, .threads = 2});
    ASSERT_TRUE(simulated) << simulated.error().message;
    run_ = run_program({"run", job().string()});
    ASSERT_LE(run_.exit_code, 1) << run_.err;
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static fs::path job() { return *folder_ / "job"; }
  static fs::path results(const char* step) { return job() / "results" / step; }
  static base::Pose machine_from_part() { return tests::true_machine_from_part(job()); }
  static TrueRim true_rim() { return TrueRim::read(job()); }

  static constexpr std::uint64_t kSeed = 7;
  static TemporaryFolder* folder_;
  static tests::ProgramRun run_;
};
TemporaryFolder* SegmentJob::folder_ = nullptr;
tests::ProgramRun SegmentJob::run_;

TEST_F(SegmentJob, RunDoesAllStepsAndThenNothing) {
  EXPECT_EQ(run_.exit_code, 0) << run_.err;
  for (const char* step : {"calibrate", "adjust", "commission", "scan", "stitch", "edge", "verify"})
    EXPECT_THAT("\n" + run_.err, HasSubstr(fmt::format("\n{} ", step)));
  for (const char* step : {"calibrate", "detect", "adjust", "commission", "stitch", "edge", "verify"})
    EXPECT_TRUE(fs::exists(results(step) / "report.html")) << step;
  const std::string overview = tests::read_all(job() / "results" / "index.html");
  for (const char* page : {"calibrate/report.html", "scan/x0500/report.html", "stitch/report.html", "edge/report.html"})
    EXPECT_THAT(overview, HasSubstr(fmt::format("href=\"{}\"", page)));
  EXPECT_THAT(overview, HasSubstr("all that the job asks for"));
  const std::string before = tests::read_all(results("edge") / "result.json");
  const auto again = run_program({"run", job().string()});
  EXPECT_EQ(again.exit_code, run_.exit_code) << again.err;
  EXPECT_THAT(again.err, testing::Not(HasSubstr("points from"))) << "nothing is computed again";
  EXPECT_EQ(tests::read_all(results("edge") / "result.json"), before);
  // The verb alone says the same.
  EXPECT_THAT(run_program({"edge", job().string()}).err, HasSubstr("up to date"));
  EXPECT_THAT(run_program({"stitch", job().string()}).err, HasSubstr("up to date"));
}

TEST_F(SegmentJob, EveryStationLiesWhereItIs) {
  const auto stitching = base::read_stitching(results("stitch"));
  ASSERT_TRUE(stitching) << stitching.error().message;
  EXPECT_EQ(stitching->frame, "machine");
  ASSERT_EQ(stitching->stations.size(), 3U);
  const fixtures::Scene truth = fixtures::drawn(*fixtures::make_scene("segment"), kSeed);
  for (const base::StitchedStation& station : stitching->stations) {
    for (const fixtures::Station& stop : truth.machine->stations) {
      if (stop.name != station.name) continue;
      const double square = tests::normalised_square(station.machine_from_rig,
                                                     fixtures::machine_from_rig(*truth.machine, stop.axis_mm), station.cov);
      std::printf("%s: normalised square %.2f of 6\n", station.name.c_str(), square);
      EXPECT_LT(square, math::chi_square_quantile(0.999, 6.0)) << station.name;
    }
  }
}

TEST_F(SegmentJob, ThePartLiesWhereItIs) {
  const auto result = base::read_json(results("edge") / "result.json");
  ASSERT_TRUE(result);
  const base::Pose found = tests::pose_of(result->at("machine_from_part"));
  const base::Matrix6d cov = tests::cov_of(result->at("machine_from_part_cov"));
  const base::Vector6d error = base::difference(machine_from_part(), found);
  for (Eigen::Index i = 0; i < 6; ++i) EXPECT_LT(std::abs(error(i)), 3.0 * std::sqrt(cov(i, i))) << i;
  EXPECT_LT(tests::normalised_square(error, cov), math::chi_square_quantile(0.999, 6.0));
  // At the hole itself, where the lever of the turns is short.
  const Vector3d hole = machine_from_part() * Vector3d(2150.0, 0.0, 0.0);
  EXPECT_LT((found * Vector3d(2150.0, 0.0, 0.0) - hole).norm(), 0.1);
}

TEST_F(SegmentJob, TheEdgeIsThatOfTheFaceAllRound) {
  const auto result = base::read_json(results("edge") / "result.json");
  ASSERT_TRUE(result);
  double gaps_mm = 0.0;
  for (const auto& gap : result->at("gaps")) gaps_mm += gap.at("length_mm").get<double>();
  const auto table = base::read_table(results("edge") / "edge.csv");
  ASSERT_TRUE(table) << table.error().message;
  const TrueRim rim = true_rim();
  const std::vector<Vector3d> points = triples(*table, {"x_mm", "y_mm", "z_mm"});
  const std::vector<double> sigma_u = column(*table, "sigma_u_mm");
  const std::vector<double> sigma_v = column(*table, "sigma_v_mm");
  double squares = 0.0, worst = 0.0, mean_u = 0.0, mean_v = 0.0, squares_u = 0.0, squares_v = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d off = rim.off_mm(points[i]);
    squares += off.squaredNorm();
    worst = std::max(worst, off.norm());
    mean_u += off.x();
    mean_v += off.y();
    squares_u += std::pow(off.x() / sigma_u[i], 2);
    squares_v += std::pow(off.y() / sigma_v[i], 2);
  }
  const auto count = static_cast<double>(points.size());
  std::printf("edge: %zu points, rms %.4f mm, largest %.4f mm, mean u %.4f v %.4f mm, over sigma u %.2f v %.2f\n",
              points.size(), std::sqrt(squares / count), worst, mean_u / count, mean_v / count, std::sqrt(squares_u / count),
              std::sqrt(squares_v / count));
  EXPECT_LT(worst, 2.0) << "the far edge and shadows lie farther off";
  EXPECT_LT(gaps_mm, 50.0) << "of 3270 mm";
  // The errors of one job have much in common: wide limits, the study of many jobs has narrow ones.
  for (const double ratio : {std::sqrt(squares_u / count), std::sqrt(squares_v / count)}) EXPECT_LT(ratio, 3.0);
  EXPECT_LT(std::sqrt(squares / count), 0.1);
  EXPECT_TRUE(result->at("closed").get<bool>());
  EXPECT_TRUE(result->at("gaps").empty()) << result->at("gaps").dump();
}

TEST_F(SegmentJob, TheTorchStandsOnTheWall) {
  const auto path = base::read_json(results("edge") / "path.json");
  ASSERT_TRUE(path);
  EXPECT_EQ(path->at("frame"), "machine");
  EXPECT_TRUE(path->at("closed").get<bool>());
  const TrueRim rim = true_rim();
  double turned = 0.0, off = 0.0;
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();
  for (const auto& point : path->at("points")) {
    const auto vector = [&](const char* name) {
      const auto numbers = point.at(name).get<std::vector<double>>();
      return Vector3d(numbers.at(0), numbers.at(1), numbers.at(2));
    };
    const Vector3d tip = vector("xyz_mm");
    const Vector3d torch = rim.axes_at(tip).transpose() * vector("torch");
    const auto sigmas = point.at("sigma_torch_rad").get<std::vector<double>>();
    off = std::max(off, rim.off_mm(tip).norm());
    turned = std::max(turned, std::acos(std::min(1.0, torch.z())));
    squares += torch.head<2>().cwiseQuotient(Eigen::Vector2d(sigmas.at(0), sigmas.at(1))).cwiseAbs2();
  }
  const Eigen::Vector2d ratios = (squares / static_cast<double>(path->at("points").size())).cwiseSqrt();
  std::printf("path: at most %.4f mm and %.4f degrees off, over sigma %.2f across and %.2f along\n", off,
              turned * 57.29577951308232, ratios(0), ratios(1));
  EXPECT_LT(turned, 0.2 / 57.29577951308232);
  for (const double ratio : ratios) EXPECT_LT(ratio, 3.0);
  EXPECT_LT(off, 1.0);
  for (const char* file : {"path.csv", "path.dxf", "path.ngc"}) EXPECT_TRUE(fs::exists(results("edge") / file)) << file;
}

/// The job with more or other lines, as a file beside its job.toml.
fs::path changed(const fs::path& job, const std::string& from, const std::string& to) {
  std::string text = tests::read_all(job / "job.toml");
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  const fs::path file = job / "changed.toml";
  std::ofstream(file) << text;
  return file;
}

TEST_F(SegmentJob, WhatCannotBeCutIsRefusedByName) {
  const std::string nominal = "nominal = \"nominal.csv\"";
  // A nominal that was drawn elsewhere on the tower.
  base::Table moved = *base::read_table(job() / "nominal.csv");
  for (std::size_t row = 0; row < moved.rows.size(); ++row)
    moved.rows[row][3] = fmt::format("{:.6f}", *moved.number(row, 3) + 95.0);
  ASSERT_TRUE(base::write_table(job() / "moved.csv", moved));
  struct Case {
    std::string from, to, message;
  };
  const std::vector<Case> cases = {
      {"[part]", "[path]\nreach_low_mm = [0, 0, 0]\nreach_high_mm = [2000, 2000, 2000]\n\n[part]", "reach"},
      {"[part]", "[path]\nmax_correction_mm = 0.2\n\n[part]", "are corrected"},
      {nominal, "nominal = \"moved.csv\"", "the rim has a gap of"},
      {"position = \"markers\"", "position = \"none\"", "elsewhere"}};
  for (const Case& one : cases) {
    const TemporaryFolder other;
    const auto run = run_program({"edge", changed(job(), one.from, one.to).string(), "--out", (other / "edge").string()});
    EXPECT_GE(run.exit_code, 3) << one.to;
    EXPECT_THAT(run.err, HasSubstr(one.message)) << one.to;
    EXPECT_FALSE(fs::exists(other / "edge")) << "nothing half";
  }
}

TEST_F(SegmentJob, TheTowerHoldsThePartAsWell) {
  // The fitted axis and the hole itself, in place of the markers; the hole was cut 1.3 mm and 0.9 mm off its nominal place.
  const TemporaryFolder other;
  const auto run = run_program(
      {"edge", changed(job(), "position = \"markers\"", "position = \"tower\"").string(), "--out", (other / "edge").string()});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto result = base::read_json(other / "edge" / "result.json");
  ASSERT_TRUE(result);
  EXPECT_EQ(result->at("part").at("source"), "tower");
  const base::Pose found = tests::pose_of(result->at("machine_from_part"));
  const base::Pose truth = machine_from_part();
  const Vector3d axis(0.0, 0.0, 1.0);
  EXPECT_LT(std::acos(std::min(1.0, (found.rotation * axis).dot(truth.rotation * axis))), 3e-3);
  const Vector3d hole(2150.0, 0.9, -1.3);
  EXPECT_LT((found * Vector3d(2150.0, 0.0, 0.0) - truth * hole).head<2>().norm(), 1.0);
}

}  // namespace
}  // namespace crosstie
