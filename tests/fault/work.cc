#include "tests/fault/work.h"

#include <algorithm>
#include <cctype>
#include <fstream>

#include <fmt/format.h>

#include "base/camera_file.h"
#include "base/colmap_model.h"
#include "base/image.h"
#include "tests/base/colmap_scene.h"
#include "tests/fault/faulty_program.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

namespace fs = std::filesystem;

bool write(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream(file, std::ios::binary) << text;
  return true;
}

void edit(const fs::path& file, const std::string& from, const std::string& to) {
  std::string text = read_all(file);
  const std::size_t at = text.find(from);
  if (at == std::string::npos) throw std::logic_error(file.string() + " has no " + from);
  write(file, text.replace(at, from.size(), to));
}

bool grey_images(const fs::path& folder) {
  fs::create_directories(folder / "net");
  for (const char* name : {"a.png", "b.png", "c.png"}) {
    base::Image image(64, 48, 8);
    for (int y = 0; y < 48; ++y) std::fill_n(image.row<std::uint8_t>(y), 64, static_cast<std::uint8_t>(name[0]));
    if (!base::write_image(folder / "net" / name, image.view())) return false;
  }
  return true;
}

const std::string kPoints =
    "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n1,0,0,0,0.01,0.01,0.01\n2,500,0,0,0.01,0.01,0.01\n"
    "3,0,400,0,0.01,0.01,0.01\n4,10,20,300,0.01,0.01,0.01\n5,300,320,20,0.01,0.01,0.01\n";

bool points(const fs::path& folder) {
  return write(folder / "measured.csv", kPoints) && write(folder / "reference.csv", kPoints);
}

bool flat_points(const fs::path& folder) {
  std::string rows = "id,x_mm,y_mm,z_mm\n";
  for (int i = 0; i < 12; ++i) rows += fmt::format("{},{},{},{}\n", i + 1, 100 * (i % 4), 90 * (i / 4), 0.01 * (i * i % 7));
  return write(folder / "measured.csv", rows);
}

void move_a_point(const fs::path& folder) { edit(folder / "measured.csv", "\n2,", "\n2,1"); }

bool cameras(const fs::path& folder) {
  const auto a = base::Camera::nominal(base::LensModel::kOpenCv5, 640, 480, 800.0);
  const auto b = base::Camera::nominal(base::LensModel::kOpenCv5, 640, 480, 801.0);
  return base::write_cameramodel(folder / "a.cameramodel", *a) && base::write_cameramodel(folder / "b.cameramodel", *b);
}

void another_camera(const fs::path& folder) {
  const auto a = base::Camera::nominal(base::LensModel::kOpenCv5, 640, 480, 802.0);
  if (!base::write_cameramodel(folder / "a.cameramodel", *a)) throw std::runtime_error("no camera");
}

bool colmap(const fs::path& folder) {
  fs::create_directories(folder / "model");
  return base::write_colmap_model(folder / "model", base::tests::colmap_scene(), base::ColmapFormat::kText).has_value();
}

void another_model(const fs::path& folder) {
  base::ColmapModel scene = base::tests::colmap_scene();
  scene.points.begin()->xyz.x() += 0.125;
  if (!base::write_colmap_model(folder / "model", scene, base::ColmapFormat::kText)) throw std::runtime_error("no model");
}

/// A frame of markers at two heights, seen from all round in small images.
std::string scene_text(int views) {
  std::string text = R"(format = "crosstie-scene/1"
name = "small"
family = "ring10"
[[camera]]
name = "hand"
size_px = [360, 300]
parameters = [460, 460, 179.5, 149.5, 0, 0, 0, 0, 0]
nominal_focal_mm = 24
sensor_width_mm = 18.8
[[body]]
name = "frame"
)";
  int id = 0;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const int height = (row + column) % 2 == 0 ? 0 : 60;
      text += fmt::format("[[body.plate]]\nid = {}\ncentre_mm = [{}, {}, {}]\ndot_radius_mm = 9\n",
                          std::array{0, 1, 2, 3, 5, 6, 7, 10, 12, 13, 14, 15}[static_cast<std::size_t>(id)], 90 * column - 135,
                          90 * row - 90, height);
      ++id;
    }
  }
  return text + fmt::format(
                    "[[orbit]]\ncamera = \"hand\"\ncount = {}\nradius_mm = 560\nelevation_deg = 55\n"
                    "target_mm = [0, 0, 30]\nroll_deg = [0, 90]\n",
                    views);
}

/// Corners of a flat board in poses that tell the lens.
bool write_corners(const fs::path& folder, double noise_px) {
  const auto camera = *base::Camera::nominal(base::LensModel::kPinhole, 640, 480, 700.0);
  std::string text = "# filename x y level\n";
  for (int k = 0; k < 9; ++k) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.35 * (k % 3 - 1), Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(0.35 * (k / 3 - 1), Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(0.3 * k, Eigen::Vector3d::UnitZ()));
    for (int i = 0; i < 48; ++i) {
      const Eigen::Vector3d at = turn * Eigen::Vector3d(20.0 * (i % 8) - 70.0, 20.0 * (i / 8) - 50.0, 0.0) +
                                 Eigen::Vector3d(30.0 * (k % 3 - 1), 25.0 * (k / 3 - 1), 330.0);
      const auto pixel = camera.project(at);
      if (!pixel) return false;
      text += fmt::format("c{:02}.png {:.4f} {:.4f} 0\n", k, pixel->x() + noise_px * ((7 * i + 3 * k) % 5 - 2), pixel->y());
    }
  }
  return write(folder / "corners.vnl", text);
}

bool corners(const fs::path& folder) { return write_corners(folder, 0.03); }

}  // namespace

bool make_small_job(const fs::path& folder) {
  fs::create_directories(folder);
  write(folder / "scene.toml", scene_text(10));
  const auto simulated =
      run_with({"simulate", "--scene", (folder / "scene.toml").string(), "--out", (folder / "job").string(), "--quiet"});
  if (simulated.exit_code != 0) throw std::runtime_error(simulated.err);
  edit(folder / "job/job.toml", "scale = \"free\"", "scale_from = [0, 15]");
  fs::remove(folder / "scene.toml");
  for (const auto& entry : fs::directory_iterator(folder / "job")) fs::rename(entry, folder / entry.path().filename());
  fs::remove(folder / "job");
  fs::remove_all(folder / "truth");
  return true;
}

std::vector<Work> works() {
  return {
      {"init",
       grey_images,
       {"init", "--images", "FOLDER/net", "--family", "ring10", "--out", "FOLDER/job"},
       {"job/job.toml"},
       {},
       2},
      {"targets",
       [](const fs::path&) { return true; },
       {"targets", "--family", "ring10", "--ids", "0-30", "--dot-diameter-mm", "14", "--out", "FOLDER/sheet.svg"},
       {"sheet-1.svg", "sheet-2.svg", "sheet-3.svg"}},
      {"patterns",
       [](const fs::path&) { return true; },
       {"patterns", "--projector", "64x48", "--period-px", "16", "--steps", "3", "--out", "FOLDER/patterns"},
       {"patterns"}},
      {"calibrate",
       corners,
       {"calibrate", "--corners", "FOLDER/corners.vnl", "--camera", "left=c*", "--size", "640x480", "--pattern", "8x6",
        "--pitch-mm", "20", "--lens", "pinhole", "--no-validation", "--out", "FOLDER/out"},
       {"out"},
       [](const fs::path& folder) { write_corners(folder, 0.04); }},
      {"detect",
       grey_images,
       {"detect", "--family", "ring10", "FOLDER/net/a.png", "FOLDER/net/b.png", "--out", "FOLDER/out"},
       {"out"},
       [](const fs::path& folder) {
         fs::copy_file(folder / "net/c.png", folder / "net/b.png", fs::copy_options::overwrite_existing);
       }},
      {"verify",
       points,
       {"verify", "--points", "FOLDER/measured.csv", "--reference", "FOLDER/reference.csv", "--out", "FOLDER/out"},
       {"out"},
       move_a_point},
      {"fit", flat_points, {"fit", "plane", "FOLDER/measured.csv", "--out", "FOLDER/out"}, {"out"}, move_a_point},
      {"compare",
       cameras,
       {"compare", "FOLDER/a.cameramodel", "FOLDER/b.cameramodel", "--columns", "8", "--out", "FOLDER/out"},
       {"out"},
       another_camera},
      {"convert to a list", points, {"convert", "--force", "FOLDER/measured.csv", "FOLDER/new.obc"}, {"new.obc"}, move_a_point},
      {"convert to a camera",
       cameras,
       {"convert", "--force", "FOLDER/a.cameramodel", "FOLDER/new.yaml"},
       {"new.yaml"},
       another_camera},
      {"convert to a model", colmap, {"convert", "--force", "--binary", "FOLDER/model", "FOLDER/out"}, {"out"}, another_model},
      {"simulate",
       [](const fs::path& folder) { return write(folder / "scene.toml", scene_text(2)); },
       {"simulate", "--scene", "FOLDER/scene.toml", "--out", "FOLDER/job"},
       {"job"},
       {},
       2},
      {"plan",
       [](const fs::path& folder) {
         return write(folder / "scene.toml", scene_text(6) +
                                                 "[[scale_bar]]\nname = \"bar\"\nids = [60, 61]\nlength_mm = 200\n"
                                                 "sigma_mm = 0.01\ncentre_mm = [0, 170, 0]\ndirection = [1, 0, 0]\n"
                                                 "normal = [0, 0, 1]\ndot_radius_mm = 9\n");
       },
       {"plan", "FOLDER/scene.toml", "--no-variants", "--out", "FOLDER/out"},
       {"out"},
       [](const fs::path& folder) { edit(folder / "scene.toml", "sigma_mm = 0.01", "sigma_mm = 0.02"); }},
      {"run",
       make_small_job,
       {"run", "FOLDER"},
       {"results/detect", "results/adjust", "results/verify", "results/index.html"},
       [](const fs::path& folder) {
         edit(folder / "job.toml", "name = \"small\"", "name = \"smaller\"");
         edit(folder / "job.toml", "[markers]\n", "[markers]\nexclude_ids = [\"10\"]\n");
       }},
  };
}

std::vector<std::string> words_in(const Work& work, const fs::path& folder) {
  std::vector<std::string> words = work.words;
  for (std::string& word : words) {
    if (word.starts_with("FOLDER")) word = folder.string() + word.substr(6);
  }
  return words;
}

std::string name_of(const Work& work) {
  std::string name = work.name;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

void PrintTo(const Work& work, std::ostream* out) { *out << work.name; }

}  // namespace crosstie::tests
