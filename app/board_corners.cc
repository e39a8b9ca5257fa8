// images -> corners of the board

#include <algorithm>
#include <set>

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "app/steps_calibrate.h"
#include "base/image.h"
#include "base/parallel.h"
#include "calib/corners.h"
#include "calib/pairing.h"
#include "markers/family.h"
#include "markers/tags.h"

namespace crosstie::app {
namespace {

using base::BoardImage;
using base::ErrorCode;
using base::Result;

/// The corners of a file, each image to the camera whose pattern its name fits.
Result<FoundCorners> corners_of_file(const CalibrationTask& task) {
  const auto all = calib::read_vnl(*task.corners);
  if (!all) return tl::unexpected(all.error());
  FoundCorners found{task.corners->filename().string(), {}};
  std::set<std::string> taken;
  for (const auto& [camera, pattern] : task.corner_patterns) {
    std::vector<calib::VnlImage> of_camera;
    for (const calib::VnlImage& image : *all) {
      if (!fits_pattern(image.image, pattern)) continue;
      if (!taken.insert(image.image).second) {
        return base::fail(ErrorCode::kUsage, fmt::format("{}: the image {} fits the patterns of two cameras",
                                                         task.corners->string(), image.image));
      }
      of_camera.push_back(image);
    }
    if (of_camera.empty()) {
      return base::fail(ErrorCode::kBadInput,
                        fmt::format("{}: no image fits '{}' of camera {}", task.corners->string(), pattern, camera));
    }
    auto images = calib::board_images(of_camera, task.board.board, camera, task.width_px, task.height_px);
    if (!images) return base::fail(images.error().code, fmt::format("{}: {}", task.corners->string(), images.error().message));
    std::move(images->begin(), images->end(), std::back_inserter(found.images));
  }
  return found;
}

Result<FoundCorners> corners_of_tags(const CalibrationTask& task, Session& session) {
  const auto family = markers::marker_family(task.board.family);
  if (!family) return tl::unexpected(family.error());
  if (!family->tag) {
    return base::fail(
        ErrorCode::kBadInput,
        fmt::format("an AprilGrid is made of tags, and {} has none; such as apriltag:tag36h11", task.board.family));
  }
  FoundCorners found{"tags", std::vector<BoardImage>(task.images.size())};
  const auto done =
      base::parallel_for(task.images.size(), session.threads(), "tags", session.progress(), [&](std::size_t i) -> Result<> {
        const ImageFile& file = task.images[i];
        const auto image = base::read_image(file.path);
        if (!image) return tl::unexpected(image.error());
        const auto tags = markers::detect_tags(image->view(), *family);
        if (!tags) return base::fail(tags.error().code, fmt::format("{}: {}", file.path.string(), tags.error().message));
        std::vector<calib::TagInImage> read;
        for (const markers::TagObservation& tag : *tags) {
          if (tag.status != base::ObservationStatus::kCoded) continue;
          read.push_back({tag.id, tag.corners_px, std::sqrt(tag.corners_cov_px2.trace() / 8.0)});
        }
        found.images[i] = {file.name, file.camera, image->width(), image->height(), calib::tag_corners(task.board.board, read)};
        return {};
      });
  if (!done) return tl::unexpected(done.error());
  return found;
}

Result<FoundCorners> corners_of_board(const CalibrationTask& task, calib::Detector detector, const char* name,
                                      const base::Board& board, Session& session) {
  std::vector<calib::BoardPhoto> photos;
  for (const ImageFile& file : task.images) photos.push_back({file.name, file.camera, file.path});
  auto images = calib::find_corners(photos, board, detector, session.threads(), session.progress());
  if (!images) return base::fail(std::move(images));
  return FoundCorners{name, std::move(*images)};
}

/// Some of the photographs in which the board was found: whole stations, spread evenly over all of them.
std::vector<ImageFile> sample_of(const CalibrationTask& task, const FoundCorners& found, std::size_t images) {
  const auto stations = calib::pair_by_name(found.images, task.cameras);
  if (!stations) return task.images;  // the calibration says why
  // With the board in the images of all cameras; where there is none, with the board in any.
  std::vector<std::vector<std::size_t>> usable;
  for (std::size_t least = task.cameras.size(); least > 0 && usable.empty(); --least) {
    for (const base::BoardStation& station : *stations) {
      std::vector<std::size_t> of_station;
      for (const int image : station.images) {
        if (image >= 0 && !found.images[static_cast<std::size_t>(image)].corners.empty())
          of_station.push_back(static_cast<std::size_t>(image));
      }
      if (of_station.size() >= least) usable.push_back(std::move(of_station));
    }
  }
  const std::size_t count = std::min(usable.size(), std::max<std::size_t>(1, images / task.cameras.size()));
  std::vector<ImageFile> sample;
  for (std::size_t i = 0; i < count; ++i) {
    for (const std::size_t image : usable[i * usable.size() / count]) sample.push_back(task.images[image]);
  }
  std::sort(sample.begin(), sample.end(), [](const ImageFile& a, const ImageFile& b) { return a.name < b.name; });
  return sample;
}

/// The second detector, to be compared with the classic one. It takes tens of times as long: where all images together are large it sees a
/// sample of them, unless the first found the board in fewer than half and is no good for these photographs.
Result<FoundCorners> corners_to_compare(const CalibrationTask& task, const FoundCorners& classic, Session& session) {
  constexpr double kMostPixels = 25e6;
  constexpr std::size_t kLeastStations = 4;
  double pixels = 0.0;
  for (const BoardImage& image : classic.images) pixels += static_cast<double>(image.width_px) * image.height_px;
  const bool found_by_half = 2 * classic.images_with_board() >= static_cast<int>(classic.images.size());
  if (pixels <= kMostPixels || !found_by_half)
    return corners_of_board(task, calib::Detector::kSectors, "sb", task.board.board, session);
  CalibrationTask sample = task;
  const auto affordable = static_cast<std::size_t>(static_cast<double>(task.images.size()) * kMostPixels / pixels);
  sample.images = sample_of(task, classic, std::max(affordable, kLeastStations * task.cameras.size()));
  auto corners = corners_of_board(sample, calib::Detector::kSectors, "sb", task.board.board, session);
  if (corners) corners->sample = sample.images.size() < task.images.size();
  return corners;
}

/// Why nothing was found; a board of one corner less in either direction tells that squares were counted.
tl::unexpected<base::Error> not_found(const CalibrationTask& task, Session& session) {
  const base::Board& board = task.board.board;
  std::string hint = "corners counts the inner corners of a chessboard or the dots of a grid, columns first";
  base::Board smaller = board;
  --smaller.columns;
  --smaller.rows;
  if (board.pattern == base::BoardPattern::kChessboard && smaller.columns > 2 && smaller.rows > 2) {
    const auto found = corners_of_board(task, calib::Detector::kClassic, "", smaller, session);
    if (found && found->images_with_board() > 0) {
      hint = fmt::format("a board of {} x {} is: corners counts inner corners, one fewer than squares", smaller.columns,
                         smaller.rows);
    }
  }
  return base::fail(ErrorCode::kBadInput,
                    fmt::format("a {} of {} x {} was found in none of the {} images; {}", base::pattern_name(board.pattern),
                                board.columns, board.rows, task.images.size(), hint));
}

}  // namespace

int FoundCorners::images_with_board() const {
  return static_cast<int>(
      std::count_if(images.begin(), images.end(), [](const BoardImage& image) { return !image.corners.empty(); }));
}

void put_best_first(std::vector<FoundCorners>& found) {
  const auto outdone = [&](const FoundCorners& other) {
    return !other.sample && 3 * other.images_with_board() > 4 * found.front().images_with_board();
  };
  if (const auto better = std::find_if(found.begin(), found.end(), outdone); better != found.end())
    std::iter_swap(found.begin(), better);
}

Result<std::vector<FoundCorners>> find_board(const CalibrationTask& task, Session& session) {
  std::vector<FoundCorners> found;
  const auto add = [&found](Result<FoundCorners> corners) -> Result<> {
    if (!corners) return tl::unexpected(corners.error());
    found.push_back(std::move(*corners));
    return {};
  };
  const base::Board& board = task.board.board;
  Result<> done;
  if (task.corners) {
    done = add(corners_of_file(task));
  } else if (board.pattern == base::BoardPattern::kAprilGrid) {
    done = add(corners_of_tags(task, session));
  } else if (board.pattern != base::BoardPattern::kChessboard) {
    done = add(corners_of_board(task, calib::Detector::kClassic, "circles", board, session));
  } else {
    const bool choose = task.board.detector == "auto";
    if (choose || task.board.detector == "classic") {
      done = add(corners_of_board(task, calib::Detector::kClassic, "classic", board, session));
    }
    if (done && task.board.detector == "sb")
      done = add(corners_of_board(task, calib::Detector::kSectors, "sb", board, session));
    if (done && choose) done = add(corners_to_compare(task, found.front(), session));
  }
  if (!done) return tl::unexpected(done.error());
  put_best_first(found);
  if (found.front().images_with_board() == 0 && !task.images.empty()) return not_found(task, session);
  return found;
}

}  // namespace crosstie::app
