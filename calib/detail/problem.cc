#include "calib/detail/problem.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "calib/pairing.h"
#include "math/median.h"

namespace crosstie::calib::detail {
namespace {

using base::BoardImage;
using base::ErrorCode;
using base::fail;
using base::Result;

constexpr std::size_t kLeastCorners = 8;  // of a view: its pose takes six of their coordinates, a homography eight
constexpr double kSamePlace_px = 1e-3;    // corners of two photographs never agree to that

Result<> check_image(const BoardImage& image, const base::Board& board) {
  const auto refuse = [&](std::string what) { return fail(ErrorCode::kBadInput, "image " + image.image + ": " + what); };
  if (image.width_px <= 0 || image.height_px <= 0) return refuse("its size is not known");
  std::vector<char> seen(static_cast<std::size_t>(board.count()), 0);
  int with_sigma = 0;
  for (const base::BoardCorner& corner : image.corners) {
    if (corner.index < 0 || corner.index >= board.count()) {
      return refuse(fmt::format("corner {} is not on a board of {} x {}", corner.index, board.columns, board.rows));
    }
    if (seen[static_cast<std::size_t>(corner.index)]++ != 0) return refuse(fmt::format("corner {} twice", corner.index));
    if (!corner.px.allFinite()) return refuse(fmt::format("corner {} is not a finite number", corner.index));
    if (corner.px.cwiseAbs().maxCoeff() > 1e5)
      return refuse(fmt::format("corner {} lies far outside of any image", corner.index));
    if (!(corner.sigma_px >= 0.0) || !std::isfinite(corner.sigma_px)) {
      return refuse(fmt::format("the sigma of corner {} is negative or no number", corner.index));
    }
    with_sigma += corner.sigma_px > 0.0 ? 1 : 0;
  }
  if (with_sigma != 0 && with_sigma != static_cast<int>(image.corners.size())) {
    return refuse("some of its corners have a sigma and some have none");
  }
  return {};
}

/// Whether the corners lie near a line, where no pose can be found.
bool on_a_line(const BoardImage& image, const Eigen::Matrix3Xd& nominal) {
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  const auto count = static_cast<double>(image.corners.size());
  for (const auto& corner : image.corners) middle += nominal.col(corner.index).head<2>() / count;
  for (const auto& corner : image.corners) {
    const Eigen::Vector2d at = nominal.col(corner.index).head<2>() - middle;
    scatter += at * at.transpose();
  }
  const double trace = scatter.trace();
  const double least = 0.5 * (trace - std::hypot(scatter(0, 0) - scatter(1, 1), 2.0 * scatter(0, 1)));
  return !(least > 1e-6 * trace);
}

bool same_corners(const BoardImage& a, const BoardImage& b) {
  if (a.corners.size() != b.corners.size()) return false;
  for (std::size_t i = 0; i < a.corners.size(); ++i) {
    if (a.corners[i].index != b.corners[i].index) return false;
    if ((a.corners[i].px - b.corners[i].px).norm() > kSamePlace_px) return false;
  }
  return true;
}

/// Why an image cannot take part, or nothing.
std::string unusable(const std::vector<BoardImage>& images, std::size_t i, const Problem& problem) {
  const BoardImage& image = images[i];
  if (image.corners.empty()) return "the board was not found in it";
  if (image.corners.size() < kLeastCorners) {
    return fmt::format("it shows {} corners only, at least {} are needed", image.corners.size(), kLeastCorners);
  }
  if (on_a_line(image, problem.nominal)) return "its corners lie on one line";
  for (std::size_t j = 0; j < i; ++j) {
    if (images[j].camera == image.camera && same_corners(images[j], image)) {
      return fmt::format("it shows the same corners as {}: the same photograph twice", images[j].image);
    }
  }
  return {};
}

void add_view(Problem& problem, const BoardImage& image, int camera, int station) {
  View view{image.image, camera, station, {}};
  const int v = static_cast<int>(problem.views.size());
  for (const base::BoardCorner& corner : image.corners) {
    view.corners.push_back(static_cast<int>(problem.corners.size()));
    problem.corners.push_back({v, corner.index, corner.px, corner.sigma_px > 0.0 ? corner.sigma_px : 1.0});
  }
  problem.stations[static_cast<std::size_t>(station)].view[static_cast<std::size_t>(camera)] = v;
  problem.views.push_back(std::move(view));
}

}  // namespace

Result<Problem> make_problem(const BoardViews& input) {
  if (auto ok = input.board.validate(); !ok) return fail(std::move(ok));
  if (input.cameras.empty() || input.cameras.size() > 2 ||
      (input.cameras.size() == 2 && input.cameras[0] == input.cameras[1])) {
    return fail(ErrorCode::kBadInput, fmt::format("{} cameras; one is calibrated, or two of different names that are bolted to "
                                                  "each other",
                                                  input.cameras.size()));
  }
  Problem problem;
  problem.board = input.board;
  problem.nominal = input.board.nominal_points();
  if (input.board.free) problem.modes = input.board.modes();
  problem.cameras = input.cameras;
  problem.size_px.assign(input.cameras.size(), Eigen::Vector2i::Zero());

  std::set<std::string> names;
  bool any_sigma = false;
  bool any_without = false;
  for (const BoardImage& image : input.images) {
    if (auto ok = check_image(image, input.board); !ok) return fail(std::move(ok));
    if (!names.insert(image.camera + "/" + image.image).second) {
      return fail(ErrorCode::kBadInput, fmt::format("image {} is listed twice", image.image));
    }
    for (const auto& corner : image.corners) (corner.sigma_px > 0.0 ? any_sigma : any_without) = true;
  }
  if (any_sigma && any_without) {
    return fail(ErrorCode::kBadInput, "some images have sigmas of their corners and some have none");
  }
  auto stations = pair_by_name(input.images, input.cameras);
  if (!stations) return fail(std::move(stations));

  for (const base::BoardStation& station : *stations) {
    const int s = static_cast<int>(problem.stations.size());
    problem.stations.push_back({station.name});
    for (std::size_t c = 0; c < input.cameras.size(); ++c) {
      for (const int i : station.images) {
        const BoardImage& image = input.images[static_cast<std::size_t>(i)];
        if (image.camera != input.cameras[c]) continue;
        Eigen::Vector2i& size = problem.size_px[c];
        if (size.x() == 0) size << image.width_px, image.height_px;
        if (size.x() != image.width_px || size.y() != image.height_px) {
          return fail(ErrorCode::kBadInput,
                      fmt::format("image {} has {} x {} pixels, others of camera {} have {} x {}", image.image, image.width_px,
                                  image.height_px, image.camera, size.x(), size.y()));
        }
        const std::string reason = unusable(input.images, static_cast<std::size_t>(i), problem);
        if (!reason.empty()) {
          problem.refused.push_back({image.image, -1, reason, 0.0});
          continue;
        }
        add_view(problem, image, static_cast<int>(c), s);
      }
    }
    const Station& added = problem.stations.back();
    if (added.view[0] < 0 && added.view[1] < 0) problem.stations.pop_back();
  }
  if (any_sigma) {
    std::vector<double> sigmas;
    for (const Corner& corner : problem.corners) sigmas.push_back(corner.relative_sigma);
    const double middle = math::median(std::move(sigmas));
    for (Corner& corner : problem.corners) corner.relative_sigma /= middle;
  }
  return problem;
}

}  // namespace crosstie::calib::detail
