// A job's scans through the program: a synthetic head, a wall with markers painted on it, fringes; and heads and captures that are wrong.

#include <cmath>
#include <fstream>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/npy.h"
#include "base/ply.h"
#include "base/result_document.h"
#include "markers/family.h"
#include "tests/scan/synthetic_scan.h"
#include "tests/support/program.h"
#include "tests/support/synthetic_calibration.h"

namespace crosstie {
namespace {

namespace fs = std::filesystem;
using base::Pattern;
using base::PatternKind;
using nlohmann::ordered_json;
using testing::HasSubstr;
using tests::run_program;

constexpr double kZ_mm = 1200.0;  // of the wall on the left camera's axis
constexpr double kTilt_rad = 0.1;
constexpr double kDot_mm = 16.0;

struct Painted {
  int id;
  double along_mm, down_mm;  ///< on the wall, from where the left camera's axis meets it
};
const std::array<Painted, 4> kPainted = {{{3, -60.0, -90.0}, {15, 60.0, 80.0}, {42, 190.0, -80.0}, {60, 200.0, 95.0}}};

const Eigen::Vector3d kAlong(std::cos(kTilt_rad), 0.0, -std::sin(kTilt_rad));

Eigen::Vector3d on_wall(double along_mm, double down_mm) { return Eigen::Vector3d(0.0, down_mm, kZ_mm) + along_mm * kAlong; }

/// A step from 1 to 0 at 0, as wide as a camera's pixel there.
double edge(double distance_mm) { return 0.5 * std::erfc(distance_mm / 2.4); }

/// White: 1, black: 0, of a ring10 marker at this place beside its middle.
double tone(std::uint64_t code, double x_mm, double y_mm) {
  const double radius = std::hypot(x_mm, y_mm);
  const double segment = (std::atan2(y_mm, x_mm) + std::numbers::pi) / (2.0 * std::numbers::pi) * 10.0;
  const auto bit = [&](int i) { return static_cast<double>((code >> static_cast<unsigned>(9 - (i + 10) % 10)) & 1U); };
  const int here = std::min(9, static_cast<int>(segment));
  const double arc_mm = 2.0 * std::numbers::pi * radius / 10.0;
  const double since = (segment - here) * arc_mm;
  const double ring =
      bit(here) + (bit(here - 1) - bit(here)) * edge(since) + (bit(here + 1) - bit(here)) * edge(arc_mm - since);
  const auto inside = [&](double radii) { return edge(radius - radii * kDot_mm); };
  return inside(1.0) + (inside(2.6) - inside(1.8)) * ring + (1.0 - inside(3.2));
}

double painted(double u, double v) {
  // The wall's place under the projector's ray (tests/scan/synthetic_scan.cc).
  const Eigen::Vector3d projector(150.0, 20.0, 0.0);
  const Eigen::Vector3d ray((u - 0.5) * 0.5 - 0.12, (v - 0.5) * 0.5, 1.0);
  const Eigen::Vector3d normal(std::sin(kTilt_rad), 0.0, std::cos(kTilt_rad));
  const Eigen::Vector3d point = projector + ray * (kZ_mm * normal.z() - normal.dot(projector)) / normal.dot(ray);
  const double along = (point - Eigen::Vector3d(0.0, 0.0, kZ_mm)).dot(kAlong);
  static const markers::MarkerFamily family = *markers::marker_family("ring10");
  double albedo = 0.75;
  for (const Painted& one : kPainted) {
    const double radius = std::hypot(along - one.along_mm, point.y() - one.down_mm);
    if (radius > 4.2 * kDot_mm) continue;
    const double plate = edge(radius - 3.6 * kDot_mm);
    albedo = (1.0 - plate) * 0.75 +
             plate * (0.06 + 0.94 * tone(*family.code_of(one.id), along - one.along_mm, point.y() - one.down_mm));
  }
  return albedo;
}

base::PatternSequence sequence_of(bool both) {
  base::PatternSequence sequence = tests::gray_and_fringes(24.0, 6, false, both);
  Pattern white;
  Pattern black;
  black.kind = PatternKind::kBlack;
  sequence.patterns.insert(sequence.patterns.begin(), {white, black});
  Pattern again = sequence.patterns[static_cast<std::size_t>(sequence.fringe_images(base::ProjectorAxis::kX, 0).front())];
  again.repeat = true;
  sequence.patterns.insert(sequence.patterns.end(), {again, white, black});
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) sequence.patterns[i].files.fill(fmt::format("{:02}.png", i));
  return sequence;
}

/// Writes what the scene's cameras see; images from `change` on are of `after`.
void capture(const fs::path& folder, const tests::SyntheticScan& scene, const tests::SyntheticScan& after, std::size_t change,
             const base::PatternSequence& sequence, std::uint64_t seed) {
  fs::create_directories(folder);
  ASSERT_TRUE(base::write_pattern_manifest(folder / "patterns.json", sequence));
  for (int camera = 0; camera < 2; ++camera) {
    const fs::path images = folder / (camera == 0 ? "left" : "right");
    fs::create_directories(images);
    std::mt19937_64 random(seed + static_cast<std::uint64_t>(camera));
    for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
      const base::Image image = (i < change ? scene : after).image(camera, sequence, sequence.patterns[i], random);
      ASSERT_TRUE(base::write_image(images / sequence.patterns[i].files[0], image.view()));
    }
  }
}

/// The result of a calibration of this head. Its sigmas are a fiftieth of those of a head that is shown elsewhere: as those of a calibration are,
/// they leave the epipolar curves a hundredth of a pixel, not half a pixel.
void write_head(const fs::path& folder, const base::Head& head) {
  constexpr double kSigmas = 0.02;
  base::Calibration calibration = tests::synthetic_calibration();
  calibration.covariance *= kSigmas * kSigmas;
  const Eigen::MatrixXd covariance = kSigmas * kSigmas * calibration.cameras[0].camera.covariance();
  calibration.cameras[0].camera = head.left;
  calibration.cameras[1].camera = head.right;
  for (base::CalibratedCamera& camera : calibration.cameras) {
    camera.area = {head.left.width_px(), head.left.height_px()};
    camera.camera.set_covariance(covariance);
  }
  calibration.rig->right_from_left = head.right_from_left;
  calibration.rig->baseline_mm = head.right_from_left.translation_mm.norm();
  fs::create_directories(folder);
  const base::ResultEnvelope envelope{"calibrate", "rig", {}, {}, {}};
  ASSERT_TRUE(base::write_json(folder / "result.json",
                               base::result_json(envelope, ordered_json::object(), base::calibration_json(calibration))));
  ASSERT_TRUE(base::write_covariance(folder, {calibration.covariance, calibration.labels}));
}

tests::SyntheticScan painted_wall() {
  tests::SyntheticScan scene;
  scene.albedo = painted;
  return scene;
}

void write_job(const fs::path& job) {
  std::ofstream(job / "job.toml") << R"(format = "crosstie-job/1"
name = "wall"
[markers]
family = "ring10"
dot_diameter_mm = 32.0
thickness_mm = 0.0
[camera.left]
model = "head"
[camera.right]
model = "head"
[rig]
cameras = ["left", "right"]
[[station]]
name = "x0850"
axis_mm = 850.0
scan = { left = "x0850/left", right = "x0850/right", manifest = "x0850/patterns.json" }
[[station]]
name = "x0900"
axis_mm = 900.0
)";
}

TEST(ScanJob, StationsAreScannedWithTheJobsHeadAndMarkers) {
  const tests::TemporaryFolder work;
  const fs::path job = work / "job";
  const tests::SyntheticScan scene = painted_wall();
  write_head(job / "head", scene.head);
  write_job(job);
  capture(job / "x0850", scene, scene, 0, sequence_of(true), 1);
  const auto run = run_program({"scan", job.string()});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, HasSubstr("scan x0850"));
  const fs::path out = job / "results" / "scan" / "x0850";
  for (const char* file : {"result.json", "report.html", "cloud.ply", "depth.tiff", "markers.csv", "marker_points.csv"})
    EXPECT_TRUE(fs::exists(out / file)) << file;
  EXPECT_FALSE(fs::exists(job / "results" / "scan" / "x0900"));
  const auto result = base::read_json(out / "result.json");
  ASSERT_TRUE(result);
  EXPECT_EQ((*result)["head_test"]["source"], "phases");
  EXPECT_LT((*result)["head_test"]["off_px"].get<double>(), 0.05);
  ASSERT_EQ((*result)["markers"].size(), kPainted.size());
  for (std::size_t i = 0; i < kPainted.size(); ++i) {
    const ordered_json& marker = (*result)["markers"][i];
    EXPECT_EQ(marker["id"], kPainted[i].id);
    const Eigen::Vector3d truth = on_wall(kPainted[i].along_mm, kPainted[i].down_mm);
    Eigen::Vector3d p;
    for (Eigen::Index k = 0; k < 3; ++k) p(k) = marker["xyz_mm"][static_cast<std::size_t>(k)];
    EXPECT_LT((p - truth).norm(), 2.0) << kPainted[i].id << ": a pixel is 2.4 mm there";
    EXPECT_GT(marker["calibration_cov_mm2"][0].get<double>(), 0.0);
    ASSERT_FALSE(marker["height_mm"].is_null()) << kPainted[i].id;
    EXPECT_LT(std::abs(marker["height_mm"].get<double>()), 4.0 * marker["height_sigma_mm"].get<double>() + 0.5);
  }
  EXPECT_GT((*result)["masked"]["on_markers"].get<int>(), 4000);
  const auto cloud = base::read_ply(out / "cloud.ply");
  ASSERT_TRUE(cloud);
  for (const Eigen::Vector3d& point : cloud->points) {
    for (const Painted& one : kPainted) ASSERT_GT((point - on_wall(one.along_mm, one.down_mm)).norm(), 3.5 * kDot_mm);
  }
  const auto observations = base::read_observations(out / "markers.csv");
  ASSERT_TRUE(observations);
  EXPECT_EQ(observations->front().image, "x0850/left");

  EXPECT_THAT(run_program({"scan", job.string(), "--station", "x0850"}).err, HasSubstr("up to date"));
  capture(job / "x0850", scene, scene, 0, sequence_of(true), 2);
  EXPECT_THAT(run_program({"scan", job.string()}).err, HasSubstr("points"));

  const auto all = run_program({"run", job.string()});
  EXPECT_EQ(all.exit_code, 0) << all.err;
  EXPECT_THAT(all.err, HasSubstr("x0850: up to date"));
  EXPECT_THAT(all.out, HasSubstr("x0850/report.html"));

  EXPECT_EQ(run_program({"scan", job.string(), "--station", "x0950"}).exit_code, 2);
  const auto none = run_program({"scan", job.string(), "--station", "x0900"});
  EXPECT_EQ(none.exit_code, 3);
  EXPECT_THAT(none.err, HasSubstr("has no scan"));
  EXPECT_EQ(run_program({"scan", job.string(), "--rig", "head"}).exit_code, 2);

  // The overview tells of every station that the job has scanned, and not of one that it had.
  std::string text = tests::read_all(job / "job.toml");
  const std::string second = "axis_mm = 900.0\n";
  text.replace(text.find(second), second.size(),
               second + "scan = { left = \"x0900/left\", right = \"x0900/right\", manifest = \"x0850/patterns.json\" }\n");
  std::ofstream(job / "job.toml") << text;
  fs::copy(out, job / "results" / "scan" / "x0800");
  EXPECT_EQ(run_program({"scan", job.string(), "--station", "x0850"}).exit_code, 0);
  const std::string overview = tests::read_all(job / "results" / "index.html");
  EXPECT_THAT(overview, HasSubstr("href=\"scan/x0850/report.html\""));
  EXPECT_THAT(overview, HasSubstr("scan x0900"));
  EXPECT_THAT(overview, HasSubstr("2 missing")) << "the scan, and the stitch that two scans want";
  EXPECT_THAT(overview, testing::Not(HasSubstr("x0800")));
}

struct WrongScan {
  const char* name;
  bool both;
  std::function<void(const fs::path& job)> spoil;  ///< what is wrong, of a capture that is right
  int exit_code;
  const char* message;
};

class WrongScans : public testing::TestWithParam<WrongScan> {};

void turn_right_camera(const fs::path& job, const Eigen::Vector3d& by_rad) {
  base::Head head = painted_wall().head;
  base::Vector6d turned = base::Vector6d::Zero();  // about its own axes: it stays where it is
  turned.head<3>() = by_rad;
  head.right_from_left = base::perturbed(head.right_from_left, turned);
  write_head(job / "head", head);
}

void swap_files(const fs::path& a, const fs::path& b) {
  fs::rename(a, a.string() + ".x");
  fs::rename(b, a);
  fs::rename(a.string() + ".x", b);
}

TEST_P(WrongScans, AreRefusedWithTheReason) {
  const WrongScan& wrong = GetParam();
  const tests::TemporaryFolder work;
  const fs::path job = work / "job";
  const tests::SyntheticScan scene = painted_wall();
  write_head(job / "head", scene.head);
  write_job(job);
  capture(job / "x0850", scene, scene, 0, sequence_of(wrong.both), 1);
  wrong.spoil(job);
  const auto run = run_program({"scan", job.string()});
  EXPECT_EQ(run.exit_code, wrong.exit_code) << run.err;
  EXPECT_THAT(run.err, HasSubstr(wrong.message));
  EXPECT_FALSE(fs::exists(job / "results" / "scan" / "x0850")) << "nothing is written of a scan that is refused";
}

INSTANTIATE_TEST_SUITE_P(
    ScanJob, WrongScans,
    testing::Values(
        WrongScan{"Pitched", true,
                  [](const fs::path& job) {
                    turn_right_camera(job, {1e-3, 0.0, 0.0});
                  },
                  3, "changed by pitch"},
        WrongScan{"Rolled", true,
                  [](const fs::path& job) {
                    turn_right_camera(job, {0.0, 0.0, 1e-3});
                  },
                  3, "changed by roll"},
        WrongScan{"Yawed", true,
                  [](const fs::path& job) {
                    turn_right_camera(job, {0.0, 5e-3, 0.0});
                  },
                  3, "changed by yaw"},
        // From the texture of some places a pitch cannot be told from a baseline that turned upwards.
        WrongScan{"PitchedWithOneDirection", false,
                  [](const fs::path& job) {
                    turn_right_camera(job, {1e-3, 0.0, 0.0});
                  },
                  3, "off the epipolar curves"},
        WrongScan{"ExchangedCameras", true,
                  [](const fs::path& job) { swap_files(job / "x0850" / "left", job / "x0850" / "right"); }, 3,
                  "left and the right camera are exchanged"},
        WrongScan{"ExchangedCamerasWithOneDirection", false,
                  [](const fs::path& job) { swap_files(job / "x0850" / "left", job / "x0850" / "right"); }, 3,
                  "left and the right camera are exchanged"},
        WrongScan{"MissingImage", true, [](const fs::path& job) { fs::remove(job / "x0850" / "right" / "07.png"); }, 5,
                  "07.png"},
        WrongScan{"ExchangedCode", true,
                  [](const fs::path& job) { swap_files(job / "x0850" / "left" / "03.png", job / "x0850" / "left" / "04.png"); },
                  3, "Gray code of the axis x does not agree with the fringes"},
        WrongScan{"ExchangedFringes", true,
                  [](const fs::path& job) { swap_files(job / "x0850" / "left" / "09.png", job / "x0850" / "left" / "10.png"); },
                  3, "the images are in another order than the manifest says"},
        WrongScan{"MovedScene", true,
                  [](const fs::path& job) {
                    tests::SyntheticScan after = painted_wall();
                    after.surface = tests::tilted_plane(kZ_mm + 6.0, kTilt_rad);
                    capture(job / "x0850", painted_wall(), after, 10, sequence_of(true), 1);
                  },
                  3, "moved during the scan"},
        WrongScan{"ChangedLight", true,
                  [](const fs::path& job) {
                    tests::SyntheticScan after = painted_wall();
                    after.amplitude *= 0.8;
                    capture(job / "x0850", painted_wall(), after, 16, sequence_of(true), 1);
                  },
                  3, "the projector's light changed by -20"},
        WrongScan{"ManifestOfAnotherSequence", true,
                  [](const fs::path& job) {
                    base::PatternSequence other = sequence_of(true);
                    // As if the fringes were shown before the code.
                    std::rotate(other.patterns.begin() + 2, other.patterns.begin() + 8, other.patterns.begin() + 14);
                    for (std::size_t i = 0; i < other.patterns.size(); ++i)
                      other.patterns[i].files.fill(fmt::format("{:02}.png", i));
                    ASSERT_TRUE(base::write_pattern_manifest(job / "x0850" / "patterns.json", other));
                  },
                  3, "x0850"}),
    [](const auto& tested) { return std::string(tested.param.name); });

}  // namespace
}  // namespace crosstie
