#include "tests/pipeline/synthetic_job.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "base/image.h"
#include "base/json_file.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "tests/support/program.h"

namespace crosstie::tests {
namespace {

namespace fs = std::filesystem;

std::string job_text(const SyntheticNetwork& synthetic, const JobText& text) {
  std::string job = "format = \"crosstie-job/1\"\n[markers]\nfamily = \"ring10\"\n" + text.markers;
  std::string images;
  for (const base::NetworkCamera& camera : synthetic.network.cameras) {
    job += fmt::format("[camera.{}]\nfocal_px = {}\n{}", camera.name, camera.camera.parameters()(0), text.camera);
    images += fmt::format("{}{} = \"net/{}_*.png\"", images.empty() ? "" : ", ", camera.name, camera.name);
  }
  return job + fmt::format("[network]\nimages = {{ {} }}\n{}{}", images, text.network, text.rest);
}

/// The true camera of an image.
const base::Camera& camera_of(const SyntheticNetwork& synthetic, const base::ImageObservations& image) {
  const auto& cameras = synthetic.network.cameras;
  const auto found =
      std::find_if(cameras.begin(), cameras.end(), [&](const auto& candidate) { return candidate.name == image.camera; });
  return synthetic.cameras[static_cast<std::size_t>(found - cameras.begin())];
}

}  // namespace

void project_all(SyntheticNetwork& synthetic, double noise_px) {
  Random random(23);
  for (std::size_t k = 0; k < synthetic.network.images.size(); ++k) {
    auto& image = synthetic.network.images[k];
    const base::Observation form = image.observations.front();
    image.observations.clear();
    const base::Camera& seen_by = camera_of(synthetic, image);
    for (std::size_t p = 0; p < synthetic.points.size(); ++p) {
      const auto pixel = seen_by.project(synthetic.network_from_camera[k].inverse() * synthetic.points[p]);
      if (!pixel) continue;
      base::Observation observation = form;
      observation.id = synthetic.ids[p];
      observation.centre_px = *pixel + noise_px * Eigen::Vector2d(random.normal(), random.normal());
      image.observations.push_back(observation);
    }
  }
}

void give_dots(SyntheticNetwork& synthetic, double diameter_mm) {
  for (std::size_t k = 0; k < synthetic.network.images.size(); ++k) {
    auto& image = synthetic.network.images[k];
    const base::Camera& camera = camera_of(synthetic, image);
    const base::Pose camera_from_network = synthetic.network_from_camera[k].inverse();
    for (base::Observation& observation : image.observations) {
      const Eigen::Vector3d& centre = synthetic.point(observation.id);
      const Eigen::Vector2d at = *camera.project(camera_from_network * centre);
      Eigen::Matrix2d axes;
      for (int i = 0; i < 2; ++i) {
        const Eigen::Vector3d step = 1e-3 * Eigen::Vector3d::Unit(i);
        axes.col(i) = 0.5e3 * diameter_mm * (*camera.project(camera_from_network * (centre + step)) - at);
      }
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(axes * axes.transpose());
      observation.semi_minor_px = std::sqrt(eigen.eigenvalues()(0));
      observation.semi_major_px = std::sqrt(eigen.eigenvalues()(1));
      observation.angle_rad = std::atan2(eigen.eigenvectors()(1, 1), eigen.eigenvectors()(0, 1));
    }
  }
}

std::string photograph_name(const SyntheticNetwork& synthetic, std::size_t k) {
  return fmt::format("{}_{:02}", synthetic.network.images[k].camera, k / synthetic.network.cameras.size());
}

bool write_synthetic_job(const TemporaryFolder& folder, const SyntheticNetwork& synthetic, const JobText& text) {
  folder.write("job.toml", job_text(synthetic, text));
  fs::create_directories(folder / "net");
  std::vector<base::ImageObservations> images = synthetic.network.images;
  std::map<std::string, const base::ImageObservations*> by_name;
  for (std::size_t k = 0; k < images.size(); ++k) {
    images[k].image = photograph_name(synthetic, k);
    by_name[images[k].image] = &images[k];
    base::Image image(32, 24, 8);
    for (int y = 0; y < 24; ++y) std::fill_n(image.row<std::uint8_t>(y), 32, static_cast<std::uint8_t>(100 + k));
    if (!base::write_image(folder / "net" / (images[k].image + ".png"), image.view())) return false;
  }
  if (!base::write_scale_bars(folder / "bars.csv", synthetic.network.scale_bars)) return false;
  const fs::path detection = folder / "results/detect";
  if (run_program({"adjust", folder.path().string()}).exit_code == 0) return false;  // there is nothing in the images
  if (!fs::exists(detection)) return true;  // the job was refused before any image was looked at
  if (!base::write_observations(detection / "observations.csv", images)) return false;
  auto result = base::read_json(detection / "result.json");
  if (!result) return false;
  for (auto& image : (*result)["images"]) {
    const base::ImageObservations& seen = *by_name.at(image["name"]);
    image["width"] = seen.width_px;
    image["height"] = seen.height_px;
    image["count"] = seen.observations.size();
  }
  return base::write_json(detection / "result.json", *result).has_value();
}

void write_aicon_project(const TemporaryFolder& folder, const SyntheticNetwork& synthetic) {
  constexpr double kMmPerPx = 0.006;
  std::string cameras;
  std::string images;
  std::string image_points;
  std::string object_points;
  std::string scales;
  for (std::size_t c = 0; c < synthetic.cameras.size(); ++c) {
    const base::Camera& camera = synthetic.cameras[c];
    const Eigen::VectorXd& p = camera.parameters();
    const double x0 = (p(2) - 0.5 * (camera.width_px() - 1)) * kMmPerPx;
    const double y0 = -(p(3) - 0.5 * (camera.height_px() - 1)) * kMmPerPx;
    cameras +=
        fmt::format("{} -999 {:.9f} {:.9f} {:.9f} 0 0 0\n0\n0 0\n0 0\n{:.9f} {:.9f} {} {}\n", c, -p(0) * kMmPerPx, x0, y0,
                    camera.width_px() * kMmPerPx, camera.height_px() * kMmPerPx, camera.width_px(), camera.height_px());
  }
  for (std::size_t k = 0; k < synthetic.network.images.size(); ++k) {
    const base::ImageObservations& image = synthetic.network.images[k];
    const base::Pose& pose = synthetic.network_from_camera[k];
    const Eigen::Vector3d& at = pose.translation_mm;
    const Eigen::Vector3d angles =
        (pose.rotation * Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0)).toRotationMatrix().eulerAngles(0, 1, 2);
    images += fmt::format("{} {} {:.9f} {:.9f} {:.9f} {:.12f} {:.12f} {:.12f} 0 1 1\n", k, image.camera.substr(1), at.x(),
                          at.y(), at.z(), angles.x(), angles.y(), angles.z());
    for (const base::Observation& observation : image.observations) {
      image_points += fmt::format("{} {} {:.9f} {:.9f} 0.0001 0.0001 0 0 3 1 0\n", k, observation.id,
                                  (observation.centre_px.x() - 0.5 * (image.width_px - 1)) * kMmPerPx,
                                  -(observation.centre_px.y() - 0.5 * (image.height_px - 1)) * kMmPerPx);
    }
  }
  for (std::size_t p = 0; p < synthetic.points.size(); ++p) {
    const Eigen::Vector3d& at = synthetic.points[p];
    object_points += fmt::format("{} {:.6f} {:.6f} {:.6f} fix fix fix 12 1 0 0\n", synthetic.ids[p], at.x(), at.y(), at.z());
  }
  for (const base::ScaleBar& bar : synthetic.network.scale_bars) {
    scales += fmt::format("0 \"bar\" {} {} {:.6f} {:.6f} 1\n", bar.id_a, bar.id_b, bar.length_mm, bar.sigma_mm);
  }
  folder.write("p.ior", cameras);
  folder.write("p.eor", images);
  folder.write("p.phc", image_points);
  folder.write("p.obc", object_points);
  folder.write("p.scale", scales.empty() ? "0 \"bar\" 900001 900002 1 1 0\n" : scales);
}

}  // namespace crosstie::tests
