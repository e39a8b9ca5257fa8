#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/board.h"
#include "base/image.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::calib {

/// How the corners of a chessboard are found; circle grids know one way only.
enum class Detector {
  kClassic,  ///< OpenCV's findChessboardCorners, then each corner by the image of its two lines (detail/crossing.h)
  kSectors,  ///< OpenCV's findChessboardCornersSB (Duda & Frese, BMVC 2018)
};

/// "classic", "sb".
[[nodiscard]] std::string_view detector_name(Detector detector);

/// Finds the whole board in an image, or nothing. The corners come row by row as the board counts them; which of its ends is the
/// first the image alone cannot tell for boards that look the same when turned, so calibrate() tests it.
/// The classic detector's corners are fitted to the pixels within a third of the distance to the next line, 3 to 12 px; one that does not look
/// like two crossing lines stays where cornerSubPix put it.
/// Pixels: (0, 0) is the centre of the first pixel. Errors: kBadInput for an image without data; kUsage for an AprilGrid
/// (its corners come from tags: tag_corners()); kInternal where OpenCV throws.
base::Result<std::optional<std::vector<base::BoardCorner>>> find_corners(const base::ImageView& image, const base::Board& board,
                                                                         Detector detector = Detector::kClassic);

/// An image file to be searched.
struct BoardPhoto {
  std::string image;
  std::string camera;
  std::filesystem::path path;
};

/// Reads and searches the files, in parallel; images in which the board is not found have no corners. An Error for a file that
/// cannot be read.
base::Result<std::vector<base::BoardImage>> find_corners(std::span<const BoardPhoto> photos, const base::Board& board,
                                                         Detector detector, int threads, const base::Progress& progress = {});

/// The corners of one tag, in the order of base::tag_corner.
struct TagInImage {
  int id = 0;
  std::array<Eigen::Vector2d, 4> corners_px;
  double sigma_px = 0.0;
};

/// The corners of an AprilGrid from its tags; ids that are not on the board are left out.
std::vector<base::BoardCorner> tag_corners(const base::Board& board, std::span<const TagInImage> tags);

/// One row of a .vnl file.
struct VnlImage {
  std::string image;
  std::vector<Eigen::Vector2d> corners_px;  ///< row by row; not finite where the file says "-"
  std::vector<double> level;                ///< of the image pyramid: sigma doubles with each; negative: not to be used
};

/// Reads corners as mrgingham and mrcal write them: lines `filename x y [level]`, `#` starts a comment, the corners of an
/// image follow each other row by row; `filename - -` says that nothing was found. Images in the order of the file.
/// Errors: kFileSystem; kBadInput with file and line for a line of another form, a value that is not a number, an image that
/// comes back after another.
base::Result<std::vector<VnlImage>> read_vnl(const std::filesystem::path& path);

/// The same as images of one camera; without corners where nothing was found. Errors (kBadInput): an image whose number of
/// corners is not the board's.
base::Result<std::vector<base::BoardImage>> board_images(std::span<const VnlImage> vnl, const base::Board& board,
                                                         const std::string& camera, int width_px, int height_px);

}  // namespace crosstie::calib
