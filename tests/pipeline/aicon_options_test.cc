// An AICON project through the program: its options, its contradictions, and weights that are wrong.

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "tests/pipeline/synthetic_job.h"
#include "tests/support/program.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::SyntheticNetwork;
using tests::TemporaryFolder;

struct Case {
  std::string name;
  std::vector<std::string> words;
  int exit_code = 0;
  std::string said = {};  ///< in the message, or, where a result is written, in its warnings
  std::function<void(SyntheticNetwork&)> change = {};
  std::vector<std::pair<std::string, std::string>> files = {};
};

void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

void one_blunder(SyntheticNetwork& synthetic) { tests::find_observation(synthetic.network, "i03", 17)->centre_px.x() += 300.0; }

std::vector<Case> cases() {
  return {
      {"undamaged", {}, 0},
      {"sigma of 0", {"--sigma-mm", "0"}, 2, "--sigma-mm must be positive"},
      {"sigma below 0", {"--sigma-px", "-0.1"}, 2, "--sigma-px must be positive"},
      {"sigma that is none", {"--sigma-px", "nan"}, 2, "--sigma-px"},
      {"sigma with a comma", {"--sigma-px", "0,02"}, 2, "--sigma-px"},
      {"two sigmas", {"--sigma-px", "0.02", "--sigma-mm", "0.0001"}, 2, "exclude each other"},
      {"sigma ten times too large", {"--sigma-px", "0.2"}, 0, "sigma0_test"},
      {"sigma ten times too small", {"--sigma-px", "0.002"}, 0, "sigma0_test"},
      {"unknown lens parameter", {"--fixed", "A3,Q1"}, 3, "Q1"},
      {"a blunder that takes part", {"--sigma-px", "0.02"}, 1, "sigma0", one_blunder},
      {"a blunder that is rejected", {"--sigma-px", "0.02", "--reject-outliers"}, 0, "", one_blunder},
      {"start values that are not used", {"--sigma-px", "0.02", "--no-start-values"}, 0},
      {"no scale", {}, 4, "scale", [](SyntheticNetwork& s) { s.network.scale_bars.clear(); }},
      {"one image", {}, 4, "one image", [](SyntheticNetwork& s) { s.network.images.resize(1); }},
      {"an exclusion of nothing",
       {"--exclude", "FOLDER/ids.csv"},
       3,
       "point 17 is no active image point of image 300",
       {},
       {{"ids.csv", "image,id\n300,17\n"}}},
      {"an override of 0", {"--sigma-override", "FOLDER/s.csv"}, 3, "s.csv:2", {}, {{"s.csv", "image,id,sigma_mm\n3,17,0\n"}}},
      {"an exclusion twice", {"--exclude", "FOLDER/i.csv"}, 3, "i.csv:3", {}, {{"i.csv", "image,id\n3,17\n3,17\n"}}},
      {"an image of no camera", {}, 3, "camera 7", [](SyntheticNetwork& s) { s.network.images[3].camera = "c7"; }},
  };
}

class AiconOptions : public testing::TestWithParam<Case> {};

TEST_P(AiconOptions, AreTakenOrRefused) {
  auto synthetic = tests::make_synthetic({.focal_error = 0.0, .model = base::LensModel::kPinhole});
  Eigen::VectorXd parameters = synthetic.cameras[0].parameters();
  parameters(1) = parameters(0);
  synthetic.cameras[0] = *base::Camera::make(base::LensModel::kPinhole, 2000, 1333, parameters);
  tests::project_all(synthetic, 0.02);
  if (GetParam().change) GetParam().change(synthetic);
  const TemporaryFolder folder;
  tests::write_aicon_project(folder, synthetic);
  for (const auto& [name, contents] : GetParam().files) folder.write("options/" + name, contents);
  std::vector<std::string> words = {"adjust", "--aicon", folder.path().string(), "--out", (folder / "out").string()};
  for (std::string word : GetParam().words) {
    if (word.starts_with("FOLDER/")) word = (folder / "options" / word.substr(7)).string();
    words.push_back(word);
  }
  const auto run = tests::run_bounded(words);
  EXPECT_EQ(run.exit_code, GetParam().exit_code) << run.err;
  const bool written = GetParam().exit_code <= 1;
  ASSERT_EQ(fs::exists(folder / "out/result.json"), written);
  EXPECT_FALSE(fs::exists(folder / ".out.partial"));
  std::string text = run.err;
  if (written) text = base::read_json(folder / "out/result.json").value()["warnings"].dump();
  EXPECT_THAT(text, HasSubstr(GetParam().said));
}

std::string test_name(const testing::TestParamInfo<Case>& info) {
  std::string name = info.param.name;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Program, AiconOptions, testing::ValuesIn(cases()), test_name);

}  // namespace
}  // namespace crosstie
