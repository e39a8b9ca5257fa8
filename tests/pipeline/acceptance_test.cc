// crosstie verify --acceptance and --repeat from their files to their results; clouds of a drawn ball bar, sphere and plate.
#include <cmath>
#include <fstream>
#include <numbers>
#include <random>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_file.h"
#include "base/ply.h"
#include "tests/report/markup.h"
#include "tests/support/program.h"
#include "tests/support/temporary_folder.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using ::testing::HasSubstr;

constexpr double kSigma_mm = 0.02;

/// A sphere as seen along z; `larger_mm` is the scanner's error of its radius.
void add_sphere(base::Cloud& cloud, const Vector3d& centre, double radius, double larger_mm, std::mt19937_64& random) {
  std::normal_distribution<double> normal(0.0, kSigma_mm);
  for (double x = -0.95 * radius; x < 0.95 * radius; x += 0.9) {
    for (double y = -0.95 * radius; y < 0.95 * radius; y += 0.9) {
      if (std::hypot(x, y) > 0.95 * radius) continue;
      const Vector3d n = Vector3d(x, y, -std::sqrt(radius * radius - x * x - y * y)) / radius;
      cloud.points.push_back(centre + (radius + larger_mm) * n + Vector3d(normal(random), normal(random), normal(random)));
      cloud.cov_mm2.emplace_back(kSigma_mm * kSigma_mm * Eigen::Matrix3d::Identity());
    }
  }
}

/// Three places of a bar of 300.02 mm with spheres of 38.1 mm and one of a plate, and the file that describes them.
void write_test(const fs::path& folder, std::uint64_t seed, double larger_mm) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0.0, kSigma_mm);
  fs::create_directories(folder);
  std::string text =
      "format = \"crosstie-acceptance/1\"\nname = \"head 2\"\nvolume_diagonal_mm = 300.0\n"
      "[limits]\nsource = \"contract 4711\"\npf_mm = 0.2\nps_mm = 0.06\nsd_mm = 0.05\nf_mm = 0.2\n"
      "[bar]\ndiameter_a_mm = 38.1\ndiameter_b_mm = 38.1\ndiameter_sigma_mm = 0.001\nlength_mm = 300.02\nlength_sigma_mm = "
      "0.002\n"
      "[plane]\nform_mm = 0.005\n";
  const Vector3d directions[] = {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d(0.6, 0.0, 0.8)};
  for (int i = 0; i < 3; ++i) {
    base::Cloud cloud;
    cloud.frame = "rig";
    add_sphere(cloud, Vector3d(-100.0, 0.0, 1200.0), 19.05, larger_mm, random);
    add_sphere(cloud, Vector3d(-100.0, 0.0, 1200.0) + 300.02 * directions[i], 19.05, larger_mm, random);
    ASSERT_TRUE(base::write_ply(folder / fmt::format("bar{}.ply", i), cloud));
    text += fmt::format("[[position]]\nname = \"bar {}\"\nartefact = \"bar\"\ncloud = \"bar{}.ply\"\n", i, i);
  }
  base::Cloud plate;
  plate.frame = "rig";
  for (double x = -80.0; x <= 80.0; x += 3.0) {
    for (double y = -80.0; y <= 80.0; y += 3.0) {
      plate.points.emplace_back(x, y, 1200.0 + 0.1 * x + normal(random));
      plate.cov_mm2.emplace_back(kSigma_mm * kSigma_mm * Eigen::Matrix3d::Identity());
    }
  }
  ASSERT_TRUE(base::write_ply(folder / "plate.ply", plate));
  text += "[[position]]\nname = \"plate\"\nartefact = \"plane\"\ncloud = \"plate.ply\"\n";
  ASSERT_TRUE(std::ofstream(folder / "acceptance.toml") << text);
}

const nlohmann::ordered_json& entry(const nlohmann::ordered_json& list, const std::string& name) {
  for (const auto& of : list) {
    if (of["name"] == name) return of;
  }
  std::abort();
}

TEST(AcceptanceVerb, JudgesAScannerAndItsRepeatability) {
  const tests::TemporaryFolder folder;
  std::vector<std::string> repeat = {"verify", "--max-ratio", "2", "--out", (folder / "repeat").string()};
  for (int run = 1; run <= 5; ++run) {
    const fs::path input = folder.path() / fmt::format("in{}", run);
    write_test(input, static_cast<std::uint64_t>(run), 0.0);
    const fs::path out = folder.path() / fmt::format("run{}", run);
    const auto done =
        tests::run_program({"verify", "--acceptance", (input / "acceptance.toml").string(), "--out", out.string()});
    ASSERT_EQ(done.exit_code, 0) << done.err;
    repeat.insert(repeat.end(), {"--repeat", out.string()});
  }
  const auto json = *base::read_json(folder.path() / "run1" / "result.json");
  EXPECT_EQ(json["verb"], "verify");
  EXPECT_EQ(json["frame"], "rig");
  const auto& characteristics = json["acceptance"]["characteristics"];
  ASSERT_EQ(characteristics.size(), 4U);
  EXPECT_EQ(entry(characteristics, "PF")["positions"], 6);
  EXPECT_EQ(entry(characteristics, "SD")["positions"], 3);
  EXPECT_EQ(entry(characteristics, "F")["positions"], 1);
  // Range of 0.3 % beyond: 5.94 sigma.
  EXPECT_NEAR(entry(characteristics, "F")["value_mm"].get<double>(), 5.94 * kSigma_mm, 0.02);
  EXPECT_LT(std::abs(entry(characteristics, "SD")["value_mm"].get<double>()),
            4.0 * entry(characteristics, "SD")["sigma_mm"].get<double>());
  EXPECT_EQ(json["verdicts"].size(), 4U);
  for (const auto& verdict : json["verdicts"]) {
    EXPECT_EQ(verdict["source"], "contract 4711");
    EXPECT_EQ(verdict["level"], "OK") << verdict.dump();
  }
  const auto html = base::read_file(folder.path() / "run1" / "report.html");
  ASSERT_TRUE(html);
  EXPECT_EQ(tests::markup_error(*html), std::nullopt);
  EXPECT_LT(html->find("class=\"banner"), html->find("id=\"characteristics\""));
  EXPECT_TRUE(fs::exists(folder.path() / "run1" / "acceptance.csv"));

  const auto repeated = tests::run_program(repeat);
  ASSERT_EQ(repeated.exit_code, 0) << repeated.err;
  const auto result = *base::read_json(folder.path() / "repeat" / "result.json");
  ASSERT_EQ(result["repeatability"]["groups"].size(), 4U);
  for (const auto& group : result["repeatability"]["groups"]) {
    EXPECT_GT(group["ratio_high"].get<double>(), 0.9) << group["name"];
    EXPECT_LT(group["ratio_low"].get<double>(), 1.1) << group["name"];
  }
  const auto repeat_html = base::read_file(folder.path() / "repeat" / "report.html");
  ASSERT_TRUE(repeat_html);
  EXPECT_EQ(tests::markup_error(*repeat_html), std::nullopt);
}

TEST(AcceptanceVerb, AScannerThatIsWrongFails) {
  const tests::TemporaryFolder folder;
  write_test(folder.path() / "in", 9, 0.05);  // diameters 0.1 mm too large
  const auto done = tests::run_program(
      {"verify", "--acceptance", (folder / "in" / "acceptance.toml").string(), "--out", (folder / "out").string()});
  EXPECT_EQ(done.exit_code, 1) << done.err;
  const auto json = *base::read_json(folder.path() / "out" / "result.json");
  EXPECT_NEAR(entry(json["acceptance"]["characteristics"], "PS")["value_mm"].get<double>(), 0.1, 0.02);
  EXPECT_EQ(entry(json["acceptance"]["characteristics"], "PS")["level"], "FAIL");
  EXPECT_EQ(entry(json["acceptance"]["characteristics"], "SD")["level"], "OK");
}

TEST(AcceptanceVerb, RefusesWithThePlaceOfTheMistake) {
  const tests::TemporaryFolder folder;
  const fs::path file = folder.path() / "acceptance.toml";
  const auto run = [&](const std::string& text) {
    EXPECT_TRUE(std::ofstream(file) << text);
    return tests::run_program({"verify", "--acceptance", file.string(), "--out", (folder / "out").string()});
  };
  const std::string head = "format = \"crosstie-acceptance/1\"\n";
  EXPECT_THAT(run("name = \"x\"\n").err, HasSubstr("crosstie-acceptance/1"));
  EXPECT_THAT(run(head).err, HasSubstr("needs positions"));
  EXPECT_THAT(run(head + "[limits]\npv_mm = 0.1\n").err, HasSubstr("did you mean"));
  const auto missing = run(head + "[[position]]\nname = \"a\"\nartefact = \"bar\"\ncloud = \"a.ply\"\n");
  EXPECT_THAT(missing.err, HasSubstr("no section [bar]"));
  EXPECT_EQ(missing.exit_code, 3);
  EXPECT_EQ(tests::run_program({"verify", "--repeat", "a", "--out", "b"}).exit_code, 2);
  EXPECT_EQ(tests::run_program({"verify", "--acceptance", "a", "--points", "b", "--out", "c"}).exit_code, 2);
}

}  // namespace
}  // namespace crosstie
