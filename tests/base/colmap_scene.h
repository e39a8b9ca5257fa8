#pragma once

#include <random>
#include <vector>

#include "base/colmap_model.h"

namespace crosstie::base::tests {

inline Camera made(LensModel model, int width_px, int height_px, const std::vector<double>& parameters) {
  auto camera =
      Camera::make(model, width_px, height_px,
                   Eigen::Map<const Eigen::VectorXd>(parameters.data(), static_cast<Eigen::Index>(parameters.size())));
  return *std::move(camera);
}

/// Points before three cameras of different lens models; the image points are exact projections, and every image also has
/// one that belongs to no point.
inline ColmapModel colmap_scene() {
  ColmapModel model;
  model.cameras.push_back({3, made(LensModel::kPinhole, 1600, 1200, {1500.0, 1510.0, 790.25, 601.5})});
  model.cameras.push_back(
      {5, made(LensModel::kOpenCv4, 2000, 1333, {2096.2, 2096.06, 986.92, 664.56, -0.11, 0.09, 2e-4, -3e-4})});
  model.cameras.push_back({9, made(LensModel::kOpenCv8, 2000, 1333,
                                   {2091.7, 2091.6, 985.97, 656.71, 0.2, -0.1, 1e-4, 2e-4, 0.01, 0.3, -0.05, 0.002})});
  std::mt19937_64 random(7);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11U) * 0x1p-53;
  };
  for (std::uint64_t id = 0; id < 40; ++id) {
    ColmapPoint point;
    point.id = id * 7;
    point.xyz = {uniform(-300.0, 300.0), uniform(-300.0, 300.0), uniform(-100.0, 100.0)};
    point.rgb = {static_cast<std::uint8_t>(id), 200, 255};
    point.error_px = 0.01 * static_cast<double>(id);
    model.points.push_back(point);
  }
  for (std::uint32_t i = 0; i < 12; ++i) {
    ColmapImage image;
    image.id = 2 + i;
    image.name = "photo_" + std::to_string(i) + ".png";
    const ColmapCamera& camera = model.cameras[i % model.cameras.size()];
    image.camera_id = camera.id;
    image.camera_from_world.rotation = rotation_exp({uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(-3.0, 3.0)});
    image.camera_from_world.translation_mm = {uniform(-50.0, 50.0), uniform(-50.0, 50.0), uniform(1200.0, 1500.0)};
    image.points.push_back({{12.25, 700.0}, std::nullopt});
    for (ColmapPoint& point : model.points) {
      const auto pixel = camera.camera.project(image.camera_from_world * point.xyz);
      if (!pixel) continue;
      point.track.push_back({image.id, static_cast<std::uint32_t>(image.points.size())});
      image.points.push_back({*pixel, point.id});
    }
    model.images.push_back(image);
  }
  return model;
}

}  // namespace crosstie::base::tests
