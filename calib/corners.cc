#include "calib/corners.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>

#include <fmt/format.h>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>

#include "base/file.h"
#include "base/parallel.h"
#include "calib/detail/crossing.h"

namespace crosstie::calib {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

/// OpenCV wants eight bits; levels are stretched over the image's own range where it has more.
cv::Mat eight_bits(const base::ImageView& image) {
  if (image.bits == 8) {
    return {image.height, image.width, CV_8UC1, const_cast<std::byte*>(image.data),
            static_cast<std::size_t>(image.row_stride_bytes)};
  }
  const cv::Mat deep(image.height, image.width, CV_16UC1, const_cast<std::byte*>(image.data),
                     static_cast<std::size_t>(image.row_stride_bytes));
  double least = 0.0;
  double most = 0.0;
  cv::minMaxLoc(deep, &least, &most);
  cv::Mat result;
  const double scale = 255.0 / std::max(1.0, most - least);
  deep.convertTo(result, CV_8UC1, scale, -scale * least);
  return result;
}

/// The corners as they lie in rows and columns.
class CornerGrid {
 public:
  CornerGrid(std::span<const cv::Point2f> corners, int columns) : corners_(corners), columns_(columns) {}

  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] int rows() const { return static_cast<int>(corners_.size()) / columns_; }
  [[nodiscard]] Eigen::Vector2d at(int column, int row) const {
    const cv::Point2f& corner = corners_[static_cast<std::size_t>(row * columns_ + column)];
    return {corner.x, corner.y};
  }
  /// From a corner to its neighbour along the row (x) or column (y); at the last one from the neighbour before.
  [[nodiscard]] Eigen::Vector2d step(int column, int row, int x, int y) const {
    const bool last = column + x == columns_ || row + y == rows();
    return last ? Eigen::Vector2d(at(column, row) - at(column - x, row - y))
                : Eigen::Vector2d(at(column + x, row + y) - at(column, row));
  }
  /// The printed line along a row or column as it passes a corner. Its curvature is that of the parabola through three neighbours.
  [[nodiscard]] detail::CrossingLine line(int column, int row, int x, int y) const {
    const int middle_column = x == 0 ? column : std::clamp(column, 1, columns_ - 2);
    const int middle_row = y == 0 ? row : std::clamp(row, 1, rows() - 2);
    const Eigen::Vector2d middle = at(middle_column, middle_row);
    const Eigen::Vector2d ahead = at(middle_column + x, middle_row + y) - middle;
    const Eigen::Vector2d behind = middle - at(middle_column - x, middle_row - y);
    const Eigen::Vector2d along = 0.5 * (ahead + behind);
    const Eigen::Vector2d way = column == middle_column && row == middle_row ? along : step(column, row, x, y);
    const double bend = Eigen::Vector2d(-along.y(), along.x()).dot(ahead - behind) / along.norm();
    return {std::atan2(way.y(), way.x()), bend / along.squaredNorm()};
  }
  /// Distance from a corner to the next parallel line of the board.
  [[nodiscard]] double clearance_px(int column, int row) const {
    const Eigen::Vector2d along = step(column, row, 1, 0);
    const Eigen::Vector2d down = step(column, row, 0, 1);
    return std::abs(along.x() * down.y() - along.y() * down.x()) / std::max(along.norm(), down.norm());
  }

 private:
  std::span<const cv::Point2f> corners_;
  int columns_;
};

double least_clearance_px(const CornerGrid& grid) {
  double least = std::numeric_limits<double>::infinity();
  for (int row = 0; row < grid.rows(); ++row) {
    for (int column = 0; column < grid.columns(); ++column) least = std::min(least, grid.clearance_px(column, row));
  }
  return least;
}

/// Every corner by the image of its own two lines; where that is none, it stays.
std::vector<Eigen::Vector2d> as_crossings(const base::ImageView& image, const CornerGrid& grid) {
  constexpr double kRadius = 1.0 / 3.0;  // of the clearance: the blur of the next line ends outside
  constexpr double kLeastRadius_px = 3.0;
  constexpr double kMostRadius_px = 12.0;
  std::vector<Eigen::Vector2d> centres;
  for (int row = 0; row < grid.rows(); ++row) {
    for (int column = 0; column < grid.columns(); ++column) {
      const auto found = detail::find_crossing(
          image, {.start_px = grid.at(column, row),
                  .first = grid.line(column, row, 1, 0),
                  .second = grid.line(column, row, 0, 1),
                  .radius_px = std::clamp(kRadius * grid.clearance_px(column, row), kLeastRadius_px, kMostRadius_px)});
      centres.push_back(found ? found->centre_px : grid.at(column, row));
    }
  }
  return centres;
}

bool find_chessboard(const cv::Mat& grey, const base::Board& board, Detector detector, std::vector<cv::Point2f>& corners) {
  constexpr double kWindow = 0.25;  // half of the window over the clearance: it stays clear of the neighbours
  constexpr int kLeastWindow = 2;
  constexpr int kMostWindow = 11;
  constexpr int kMostIterations = 100;
  constexpr double kSettled_px = 1e-4;
  const cv::Size size(board.columns, board.rows);
  if (detector == Detector::kSectors) {
    return cv::findChessboardCornersSB(grey, size, corners, cv::CALIB_CB_EXHAUSTIVE | cv::CALIB_CB_ACCURACY);
  }
  if (!cv::findChessboardCorners(grey, size, corners, cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE))
    return false;
  const int window =
      std::clamp(static_cast<int>(kWindow * least_clearance_px({corners, board.columns})), kLeastWindow, kMostWindow);
  cv::cornerSubPix(grey, corners, cv::Size(window, window), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, kMostIterations, kSettled_px));
  return true;
}

bool find_circles(const cv::Mat& grey, const base::Board& board, std::vector<cv::Point2f>& centres) {
  const bool shifted = board.pattern == base::BoardPattern::kAsymmetricCircles;
  const int pattern = shifted ? cv::CALIB_CB_ASYMMETRIC_GRID : cv::CALIB_CB_SYMMETRIC_GRID;
  const cv::Size size(board.columns, board.rows);
  // OpenCV's own default knows no dot above 5000 square pixels; all of them together fill less than the image.
  cv::SimpleBlobDetector::Params blobs;
  blobs.maxArea = static_cast<float>(grey.total()) / static_cast<float>(board.count());
  blobs.minDistBetweenBlobs = 3.0F;
  for (const bool bright : {false, true}) {
    blobs.blobColor = bright ? 255 : 0;
    const auto detector = cv::SimpleBlobDetector::create(blobs);
    if (cv::findCirclesGrid(grey, size, centres, pattern, detector) ||
        cv::findCirclesGrid(grey, size, centres, pattern | cv::CALIB_CB_CLUSTERING, detector)) {
      return true;
    }
  }
  return false;
}

}  // namespace

std::string_view detector_name(Detector detector) { return detector == Detector::kClassic ? "classic" : "sb"; }

Result<std::optional<std::vector<base::BoardCorner>>> find_corners(const base::ImageView& image, const base::Board& board,
                                                                   Detector detector) {
  constexpr int kLeastSide = 32;
  if (image.data == nullptr || image.width < kLeastSide || image.height < kLeastSide || (image.bits != 8 && image.bits != 16)) {
    return fail(ErrorCode::kBadInput, fmt::format("an image of {} x {} pixels with {} bits cannot show a board", image.width,
                                                  image.height, image.bits));
  }
  if (board.pattern == base::BoardPattern::kAprilGrid) {
    return fail(ErrorCode::kUsage, "the corners of an AprilGrid come from its tags");
  }
  if (board.pattern == base::BoardPattern::kChessboard && (board.columns < 3 || board.rows < 3)) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("a chessboard of {} x {} inner corners; at least 3 x 3 are needed to find one", board.columns, board.rows));
  }
  try {
    const cv::Mat grey = eight_bits(image);
    std::vector<cv::Point2f> points;
    const bool found = board.pattern == base::BoardPattern::kChessboard ? find_chessboard(grey, board, detector, points)
                                                                        : find_circles(grey, board, points);
    if (!found || static_cast<int>(points.size()) != board.count()) return std::optional<std::vector<base::BoardCorner>>();
    const auto finite = [](const cv::Point2f& point) { return std::isfinite(point.x) && std::isfinite(point.y); };
    if (!std::all_of(points.begin(), points.end(), finite)) return std::optional<std::vector<base::BoardCorner>>();
    const bool crossings = board.pattern == base::BoardPattern::kChessboard && detector == Detector::kClassic;
    const std::vector<Eigen::Vector2d> refined =
        crossings ? as_crossings(image, {points, board.columns}) : std::vector<Eigen::Vector2d>();
    std::vector<base::BoardCorner> corners;
    for (int i = 0; i < board.count(); ++i) {
      const auto at = static_cast<std::size_t>(i);
      corners.push_back({i, crossings ? refined[at] : Eigen::Vector2d(points[at].x, points[at].y), 0.0});
    }
    return corners;
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kFileSystem, "not enough memory");
  } catch (const std::exception& error) {
    return fail(ErrorCode::kInternal, std::string("OpenCV failed to look for the board: ") + error.what());
  }
}

Result<std::vector<base::BoardImage>> find_corners(std::span<const BoardPhoto> photos, const base::Board& board,
                                                   Detector detector, int threads, const base::Progress& progress) {
  std::vector<base::BoardImage> images(photos.size());
  auto ok = base::parallel_for(photos.size(), threads, "corners", progress, [&](std::size_t i) -> Result<> {
    const BoardPhoto& photo = photos[i];
    const auto image = base::read_image(photo.path);
    if (!image) return tl::unexpected(image.error());
    images[i] = {photo.image, photo.camera, image->width(), image->height(), {}};
    auto corners = find_corners(image->view(), board, detector);
    if (!corners) return fail(corners.error().code, base::shown(photo.path) + ": " + corners.error().message);
    if (*corners) images[i].corners = std::move(**corners);
    return {};
  });
  if (!ok) return fail(std::move(ok));
  return images;
}

std::vector<base::BoardCorner> tag_corners(const base::Board& board, std::span<const TagInImage> tags) {
  std::vector<base::BoardCorner> corners;
  for (const TagInImage& tag : tags) {
    for (int k = 0; k < 4; ++k) {
      const auto index = base::tag_corner(board, tag.id, k);
      if (index) corners.push_back({*index, tag.corners_px[static_cast<std::size_t>(k)], tag.sigma_px});
    }
  }
  std::sort(corners.begin(), corners.end(), [](const auto& a, const auto& b) { return a.index < b.index; });
  return corners;
}

}  // namespace crosstie::calib
