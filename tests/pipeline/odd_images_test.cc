// Photographs as they should not be: markers are found or not found, never misread, and what is no photograph is refused.

#include <algorithm>
#include <functional>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/image.h"
#include "base/json_file.h"
#include "base/observation.h"
#include "base/result_document.h"
#include "tests/markers/rendered_marker.h"
#include "tests/support/program.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using tests::MarkerScene;
using tests::TemporaryFolder;

constexpr int kTile_px = 96;
constexpr std::size_t kMarkers[] = {3, 11, 40};

/// Grey levels of three markers side by side; `change` is what is odd about them.
struct Levels {
  int width = 3 * kTile_px;
  int height = kTile_px;
  std::vector<double> values;

  [[nodiscard]] double& at(int x, int y) { return values[static_cast<std::size_t>(y * width + x)]; }
};

Levels three_markers(const std::function<void(MarkerScene&, std::size_t)>& change = {}) {
  Levels levels;
  levels.values.resize(static_cast<std::size_t>(levels.width * levels.height));
  for (std::size_t k = 0; k < 3; ++k) {
    MarkerScene scene;
    scene.family = markers::marker_family("ring10").value();
    scene.code = scene.family.codes[kMarkers[k]].code;
    if (change) change(scene, k);
    const std::vector<double> tile = tests::rendered(scene);
    for (int y = 0; y < kTile_px; ++y) {
      for (int x = 0; x < kTile_px; ++x) {
        levels.at(x + static_cast<int>(k) * kTile_px, y) = tile[static_cast<std::size_t>(y * kTile_px + x)];
      }
    }
  }
  return levels;
}

std::multiset<int> ids_of(std::initializer_list<std::size_t> which) {
  const auto family = markers::marker_family("ring10").value();
  std::multiset<int> ids;
  for (const std::size_t k : which) ids.insert(family.codes[kMarkers[k]].id);
  return ids;
}

void write(const fs::path& path, const Levels& levels, int bits = 8) {
  const double white = bits == 16 ? 65535.0 : 255.0;
  std::vector<double> values = levels.values;
  for (double& value : values) value *= white / 255.0;
  const base::Image image = tests::photograph(values, levels.width, levels.height, {}, bits, white);
  ASSERT_TRUE(base::write_image(path, image.view()));
}

struct Case {
  std::string name;
  std::function<Levels()> picture;
  std::multiset<int> ids;  ///< that are found; wherever it is empty, none may be
  std::vector<std::string> warnings = {};
  std::string family = "ring10";
  int bits = 8;
};

void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

std::vector<Case> cases() {
  const auto all = ids_of({0, 1, 2});
  const auto plain = [](double grey) {
    return [grey] {
      Levels levels;
      levels.values.assign(static_cast<std::size_t>(levels.width * levels.height), grey);
      return levels;
    };
  };
  return {
      {"as it should be", [] { return three_markers(); }, all},
      {"16 bits", [] { return three_markers(); }, all, {}, "ring10", 16},
      {"upside down",
       [] {
         Levels levels = three_markers();
         std::reverse(levels.values.begin(), levels.values.end());
         return levels;
       },
       all},
      {"dots of less than 4 px",
       [] { return three_markers([](MarkerScene& s, std::size_t) { s.radius_px = 1.7; }); },
       {},
       {"no_markers"}},
      {"strongly blurred",
       [] {
         return three_markers([](MarkerScene& s, std::size_t) {
           s.radius_px = 3.0;
           s.blur_px = 4.0;
         });
       },
       {},
       {"no_markers"}},
      {"cut by the border",
       [] {
         return three_markers([](MarkerScene& s, std::size_t k) {
           if (k == 0) s.centre_px.x() = 12.0;
         });
       },
       ids_of({1, 2})},
      {"an id twice",
       [] {
         return three_markers(
             [](MarkerScene& s, std::size_t k) { s.code = s.family.codes[kMarkers[std::max<std::size_t>(k, 1)]].code; });
       },
       ids_of({1, 1, 2})},
      {"another family", [] { return three_markers(); }, {}, {"no_markers"}, "aicon14"},
      {"black", plain(0.0), {}, {"no_markers"}},
      {"saturated", plain(255.0), {}, {"no_markers", "overexposed"}},
      {"overexposed markers",
       [] { return three_markers([](MarkerScene& s, std::size_t) { s.dark_level = s.bright_level = 255.0; }); },
       {},
       {"no_markers", "overexposed"}},
  };
}

class OddImages : public testing::TestWithParam<Case> {};

TEST_P(OddImages, AreReadOrNotButNeverMisread) {
  const TemporaryFolder folder;
  write(folder / "a.png", GetParam().picture(), GetParam().bits);
  const auto run = tests::run_bounded(
      {"detect", "--family", GetParam().family, (folder / "a.png").string(), "--out", (folder / "out").string()});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto images = base::read_observations(folder / "out/observations.csv");
  ASSERT_TRUE(images) << images.error().message;
  std::multiset<int> found;
  for (const auto& image : *images) {
    for (const auto& observation : image.observations) {
      if (observation.status == base::ObservationStatus::kCoded) found.insert(observation.id);
    }
  }
  EXPECT_EQ(found, GetParam().ids);
  const auto result = base::read_json(folder / "out/result.json");
  ASSERT_TRUE(result);
  std::vector<std::string> codes;
  for (const auto& warning : (*result)["warnings"]) codes.push_back(warning["code"]);
  EXPECT_THAT(codes, testing::UnorderedElementsAreArray(GetParam().warnings));
}

std::string test_name(const testing::TestParamInfo<Case>& info) {
  std::string name = info.param.name;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Program, OddImages, testing::ValuesIn(cases()), test_name);

class NoPhotographs : public testing::Test {
 protected:
  tests::ProgramRun detect(const std::vector<std::string>& names) const {
    std::vector<std::string> words = {"detect", "--family", "ring10"};
    for (const std::string& name : names) words.push_back((folder_ / name).string());
    words.insert(words.end(), {"--out", (folder_ / "out").string()});
    return tests::run_bounded(words);
  }
  TemporaryFolder folder_;
};

TEST_F(NoPhotographs, AreRefusedByName) {
  write(folder_ / "good.png", three_markers());
  const std::string good = tests::read_all(folder_ / "good.png");
  const std::pair<const char*, std::string> files[] = {
      {"empty.png", ""},
      {"cut.png", good.substr(0, good.size() / 2)},
      {"claims.pgm", "P5\n30000 30000\n255\n" + std::string(1000, 'x')},
      {"claims.bmp", std::string("BM\x36\x10\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\x30\x75\0\0\x30\x75\0\0\x01\0\x08\0", 30) +
                         std::string(1000, '\0')},
      {"negative.pgm", "P5\n-5 30\n255\n" + std::string(1000, 'x')},
      {"text.png", "id,x_mm\n1,2\n"},
      {"none.jpg", std::string("\xFF\xD8\xFF\xE0", 4) + std::string(500, '\0')},
  };
  Levels pixel;
  pixel.width = pixel.height = 1;
  pixel.values = {100.0};
  write(folder_ / "pixel.png", pixel);
  std::vector<std::pair<std::string, std::string>> all(std::begin(files), std::end(files));
  all.emplace_back("pixel.png", tests::read_all(folder_ / "pixel.png"));
  for (const auto& [name, bytes] : all) {
    SCOPED_TRACE(name);
    folder_.write(name, bytes);
    const auto run = detect({"good.png", name});
    EXPECT_EQ(run.exit_code, 3) << run.err;
    EXPECT_THAT(run.err, HasSubstr(name));
    EXPECT_EQ(std::count(run.err.begin(), run.err.end(), '\n'), 1) << run.err;
    EXPECT_FALSE(fs::exists(folder_ / "out"));
    EXPECT_FALSE(fs::exists(folder_ / ".out.partial"));
  }
}

TEST_F(NoPhotographs, TheSamePhotographTwiceIsSaid) {
  write(folder_ / "a.png", three_markers());
  fs::copy_file(folder_ / "a.png", folder_ / "b.png");
  ASSERT_EQ(detect({"a.png", "b.png"}).exit_code, 0);
  const auto result = base::read_json(folder_ / "out/result.json");
  ASSERT_TRUE(result);
  ASSERT_EQ((*result)["warnings"].size(), 1U);
  EXPECT_EQ((*result)["warnings"][0]["code"], "duplicate_image");
  EXPECT_THAT((*result)["warnings"][0]["message"].get<std::string>(), HasSubstr("a and b"));
  const auto again = detect({"a.png", "a.png"});
  EXPECT_EQ(again.exit_code, 3) << again.err;
  EXPECT_THAT(again.err, HasSubstr("a.png is named twice"));
}

}  // namespace
}  // namespace crosstie
