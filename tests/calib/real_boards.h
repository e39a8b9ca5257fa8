#pragma once

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "calib/calibrate.h"
#include "calib/corners.h"
#include "tests/support/measured_data.h"

namespace crosstie::tests {

/// The 13 pairs of Debian's opencv-doc as corners that OpenCV found, with the board's prior as with_default_prior() states it.
inline calib::BoardViews opencv_pairs(const std::filesystem::path& folder, bool free_board) {
  base::Board board{.columns = 9, .rows = 6, .pitch_mm = 25.0};
  board.free = free_board;
  calib::BoardViews views{board.with_default_prior(), {"left", "right"}, {}};
  const auto vnl = calib::read_vnl(folder / "opencv-corners.vnl");
  EXPECT_TRUE(vnl);
  for (const std::string& camera : views.cameras) {
    std::vector<calib::VnlImage> of_camera;
    for (const auto& image : *vnl) {
      if (image.image.starts_with(camera)) of_camera.push_back(image);
    }
    const auto images = calib::board_images(of_camera, board, camera, 640, 480);
    EXPECT_TRUE(images);
    views.images.insert(views.images.end(), images->begin(), images->end());
  }
  return views;
}

}  // namespace crosstie::tests
