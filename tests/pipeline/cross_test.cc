// The main line on the twin's calibration cross: photographs -> coordinates, held against the twin's truth.

#include <cmath>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/npy.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "base/table.h"
#include "math/distributions.h"
#include "math/rigid_alignment.h"
#include "tests/support/folder_contents.h"
#include "tests/support/program.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using testing::HasSubstr;
using tests::run_program;

/// One simulated job for all tests of this file.
class Cross : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new tests::TemporaryFolder;
    const auto simulated = run_program({"simulate", "--scene", "cross", "--seed", "7", "--out", job().string()});
    ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
    const auto run = run_program({"run", job().string()});
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }
  static void TearDownTestSuite() {
    delete folder_;
    folder_ = nullptr;
  }
  static fs::path job() { return *folder_ / "job"; }
  static ordered_json result(const char* verb) { return base::read_json(job() / "results" / verb / "result.json").value(); }

  static tests::TemporaryFolder* folder_;
};
tests::TemporaryFolder* Cross::folder_ = nullptr;

TEST_F(Cross, CoordinatesAgreeWithTheTruthWithinTheirSigmas) {
  const auto truth = base::read_point_list(job() / "truth/points.csv");
  ASSERT_TRUE(truth) << truth.error().message;
  auto measured = base::points_from_network_json(job() / "results/adjust/result.json");
  ASSERT_TRUE(measured) << measured.error().message;

  const auto full = base::read_npy(job() / "results/adjust/covariance.npy");
  ASSERT_TRUE(full) << full.error().message;
  const auto size = static_cast<Eigen::Index>(3 * measured->points.size());
  // Round things on the floor are measured, too, as uncoded targets; the truth lists the markers only, which come first.
  std::erase_if(measured->points, [](const base::ReferencePoint& point) { return !point.has_own_id; });
  EXPECT_EQ(measured->points.size(), truth->points.size());
  const auto coded = static_cast<Eigen::Index>(3 * measured->points.size());
  const Eigen::MatrixXd of_markers = full->bottomRightCorner(size, size).topLeftCorner(coded, coded);

  std::vector<math::AlignmentPair> pairs;
  for (const base::ReferencePoint& point : measured->points) {
    const base::ReferencePoint* known = truth->find(point.id);
    ASSERT_NE(known, nullptr) << "a wrong id in the network: " << point.id;
    pairs.push_back({point.xyz_mm, known->xyz_mm, Eigen::Matrix3d::Identity(), Eigen::Matrix3d::Zero()});
  }
  // The unweighted best fit takes its six directions out of the errors and out of their covariance.
  Eigen::MatrixXd motion(coded, 6);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    motion.middleRows<3>(3 * static_cast<Eigen::Index>(i)) << -base::skew(pairs[i].a_mm), Eigen::Matrix3d::Identity();
  }
  const Eigen::MatrixXd out =
      Eigen::MatrixXd::Identity(coded, coded) - motion * (motion.transpose() * motion).ldlt().solve(motion.transpose());
  const Eigen::MatrixXd covariance = out * of_markers * out.transpose();
  const auto alignment = math::align(pairs, {.with_scale = false, .weighted = false});
  ASSERT_TRUE(alignment) << alignment.error().message;
  Eigen::VectorXd error(coded);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    error.segment<3>(static_cast<Eigen::Index>(3 * i)) = pairs[i].a_mm - alignment->a_from_b * pairs[i].b_mm;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  double chi2 = 0.0;
  int rank = 0;
  for (Eigen::Index i = 6; i < coded; ++i) {  // the six smallest belong to the datum
    const double along = eigen.eigenvectors().col(i).dot(error);
    chi2 += along * along / eigen.eigenvalues()(i);
    ++rank;
  }
  // One seed: a 1e-6 band on each side, so that chance never fails it and a sigma wrong by a factor of two does.
  EXPECT_GT(chi2, math::chi_square_quantile(1e-6, rank)) << "sigmas too large, rank " << rank;
  EXPECT_LT(chi2, math::chi_square_quantile(1.0 - 1e-6, rank)) << "sigmas too small, rank " << rank;
}

TEST_F(Cross, NoWrongIdStaysInTheNetwork) {
  const auto truth = base::read_table(job() / "truth/observations.csv");
  ASSERT_TRUE(truth) << truth.error().message;
  std::map<std::pair<std::string, int>, Eigen::Vector2d> centres;
  const auto image = truth->column("image");
  const auto id = truth->column("id");
  const auto x = truth->column("x_px");
  const auto y = truth->column("y_px");
  ASSERT_TRUE(image && id && x && y);
  for (std::size_t row = 0; row < truth->rows.size(); ++row) {
    centres[{truth->rows[row][*image], truth->integer(row, *id).value()}] = {truth->number(row, *x).value(),
                                                                             truth->number(row, *y).value()};
  }
  std::map<std::pair<std::string, int>, int> rejected;
  const ordered_json adjusted = result("adjust");
  for (const ordered_json& entry : adjusted["rejected"]) ++rejected[{entry["image"], entry["id"]}];
  const auto found = base::read_observations(job() / "results/detect/observations.csv");
  ASSERT_TRUE(found) << found.error().message;
  int right = 0;
  int wrong = 0;  // rings half hidden by a plate in front of them can show another valid code
  for (const base::ImageObservations& photograph : *found) {
    for (const base::Observation& observation : photograph.observations) {
      if (observation.status != base::ObservationStatus::kCoded) continue;
      const auto known = centres.find({photograph.image, observation.id});
      if (known != centres.end() && (known->second - observation.centre_px).norm() < 0.5) {
        ++right;
        continue;
      }
      ++wrong;
      EXPECT_GT((rejected[{photograph.image, observation.id}]--), 0) << photograph.image << " " << observation.id;
    }
  }
  EXPECT_GT(right, static_cast<int>(0.9 * static_cast<double>(centres.size())));
  EXPECT_LT(wrong, right / 50);
}

TEST_F(Cross, ResultsHoldTheKeysThatEveryVersionKeeps) {
  for (const char* verb : {"detect", "adjust", "verify"}) {
    const ordered_json json = result(verb);
    for (const char* key : {"format", "verb", "version", "unit", "frame", "inputs", "options", "verdicts", "warnings"}) {
      EXPECT_TRUE(json.contains(key)) << verb << " " << key;
    }
    EXPECT_EQ(json["format"], "crosstie-result/1");
    EXPECT_EQ(json["verb"], verb);
    EXPECT_TRUE(fs::exists(job() / "results" / verb / "report.html"));
  }
  const ordered_json adjust = result("adjust");
  for (const char* key : {"datum", "sigma0", "sigma0_px", "observations", "unknowns", "conditions", "redundancy", "chi2_p",
                          "iterations", "points", "images", "cameras", "scale_bars", "rejected"}) {
    EXPECT_TRUE(adjust.contains(key)) << key;
  }
  EXPECT_EQ(adjust["redundancy"],
            adjust["observations"].get<int>() - adjust["unknowns"].get<int>() + adjust["conditions"].get<int>());
  EXPECT_EQ(adjust["points"][0]["cov_mm2"].size(), 6U);
  EXPECT_EQ(adjust["images"][0]["network_from_camera"].size(), 16U);
  EXPECT_EQ(adjust["images"][0]["cov"].size(), 21U);
  const ordered_json verify = result("verify");
  for (const char* key : {"count", "rms_mm", "max_mm", "rms3d_mm", "normalised_rms", "transform", "lengths"})
    EXPECT_TRUE(verify.contains(key)) << key;
}

TEST_F(Cross, GivesTheSameBytesForAnyNumberOfThreadsAndEveryRun) {
  std::map<std::string, std::string> first;
  for (const char* threads : {"1", "2", "8"}) {
    const fs::path out = *folder_ / (std::string("threads") + threads);
    const auto run = run_program({"run", job().string(), "--out", out.string(), "--threads", threads});
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const auto files = tests::folder_contents(out);
    ASSERT_GT(files.size(), 10U);
    if (first.empty()) first = files;
    for (const auto& [name, bytes] : files)
      EXPECT_TRUE(first[name] == bytes) << name << " differs with " << threads << " threads";
    EXPECT_EQ(files.size(), first.size());
  }
  EXPECT_TRUE(first == tests::folder_contents(job() / "results")) << "a second run differs from the first";
}

TEST_F(Cross, RecomputesOnlyWhatChanged) {
  const fs::path copy = *folder_ / "copy";
  fs::copy(job(), copy, fs::copy_options::recursive);
  const auto again = run_program({"run", copy.string()});
  EXPECT_THAT(again.err, HasSubstr("24 images, up to date"));
  EXPECT_THAT(again.err, HasSubstr("adjust  up to date"));
  EXPECT_THAT(again.err, HasSubstr("verify  up to date"));

  fs::path photograph;
  for (const auto& entry : fs::directory_iterator(copy / "net")) {
    if (entry.path().extension() == ".png" && (photograph.empty() || entry.path() < photograph)) photograph = entry.path();
  }
  ASSERT_FALSE(photograph.empty());
  fs::remove(photograph);
  const auto fewer = run_program({"run", copy.string()});
  ASSERT_EQ(fewer.exit_code, 0) << fewer.err;
  EXPECT_THAT(fewer.err, HasSubstr("(23 images as before)"));
  const ordered_json adjusted = base::read_json(copy / "results/adjust/result.json").value();
  EXPECT_EQ(adjusted["images"].size(), 23U);
}

}  // namespace
}  // namespace crosstie
