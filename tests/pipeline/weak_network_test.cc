// Networks that do not determine what is asked for, that contradict themselves, or that only look as if they did, through the
// program: the exit code, and the weak part by its name.

#include <algorithm>
#include <functional>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/point_list.h"
#include "tests/pipeline/synthetic_job.h"
#include "tests/support/program.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;
using testing::HasSubstr;
using tests::find_observation;
using tests::JobText;
using tests::make_synthetic;
using tests::SyntheticNetwork;
using tests::TemporaryFolder;

/// A job before it is written.
struct Draft {
  SyntheticNetwork synthetic = make_synthetic({});
  JobText text = {};
  std::map<std::string, std::string> files = {};
};

struct Case {
  std::string name;
  std::function<void(Draft&)> draw;
  int exit_code = 0;
  std::vector<std::string> words = {};  ///< in the message, or, where a result is written, in its warnings and rejections
};

void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

std::string rows_of(const std::vector<std::size_t>& which, const SyntheticNetwork& synthetic, double sigma_mm,
                    double first_x_off_mm = 0.0) {
  std::string rows = "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n";
  for (const std::size_t i : which) {
    const Eigen::Vector3d& at = synthetic.points[i];
    rows += fmt::format("{},{},{},{},{},{},{}\n", synthetic.ids[i], at.x() + (i == which.front() ? first_x_off_mm : 0.0),
                        at.y(), at.z(), sigma_mm, sigma_mm, sigma_mm);
  }
  return rows;
}

void control(Draft& draft, const std::string& rows) {
  draft.text.network = "control = \"control.csv\"\n";
  draft.files["control.csv"] = rows;
}

/// All image points of an id moved by so many px in one image.
void move(Draft& draft, const std::string& image, int id, double dx_px) {
  find_observation(draft.synthetic.network, image, id)->centre_px.x() += dx_px;
}

void blunders(Draft& draft, double share) {
  tests::Random random(5);
  for (auto& image : draft.synthetic.network.images) {
    for (auto& observation : image.observations) {
      if (random.uniform() < share) observation.centre_px += 40.0 * Eigen::Vector2d(random.normal(), random.normal());
    }
  }
}

void states_sigma(Draft& draft, double sigma_px) {
  for (auto& image : draft.synthetic.network.images) {
    for (auto& observation : image.observations) observation.cov_px2 = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
  }
}

std::vector<Case> weak() {
  return {
      {"no scale", [](Draft& d) { d.text.network = ""; }, 4, {"scale_bars", "scale_from", "control"}},
      {"bars whose ends nobody sees",
       [](Draft& d) {
         for (auto& bar : d.synthetic.network.scale_bars) bar.id_b = 500 + bar.id_a;
       },
       4,
       {"scale"}},
      {"one image", [](Draft& d) { d.synthetic.network.images.resize(1); }, 4, {"one image"}},
      {"two images", [](Draft& d) { d.synthetic.network.images.resize(2); }, 4, {"camera c0"}},
      {"one projection centre",
       [](Draft& d) { d.synthetic = make_synthetic({.images = 8, .moving = false}); },
       4,
       {"projection centre"}},
      {"one projection centre before a plane",
       [](Draft& d) { d.synthetic = make_synthetic({.images = 8, .depth_mm = 0.0, .moving = false}); },
       4,
       {"projection centre"}},
      {"two blocks",
       [](Draft& d) {
         for (std::size_t i = 0; i < d.synthetic.network.images.size(); ++i) {
           std::erase_if(d.synthetic.network.images[i].observations,
                         [&](const auto& observation) { return (observation.id < 25) != (i < 6); });
         }
       },
       4,
       {"blocks", "c0_00 ... c0_05"}},
      {"no common markers",
       [](Draft& d) {
         for (std::size_t i = 0; i < 12; ++i) {
           std::erase_if(d.synthetic.network.images[i].observations,
                         [&](const auto& observation) { return observation.id % 12 != static_cast<int>(i); });
         }
       },
       4,
       {"markers"}},
      {"parallel views of a plane, never rolled, free lens",
       [](Draft& d) {
         d.synthetic = make_synthetic({.images = 9, .depth_mm = 0.0, .rolled = false});
         for (std::size_t i = 0; i < 9; ++i) {
           const Eigen::Vector3d position(120.0 * static_cast<double>(i % 3) - 120.0, 90.0 * static_cast<double>(i / 3) - 90.0,
                                          1200.0);
           d.synthetic.network_from_camera[i] = tests::looking_at(position, position - Eigen::Vector3d(0.0, 0.0, 1000.0), 0.0);
         }
         tests::project_all(d.synthetic, 0.02);
       },
       4,
       {"camera c0"}},
      {"points on a line",
       [](Draft& d) {
         for (auto& point : d.synthetic.points) point = {point.x() + 3.0 * point.y(), 0.0, 0.0};
         tests::project_all(d.synthetic, 0.02);
       },
       4,
       {}},
      {"a datum that leaves the frame free",
       [](Draft& d) {
         d.text.network += "datum = \"datum.csv\"\n";
         d.files["datum.csv"] = "id,x_mm,y_mm,z_mm,axes\n10,0,0,0,z\n15,450,0,0,z\n34,0,360,0,z\n";
       },
       4,
       {"datum leaves the frame free"}},
      {"two control points",
       [](Draft& d) {
         control(d, rows_of({0, 29}, d.synthetic, 0.01));
       },
       4,
       {"control points"}},
  };
}

std::vector<Case> refused() {
  const auto rig = [](Draft& d, const std::string& cameras, int image_cameras) {
    d.synthetic = make_synthetic({.cameras = image_cameras, .rig = image_cameras > 1, .images = 12});
    d.text.rest = "[rig]\ncameras = " + cameras + "\n";
  };
  return {
      {"unknown lens parameter is fixed", [](Draft& d) { d.text.camera = "fixed = [\"q1\"]\n"; }, 3, {"q1", "c0"}},
      {"unknown lens parameter has a sigma", [](Draft& d) { d.text.camera = "sigmas = { q1 = 0.1 }\n"; }, 3, {"q1", "c0"}},
      {"negative sigma of a lens parameter",
       [](Draft& d) { d.text.camera = "sigmas = { k1 = -0.1 }\n"; },
       3,
       {"job.toml:", "sigma"}},
      {"rig with a camera that the job lacks", [rig](Draft& d) { rig(d, "[\"c0\", \"c7\"]", 2); }, 3, {"c7"}},
      {"rig of one camera", [rig](Draft& d) { rig(d, "[\"c0\"]", 1); }, 3, {"two or more"}},
      {"a lone bar in inches",
       [](Draft& d) {
         tests::give_dots(d.synthetic, 6.0);
         d.text.markers = "dot_diameter_mm = 6.0\n";
         d.synthetic.network.scale_bars.resize(1);
         d.synthetic.network.scale_bars[0].length_mm /= 25.4;
       },
       3,
       {"inches", "dot_diameter_mm"}},
      {"all bars in metres",
       [](Draft& d) {
         tests::give_dots(d.synthetic, 6.0);
         d.text.markers = "dot_diameter_mm = 6.0\n";
         for (auto& bar : d.synthetic.network.scale_bars) bar.length_mm /= 1000.0;
       },
       3,
       {"metres", "dot_diameter_mm"}},
      {"two lengths that define the scale",
       [](Draft& d) {
         for (auto& bar : d.synthetic.network.scale_bars) bar.role = base::ScaleBarRole::kDefines;
       },
       3,
       {"more than one length defines the scale"}},
      {"free scale and bars", [](Draft& d) { d.text.network += "scale = \"free\"\n"; }, 3, {"free", "scale_bars"}},
      {"mirrored control",
       [](Draft& d) {
         auto mirrored = d.synthetic;
         for (auto& point : mirrored.points) point.x() *= -1.0;
         control(d, rows_of({0, 5, 24, 29, 14, 8}, mirrored, 0.01));
       },
       3,
       {"control"}},
      {"control without sigmas",
       [](Draft& d) { control(d, "id,x_mm,y_mm,z_mm\n10,0,0,0\n15,1,0,0\n34,0,1,0\n"); },
       3,
       {"control point 10", "sigma"}},
      {"axes of a datum that are none",
       [](Draft& d) {
         d.text.network += "datum = \"datum.csv\"\n";
         d.files["datum.csv"] = "id,x_mm,y_mm,z_mm,axes\n10,0,0,0,xyz\n15,450,0,0,w\n34,0,360,0,z\n";
       },
       3,
       {"datum.csv:3", "axes", "'w'"}},
      {"images of different sizes", [](Draft& d) { d.synthetic.network.images[4].width_px = 1999; }, 3, {"c0_04", "sizes"}},
  };
}

std::vector<Case> done() {
  return {
      {"undamaged", [](Draft&) {}},
      {"dots of the stated diameter",
       [](Draft& d) {
         tests::give_dots(d.synthetic, 6.0);
         d.text.markers = "dot_diameter_mm = 6.0\n";
       }},
      {"a scale that is free", [](Draft& d) { d.text.network = "scale = \"free\"\n"; }},
      {"a point with one ray",
       [](Draft& d) {
         for (std::size_t i = 1; i < 12; ++i) {
           std::erase_if(d.synthetic.network.images[i].observations, [](const auto& o) { return o.id == 20; });
         }
       },
       0,
       {"\"id\":20,\"reason\":\"one ray only\""}},
      {"two ids swapped in one image",
       [](Draft& d) {
         std::swap(find_observation(d.synthetic.network, "i03", 12)->centre_px,
                   find_observation(d.synthetic.network, "i03", 30)->centre_px);
       },
       0,
       {"at the place of id 30", "at the place of id 12", "wrong_ids 12 in c0_03"}},
      {"a point that moved between the images",
       [](Draft& d) {
         for (std::size_t i = 6; i < 12; ++i) move(d, fmt::format("i{:02}", i), 20, 25.0);
       },
       0,
       {"moved between images", "moved_points 20"}},
      {"one image mirrored",
       [](Draft& d) {
         for (auto& observation : d.synthetic.network.images[3].observations) {
           observation.centre_px.x() = 1999.0 - observation.centre_px.x();
         }
       },
       0,
       {"image_not_oriented c0_03"}},
      {"bars that contradict each other by 0.5 %",
       [](Draft& d) { d.synthetic.network.scale_bars[1].length_mm *= 1.005; },
       1,
       {"contradicting_bars 10-39", "15-34"}},
      {"one bar of two in inches",
       [](Draft& d) { d.synthetic.network.scale_bars[1].length_mm /= 25.4; },
       1,
       {"contradicting_bars 10-39", "15-34"}},
      {"a lone bar", [](Draft& d) { d.synthetic.network.scale_bars.resize(1); }, 0, {"one_scale_bar 10-39"}},
      {"control that contradicts the images",
       [](Draft& d) {
         control(d, rows_of({14, 0, 5, 24, 29}, d.synthetic, 0.01, 1.0));
       },
       1,
       {"contradicting_control", "24 ("}},
      {"blunders, 1 %", [](Draft& d) { blunders(d, 0.01); }, 0, {"wrong id: image point lies"}},
      {"blunders, 5 %", [](Draft& d) { blunders(d, 0.05); }, 0, {"wrong id: image point lies", "many_rejected"}},
      {"blunders, 30 %", [](Draft& d) { blunders(d, 0.30); }, 0, {"wrong id: image point lies", "many_rejected"}},
      {"no noise", [](Draft& d) { d.synthetic = make_synthetic({.noise_px = 0.0}); }},
      {"sigmas stated ten times too small", [](Draft& d) { states_sigma(d, 0.002); }, 0, {"sigma_estimated"}},
      {"sigmas stated ten times too large", [](Draft& d) { states_sigma(d, 0.2); }, 0, {"sigma0_test", "too large"}},
      {"sigmas stated as 0", [](Draft& d) { states_sigma(d, 0.0); }, 0, {"no_image_covariance"}},
      {"unused rig: cameras that see the same station",
       [](Draft& d) {
         d.synthetic = make_synthetic({.cameras = 2, .rig = true, .images = 12});
         d.text.rest = "[rig]\ncameras = [\"c0\", \"c1\"]\n";
       }},
  };
}

/// Warnings and rejections as one text.
std::string said_in(const ordered_json& result) {
  std::string text;
  for (const auto& warning : result["warnings"]) {
    text += fmt::format("{} {}: {}\n", warning["code"].get<std::string>(), warning.value("subject", ""),
                        warning["message"].get<std::string>());
  }
  for (const auto& rejected : result["rejected"]) text += rejected.dump() + "\n";
  return text;
}

/// The largest difference of a distance between two points from the truth.
double largest_length_error(const ordered_json& result, const SyntheticNetwork& synthetic) {
  std::map<int, Eigen::Vector3d> at;
  for (const auto& point : result["points"]) {
    at[point["id"]] = {point["xyz_mm"][0].get<double>(), point["xyz_mm"][1].get<double>(), point["xyz_mm"][2].get<double>()};
  }
  double largest = 0.0;
  for (const auto& [a, xyz_a] : at) {
    for (const auto& [b, xyz_b] : at) largest = std::max(largest, std::abs((xyz_a - xyz_b).norm() - synthetic.distance(a, b)));
  }
  return largest;
}

class WeakNetwork : public testing::TestWithParam<Case> {};

TEST_P(WeakNetwork, IsToldAsItIs) {
  Draft draft;
  GetParam().draw(draft);
  const TemporaryFolder folder;
  for (const auto& [name, contents] : draft.files) folder.write(name, contents);
  ASSERT_TRUE(tests::write_synthetic_job(folder, draft.synthetic, draft.text));
  const auto run = tests::run_bounded({"adjust", folder.path().string()});
  EXPECT_EQ(run.exit_code, GetParam().exit_code) << run.err;
  const fs::path adjust = folder / "results/adjust";
  const bool written = GetParam().exit_code <= 1;
  ASSERT_EQ(fs::exists(adjust / "result.json"), written) << run.err;
  std::string text = run.err;
  if (written) {
    const auto result = base::read_json(adjust / "result.json");
    ASSERT_TRUE(result) << result.error().message;
    text = said_in(*result);
    if (GetParam().exit_code == 0 && draft.text.network.find("free") == std::string::npos) {
      EXPECT_LT(largest_length_error(*result, draft.synthetic), 0.15) << "what is wrong has bent the network";
    }
  }
  for (const std::string& word : GetParam().words) EXPECT_THAT(text, HasSubstr(word));
  for (const auto& entry : fs::recursive_directory_iterator(folder.path())) {
    EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << "left behind: " << entry.path();
  }
}

std::string test_name(const testing::TestParamInfo<Case>& info) {
  std::string name = info.param.name;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(NoUniqueSolution, WeakNetwork, testing::ValuesIn(weak()), test_name);
INSTANTIATE_TEST_SUITE_P(BadInput, WeakNetwork, testing::ValuesIn(refused()), test_name);
INSTANTIATE_TEST_SUITE_P(Done, WeakNetwork, testing::ValuesIn(done()), test_name);

TEST(WeakNetworks, ARigWhoseCamerasShareNoStation) {
  const auto synthetic = make_synthetic({.cameras = 2, .rig = true, .images = 12});
  const TemporaryFolder folder;
  ASSERT_TRUE(tests::write_synthetic_job(folder, synthetic, {.rest = "[rig]\ncameras = [\"c0\", \"c1\"]\n"}));
  for (int k = 0; k < 6; ++k)
    fs::rename(folder / fmt::format("net/c1_{:02}.png", k), folder / fmt::format("net/c1_{:02}.png", 50 + k));
  const auto run = tests::run_bounded({"adjust", folder.path().string()});
  EXPECT_EQ(run.exit_code, 3) << run.err;
  EXPECT_THAT(run.err, HasSubstr("[rig] no two images of its cameras belong together"));
}

}  // namespace
}  // namespace crosstie
