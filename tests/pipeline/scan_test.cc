// Two real fringe scans of one scene, coarse and fine, by the same head; and what scan and patterns refuse.

#include <algorithm>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/ply.h"
#include "tests/support/measured_data.h"
#include "tests/support/program.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::run_program;

const fs::path kManifests = fs::path(CROSSTIE_SOURCE_DIR) / "fixtures" / "manifests";

tests::ProgramRun scan(const fs::path& data, const std::string& which, const fs::path& out,
                       const std::vector<std::string>& more = {}) {
  std::vector<std::string> words = {"scan",
                                    "--rig",
                                    (data / "intrinsic.yml").string() + "," + (data / "extrinsic.yml").string(),
                                    "--left",
                                    (data / which / "left").string(),
                                    "--right",
                                    (data / which / "right").string(),
                                    "--manifest",
                                    (kManifests / ("stereo-scan-" + which + ".json")).string(),
                                    "--out",
                                    out.string()};
  words.insert(words.end(), more.begin(), more.end());
  return run_program(words);
}

constexpr int kWidth = 2048;

/// A scan's points by pixel of the left image.
struct Pixels {
  std::vector<double> depth = std::vector<double>(std::size_t{kWidth} * 1536, std::nan(""));
  std::vector<double> sigma = depth;  ///< of the depth
  std::size_t count = 0;
};

Pixels pixels_of(const fs::path& folder) {
  Pixels pixels;
  const auto cloud = base::read_ply(folder / "cloud.ply");
  EXPECT_TRUE(cloud) << cloud.error().message;
  if (!cloud) return pixels;
  const auto field = [&](const std::string& name) -> const std::vector<double>& {
    return std::find_if(cloud->fields.begin(), cloud->fields.end(), [&](const auto& f) { return f.name == name; })->values;
  };
  const auto& column = field("column");
  const auto& row = field("row");
  const auto& sigma = field("sigma_mm");
  for (std::size_t i = 0; i < cloud->points.size(); ++i) {
    const auto at = static_cast<std::size_t>(row[i] * kWidth + column[i]);
    pixels.depth[at] = cloud->points[i].z();
    pixels.sigma[at] = sigma[i] * cloud->points[i].z() / cloud->points[i].norm();
  }
  pixels.count = cloud->points.size();
  return pixels;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Scatter of the wall (behind 1200 mm) about planes through full squares of 15 pixels, and over what was predicted: medians.
std::pair<double, double> wall_scatter(const Pixels& pixels) {
  constexpr int kSide = 15;
  std::vector<double> scatter, ratio;
  for (int y = 90; y + kSide < 1530; y += kSide) {
    for (int x = 90; x + kSide < 2040; x += kSide) {
      Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
      Eigen::Vector3d right = Eigen::Vector3d::Zero();
      double squares = 0.0, predicted = 0.0;
      int count = 0;
      for (int j = 0; j < kSide; ++j) {
        for (int i = 0; i < kSide; ++i) {
          const auto pixel = static_cast<std::size_t>((y + j) * kWidth + x + i);
          if (!(pixels.depth[pixel] > 1200.0)) continue;
          const double z = pixels.depth[pixel] - 1300.0;
          const Eigen::Vector3d at(1.0, i - 7, j - 7);
          normal += at * at.transpose();
          right += z * at;
          squares += z * z;
          predicted += pixels.sigma[pixel] * pixels.sigma[pixel];
          ++count;
        }
      }
      if (count < kSide * kSide) continue;
      const double rest = squares - right.dot(normal.ldlt().solve(right));
      scatter.push_back(std::sqrt(rest / (count - 3)));
      ratio.push_back(std::sqrt(rest / (count - 3) * count / predicted));
    }
  }
  EXPECT_GT(scatter.size(), 500U);
  return {median(scatter), median(ratio)};
}

TEST(RealScan, CoarseAndFineAgree) {
  const fs::path data = tests::measured_data("stereo-scan");
  if (data.empty()) GTEST_SKIP() << "no stereo-scan in CROSSTIE_DATA";
  const tests::TemporaryFolder work;
  for (const char* which : {"coarse", "fine"}) {
    const auto run = scan(data, which, work / which);
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }
  const Pixels coarse = pixels_of(work / "coarse");
  const Pixels fine = pixels_of(work / "fine");
  EXPECT_GE(coarse.count, 1550000U);
  EXPECT_GE(fine.count, 1800000U);

  std::vector<double> differences;
  for (std::size_t i = 0; i < coarse.depth.size(); ++i) {
    const double difference = coarse.depth[i] - fine.depth[i];
    if (!std::isnan(difference)) differences.push_back(difference);
  }
  EXPECT_GT(differences.size(), 1500000U);
  EXPECT_LE(std::abs(median(differences)), 0.03);

  // Scatter over prediction; the reference's own bounds are for prediction over scatter.
  const auto [coarse_scatter, coarse_ratio] = wall_scatter(coarse);
  const auto [fine_scatter, fine_ratio] = wall_scatter(fine);
  EXPECT_GT(coarse_ratio, 1.0 / 1.15);
  EXPECT_LE(coarse_ratio, 1.1);
  EXPECT_GT(fine_ratio, 1.0 / 1.2);
  EXPECT_LE(fine_ratio, 1.1);

  for (const char* which : {"coarse", "fine"}) {
    const auto run = scan(data, which, work / "filtered", {"--filter-px", "1"});
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const auto result = base::read_json(work / "filtered" / "result.json");
    ASSERT_TRUE(result);
    EXPECT_NEAR((*result)["correlation_length_mm"].get<double>(), 3.0 * 1180.0 / 4588.0, 0.1);
    EXPECT_LE(wall_scatter(pixels_of(work / "filtered")).first, std::string(which) == "coarse" ? 0.55 : 0.10);
  }
}

/// The largest patch of points each of which has a neighbour within two pixels whose depth differs by at most `gap_mm`: 1 where a pixel
/// belongs to it.
std::vector<char> largest_patch(const std::vector<double>& depth, int width, double gap_mm) {
  const int height = static_cast<int>(depth.size()) / width;
  std::vector<int> patch(depth.size(), -1);
  std::vector<std::size_t> sizes;
  for (std::size_t start = 0; start < depth.size(); ++start) {
    if (std::isnan(depth[start]) || patch[start] >= 0) continue;
    const int number = static_cast<int>(sizes.size());
    sizes.push_back(0);
    std::vector<std::size_t> stack = {start};
    patch[start] = number;
    while (!stack.empty()) {
      const std::size_t at = stack.back();
      stack.pop_back();
      ++sizes.back();
      const int x = static_cast<int>(at) % width;
      const int y = static_cast<int>(at) / width;
      for (int row = std::max(0, y - 2); row <= std::min(height - 1, y + 2); ++row) {
        for (int column = std::max(0, x - 2); column <= std::min(width - 1, x + 2); ++column) {
          const auto next = static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column);
          if (std::isnan(depth[next]) || patch[next] >= 0 || std::abs(depth[next] - depth[at]) > gap_mm) continue;
          patch[next] = number;
          stack.push_back(next);
        }
      }
    }
  }
  const auto largest = static_cast<int>(std::max_element(sizes.begin(), sizes.end()) - sizes.begin());
  std::vector<char> member(depth.size());
  for (std::size_t i = 0; i < depth.size(); ++i) member[i] = patch[i] == largest;
  return member;
}

TEST(RealScan, PlasterHeadIsMatchedWithOurOwnCalibration) {
  constexpr int kColumns = 1280;
  constexpr int kRows = 1024;
  const fs::path data = tests::measured_data("plaster-head");
  if (data.empty()) GTEST_SKIP() << "no plaster-head in CROSSTIE_DATA";
  const tests::TemporaryFolder work;
  const auto calibrated = run_program({"calibrate", "--images", "left=" + (data / "board" / "Left_*.jpg").string(), "--images",
                                       "right=" + (data / "board" / "Right_*.jpg").string(), "--pattern", "11x8", "--pitch-mm",
                                       "19", "--detector", "classic", "--no-validation", "--out", (work / "head").string()});
  ASSERT_LE(calibrated.exit_code, 1) << calibrated.err;
  // Whatever is matched becomes a point. JPEG leaves nothing of the noise in dark parts, so that it is given: the residuals agree with it.
  const auto run = run_program({"scan", "--rig", (work / "head").string(), "--left", (data / "scan").string(), "--right",
                                (data / "scan").string(), "--manifest", (kManifests / "plaster-head.json").string(), "--out",
                                (work / "cloud").string(), "--guard-px", "0", "--max-grazing-deg", "90", "--noise-read", "2"});
  ASSERT_LE(run.exit_code, 1) << run.err;
  const auto result = base::read_json(work / "cloud" / "result.json");
  ASSERT_TRUE(result);
  for (const auto& camera : (*result)["cameras"]) EXPECT_NEAR(camera["residual_ratio"].get<double>(), 1.0, 0.1);
  const auto off_surface = (*result)["masked"]["off_surface"].get<std::size_t>();
  EXPECT_GE((*result)["points"].get<std::size_t>() + off_surface, 490000U);
  EXPECT_LE(off_surface, 1000U);

  // A fringe that was told wrongly moves a point by Z^2 T / (f b), T a fringe's extent in the image, 20 px or more: by over 100 mm here, off
  // the head. Patches apart from it are seen behind its edges, or are wrong: few in either case.
  const auto cloud = base::read_ply(work / "cloud" / "cloud.ply");
  ASSERT_TRUE(cloud);
  std::vector<double> depth(std::size_t{kColumns} * kRows, std::nan(""));
  const auto& fields = cloud->fields;
  const auto values = [&](const char* name) -> const std::vector<double>& {
    return std::find_if(fields.begin(), fields.end(), [&](const auto& one) { return one.name == name; })->values;
  };
  for (std::size_t i = 0; i < cloud->points.size(); ++i) {
    const auto row = static_cast<std::size_t>(values("row")[i]);
    depth[row * kColumns + static_cast<std::size_t>(values("column")[i])] = cloud->points[i].z();
  }
  const std::vector<char> head = largest_patch(depth, kColumns, 15.0);
  std::size_t apart = 0;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (std::isnan(depth[i])) continue;
    EXPECT_TRUE(depth[i] > 800.0 && depth[i] < 1100.0) << depth[i];
    if (!head[i]) ++apart;
  }
  EXPECT_LT(apart, 5000U);
}

TEST(RealScan, WrongCapturesAreRefusedByName) {
  const fs::path data = tests::measured_data("stereo-scan");
  if (data.empty()) GTEST_SKIP() << "no stereo-scan in CROSSTIE_DATA";
  const tests::TemporaryFolder work;
  const auto copy = [&](const std::string& name) {
    fs::create_directories(work / name);
    fs::copy(data / "coarse" / "left", work / name / "left");
    fs::copy(data / "coarse" / "right", work / name / "right");
    return work / name;
  };
  const auto run = [&](const fs::path& images, const std::string& manifest) {
    return run_program({"scan", "--rig", (data / "intrinsic.yml").string() + "," + (data / "extrinsic.yml").string(), "--left",
                        (images / "left").string(), "--right", (images / "right").string(), "--manifest",
                        (kManifests / manifest).string(), "--out", (work / "out").string()});
  };
  const fs::path missing = copy("missing");
  fs::remove(missing / "right" / "06.png");
  const auto one = run(missing, "stereo-scan-coarse.json");
  EXPECT_EQ(one.exit_code, 5);
  EXPECT_THAT(one.err, HasSubstr("06.png"));

  const fs::path swapped = copy("swapped");
  fs::rename(swapped / "left" / "05.png", swapped / "left" / "x.png");
  fs::rename(swapped / "left" / "06.png", swapped / "left" / "05.png");
  fs::rename(swapped / "left" / "x.png", swapped / "left" / "06.png");
  const auto two = run(swapped, "stereo-scan-coarse.json");
  EXPECT_EQ(two.exit_code, 3);
  EXPECT_THAT(two.err, HasSubstr("does not agree with the fringes"));

  const auto three = run(data / "coarse", "stereo-scan-fine.json");
  EXPECT_EQ(three.exit_code, 5) << three.err;
  EXPECT_FALSE(fs::exists(work / "out"));
}

TEST(Patterns, AreWrittenWithTheirManifest) {
  const tests::TemporaryFolder work;
  const auto run =
      run_program({"patterns", "--projector", "64x40", "--period-px", "16", "--steps", "4", "--out", (work / "p").string()});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_TRUE(fs::exists(work / "p" / "patterns.json"));
  EXPECT_TRUE(fs::exists(work / "p" / "00.png"));
  const auto again = run_program({"patterns", "--projector", "64x40", "--steps", "5", "--out", (work / "p").string()});
  EXPECT_EQ(again.exit_code, 0) << again.err;
}

TEST(Patterns, WrongWordsAreRefused) {
  const tests::TemporaryFolder work;
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--projector", "64"}, "WIDTHxHEIGHT"},
      {{"--projector", "0x5"}, "WIDTHxHEIGHT"},
      {{"--projector", "64x40", "--steps", "2"}, "2 steps"},
      {{"--projector", "64x40", "--period-px", "a"}, "takes numbers"},
      {{"--projector", "64x40", "--direction", "z"}, "x, y or both"},
      {{"--projector", "64x40", "--gamma", "-1"}, "gamma is -1"}};
  for (const auto& [more, message] : cases) {
    std::vector<std::string> words = {"patterns", "--out", (work / "p").string()};
    words.insert(words.end(), more.begin(), more.end());
    const auto run = run_program(words);
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_THAT(run.err, HasSubstr(message));
    EXPECT_FALSE(fs::exists(work / "p"));
  }
}

}  // namespace
}  // namespace crosstie
