#pragma once

#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/network.h"
#include "base/result_document.h"

namespace crosstie::tests {

/// A folder as `adjust` leaves it: two photographs of three points.
inline base::AdjustedNetwork write_result(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  base::AdjustedNetwork network;
  network.cameras = {{"left", *base::Camera::nominal(base::LensModel::kOpenCv5, 2000, 1333, 2100.0), true}};
  for (const int id : {3, 11, 52}) {
    base::AdjustedPoint point;
    point.id = id;
    point.xyz_mm = Eigen::Vector3d(100.0 / id, 200.0 / 3.0, id);
    point.cov_mm2 = Eigen::Vector3d(1e-6, 4e-6, 9e-6).asDiagonal();
    network.points.push_back(point);
  }
  for (const char* name : {"a", "b"}) {
    base::AdjustedImage image;
    image.name = name;
    image.camera = "left";
    image.network_from_camera = {base::rotation_exp({0.1, -0.2, name[0] - 97.0}), {10.0, 20.0, -1500.0}};
    for (int i = 0; i < 3; ++i) {
      base::AdjustedObservation observation;
      observation.image = static_cast<int>(network.images.size());
      observation.point = i;
      const auto pixel = network.cameras[0].camera.project(image.network_from_camera.inverse() *
                                                           network.points[static_cast<std::size_t>(i)].xyz_mm);
      EXPECT_TRUE(pixel);
      observation.measured_px = *pixel;
      network.residuals.push_back(observation);
    }
    network.images.push_back(image);
  }
  const auto result = base::result_json({"adjust", "network", {}, {}, {}}, {}, base::network_json(network));
  EXPECT_TRUE(base::write_json(folder / "result.json", result));
  EXPECT_TRUE(base::write_residuals(folder / "residuals.csv", network));
  return network;
}

}  // namespace crosstie::tests
