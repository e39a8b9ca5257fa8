#include "bundle/detail/head_survey.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>

#include "bundle/detail/minimal_solvers.h"
#include "bundle/detail/sampling.h"
#include "bundle/detail/survey.h"
#include "math/image_point.h"
#include "math/minimise.h"

namespace crosstie::bundle::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Pose;
using base::Result;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxTrials = 300;
constexpr double kConfidence = 1e-6;  // probability that no sample was free of outliers, at which sampling ends
constexpr int kLeastRays = 6;         // of a station
constexpr std::uint64_t kSeed = 20'110'621;

struct HeadGeometry {
  const base::Camera* cameras[2];
  Pose camera_from_rig[2];
};

HeadGeometry geometry_of(const base::Head& head) { return {{&head.left, &head.right}, {Pose{}, head.right_from_left}}; }

struct Sighting {
  int camera = 0;
  Vector2d px;
  std::optional<Vector3d> direction;
  Vector3d point;
};

double squared_distance(const HeadGeometry& head, const Pose& rig_from_cross, const Sighting& sighting) {
  const auto at =
      head.cameras[sighting.camera]->project(head.camera_from_rig[sighting.camera] * (rig_from_cross * sighting.point));
  return at ? (*at - sighting.px).squaredNorm() : 1e12;
}

struct Found {
  std::optional<Pose> cross_from_rig;
  int inliers = 0;
  int inliers_of[2] = {0, 0};  ///< by camera
  int rays_of[2] = {0, 0};

  /// Most of the rays of either camera: a pose that suits one of the two alone explains half of all.
  [[nodiscard]] bool explains() const {
    for (const int camera : {0, 1}) {
      if (rays_of[camera] >= kLeastRays && 2 * inliers_of[camera] < rays_of[camera]) return false;
    }
    return inliers >= kLeastRays && 2 * inliers >= rays_of[0] + rays_of[1];
  }
};

/// Least squares of the pose on those within the tolerance, with a robust loss.
Pose refined(const HeadGeometry& head, const std::vector<Sighting>& sightings, const Pose& cross_from_rig,
             double tolerance_px) {
  math::Model model;
  math::Block blocks[2];
  int lens[2];
  int mount[2];
  for (int c = 0; c < 2; ++c) {
    const Eigen::VectorXd& values = head.cameras[c]->parameters();
    math::Block block{"lens", math::Block::Kind::kVector, {values.data(), values.data() + values.size()}, {}, {}, {}};
    block.components.resize(block.values.size());
    lens[c] = model.add(std::move(block));
    math::Block mounted = math::pose_block("mount", head.camera_from_rig[c].inverse());
    mounted.kind = math::Block::Kind::kMount;
    mounted.free.clear();
    mount[c] = model.add(std::move(mounted));
  }
  const int pose = model.add(math::pose_block("head", cross_from_rig));
  const Pose rig_from_cross = cross_from_rig.inverse();
  for (const Sighting& sighting : sightings) {
    if (squared_distance(head, rig_from_cross, sighting) > 16.0 * tolerance_px * tolerance_px) continue;
    math::Block point = math::point_block("point", sighting.point);
    point.free.clear();
    const int at = model.add(std::move(point));
    model.measurements.push_back(
        std::make_unique<math::ImagePoint>(math::ImagePoint::Blocks{lens[sighting.camera], pose, at, mount[sighting.camera]},
                                           head.cameras[sighting.camera]->model(), sighting.px, Eigen::Matrix2d::Identity()));
  }
  if (!math::minimise(model, {.max_iterations = 30, .robust_scale = 0.1 * tolerance_px, .function_tolerance = 1e-8})) {
    return cross_from_rig;
  }
  return math::pose_from_values(model.blocks[static_cast<std::size_t>(pose)].values.data());
}

Found find_pose(const HeadGeometry& head, const std::vector<Sighting>& sightings, double tolerance_px, std::uint64_t seed) {
  std::vector<int> usable;
  for (std::size_t i = 0; i < sightings.size(); ++i) {
    if (sightings[i].direction) usable.push_back(static_cast<int>(i));
  }
  if (static_cast<int>(usable.size()) < kLeastRays) return {};
  Sampler sampler(static_cast<int>(usable.size()), seed);
  std::array<int, 3> sample{};
  std::optional<Pose> best;
  double best_cost = 1e300;
  int trials = kMaxTrials;
  for (int k = 0; k < trials; ++k) {
    sampler.draw(sample);
    std::array<HeadSight, 3> sights;
    std::array<Vector3d, 3> points;
    for (std::size_t i = 0; i < 3; ++i) {
      const Sighting& sighting = sightings[static_cast<std::size_t>(usable[static_cast<std::size_t>(sample[i])])];
      sights[i] = {head.camera_from_rig[sighting.camera].inverse(), *sighting.direction};
      points[i] = sighting.point;
    }
    for (const Pose& candidate : head_poses(sights, points)) {
      const Pose rig_from_cross = candidate.inverse();
      double cost = 0.0;
      int inliers = 0;
      for (const Sighting& sighting : sightings) {
        const double square = squared_distance(head, rig_from_cross, sighting);
        cost += truncated_cost(square, tolerance_px);
        inliers += square < tolerance_px * tolerance_px ? 1 : 0;
      }
      if (cost >= best_cost) continue;
      best_cost = cost;
      best = candidate;
      const double share = static_cast<double>(inliers) / static_cast<double>(sightings.size());
      const double good = share * share * share;
      if (good > 0.9999) {
        trials = std::min(trials, k + 2);
      } else if (good > 0.0) {
        trials = std::min(trials, k + 1 + static_cast<int>(std::ceil(std::log(kConfidence) / std::log(1.0 - good))));
      }
    }
  }
  if (!best) return {};
  const Pose cross_from_rig = refined(head, sightings, *best, tolerance_px);
  const Pose rig_from_cross = cross_from_rig.inverse();
  Found found{.cross_from_rig = cross_from_rig};
  for (const Sighting& sighting : sightings) {
    const int in = squared_distance(head, rig_from_cross, sighting) < tolerance_px * tolerance_px ? 1 : 0;
    ++found.rays_of[sighting.camera];
    found.inliers_of[sighting.camera] += in;
    found.inliers += in;
  }
  return found;
}

Result<> add_image(const CommissionInput& input, const std::string& name, int station, int camera,
                   const std::map<int, int>& marker_of_id, HeadSurvey& survey) {
  if (name.empty()) return {};
  const auto image = std::find_if(input.images.begin(), input.images.end(), [&](const auto& i) { return i.image == name; });
  const std::string where = fmt::format("station {}", survey.stations[static_cast<std::size_t>(station)].name);
  if (image == input.images.end()) return fail(ErrorCode::kBadInput, fmt::format("{}: there is no image {}", where, name));
  for (const HeadImage& other : survey.images) {
    if (other.name == name) return fail(ErrorCode::kBadInput, fmt::format("image {} belongs to two stations or cameras", name));
  }
  const base::Camera& lens = camera == 0 ? input.head.left : input.head.right;
  if (image->width_px > 0 && (image->width_px != lens.width_px() || image->height_px != lens.height_px())) {
    return fail(ErrorCode::kBadInput, fmt::format("{}: image {} has {} x {} px, its camera was calibrated with {} x {}", where,
                                                  name, image->width_px, image->height_px, lens.width_px(), lens.height_px()));
  }
  const int index = static_cast<int>(survey.images.size());
  survey.images.push_back({name, station, camera});
  std::map<int, int> seen;
  for (const base::Observation& observation : image->observations) {
    const auto marker = marker_of_id.find(observation.id);
    if (observation.status != base::ObservationStatus::kCoded || marker == marker_of_id.end()) continue;
    if (!observation.centre_px.allFinite()) {
      return fail(ErrorCode::kBadInput, fmt::format("image {}, id {}: the image point is not finite", name, observation.id));
    }
    ++seen[observation.id];
    survey.rays.push_back(
        {index, marker->second, observation.centre_px, observation.centre_px, observation.cov_px2, shape_of(observation)});
  }
  for (HeadRay& ray : survey.rays) {
    const int id = input.cross.markers[static_cast<std::size_t>(ray.marker)].id;
    if (ray.image == index && seen[id] > 1) {
      ray.active = false;
      ray.reason = "its id was read more than once in this image";
    }
  }
  return {};
}

}  // namespace

std::vector<int> HeadSurvey::rays_of(int station) const {
  std::vector<int> list;
  for (std::size_t r = 0; r < rays.size(); ++r) {
    if (rays[r].active && images[static_cast<std::size_t>(rays[r].image)].station == station)
      list.push_back(static_cast<int>(r));
  }
  return list;
}

Result<HeadSurvey> survey_head(const CommissionInput& input) {
  HeadSurvey survey;
  std::map<int, int> marker_of_id;
  for (std::size_t m = 0; m < input.cross.markers.size(); ++m) marker_of_id[input.cross.markers[m].id] = static_cast<int>(m);
  std::vector<const base::Station*> sorted;
  for (const base::Station& station : input.stations) sorted.push_back(&station);
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto* a, const auto* b) { return a->axis_mm < b->axis_mm; });
  std::set<std::string> names;
  for (const base::Station* station : sorted) {
    if (!std::isfinite(station->axis_mm) || !names.insert(station->name).second) {
      return fail(ErrorCode::kBadInput,
                  fmt::format("station {}: its reading is not finite, or its name is given twice", station->name));
    }
    const int index = static_cast<int>(survey.stations.size());
    survey.stations.push_back({station->name, station->axis_mm});
    for (const int camera : {0, 1}) {
      const std::string& own = camera == 0 ? station->left : station->right;
      if (auto added = add_image(input, own, index, camera, marker_of_id, survey); !added) return fail(std::move(added));
      for (const CommissionInput::Repeated& more : input.repeated) {
        if (own.empty() || more.of != own) continue;
        if (auto added = add_image(input, more.image, index, camera, marker_of_id, survey); !added)
          return fail(std::move(added));
      }
    }
  }
  if (survey.rays.empty()) {
    return fail(ErrorCode::kNoUniqueSolution,
                "no photograph shows a marker of the cross: compare the ids of its list with those that were read");
  }
  std::vector<double> sigmas;
  for (const HeadRay& ray : survey.rays) {
    const double sigma = std::sqrt(0.5 * ray.cov_px2.trace());
    if (std::isfinite(sigma) && sigma > 0.0) sigmas.push_back(sigma);
  }
  std::nth_element(sigmas.begin(), sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2), sigmas.end());
  const double typical = sigmas.empty() ? 0.05 : sigmas[sigmas.size() / 2];
  if (sigmas.size() < survey.rays.size()) {
    survey.warnings.push_back({"no_image_covariance", "",
                               fmt::format("{} of {} image points came without a usable covariance; {:.3g} px is assumed",
                                           survey.rays.size() - sigmas.size(), survey.rays.size(), typical)});
  }
  for (HeadRay& ray : survey.rays) ray.cov_px2 = usable_covariance(ray.cov_px2, typical);
  return survey;
}

Result<> orient_stations(const CommissionInput& input, const CommissionOptions& options, HeadSurvey& survey) {
  const HeadGeometry head = geometry_of(input.head);
  int oriented = 0;
  std::string why;
  for (std::size_t k = 0; k < survey.stations.size(); ++k) {
    HeadStation& station = survey.stations[k];
    const std::vector<int> rays = survey.rays_of(static_cast<int>(k));
    std::vector<Sighting> sightings;
    std::vector<Sighting> swapped;
    for (const int r : rays) {
      const HeadRay& ray = survey.rays[static_cast<std::size_t>(r)];
      const int camera = survey.images[static_cast<std::size_t>(ray.image)].camera;
      const Vector3d& point = input.cross.markers[static_cast<std::size_t>(ray.marker)].xyz_mm;
      sightings.push_back({camera, ray.measured_px, head.cameras[camera]->unproject(ray.measured_px), point});
      swapped.push_back({1 - camera, ray.measured_px, head.cameras[1 - camera]->unproject(ray.measured_px), point});
    }
    const Found found = find_pose(head, sightings, options.tolerance_px, kSeed + k);
    const int count = static_cast<int>(rays.size());
    if (count < kLeastRays) {
      station.reason = fmt::format("only {} images of markers of the cross are seen, {} are needed", count, kLeastRays);
    } else if (!found.explains()) {
      const Found other = find_pose(head, swapped, options.tolerance_px, kSeed + k);
      if (other.explains() && other.inliers > found.inliers) {
        return fail(
            ErrorCode::kBadInput,
            fmt::format("station {}: its left and right photographs are swapped ({} of {} markers agree when they change "
                        "places, {} as they are)",
                        station.name, other.inliers, count, found.inliers));
      }
      station.reason = fmt::format(
          "no pose of the head explains its markers ({} of {} within {:.3g} px): the cameras moved since their calibration, "
          "the "
          "photographs are not of one stop, or the cross's list is another one's",
          found.inliers, count, options.tolerance_px);
    } else {
      station.cross_from_rig = found.cross_from_rig;
      const Pose rig_from_cross = found.cross_from_rig->inverse();
      for (std::size_t i = 0; i < rays.size(); ++i) {
        const double distance = std::sqrt(squared_distance(head, rig_from_cross, sightings[i]));
        if (distance < options.tolerance_px) continue;
        HeadRay& ray = survey.rays[static_cast<std::size_t>(rays[i])];
        ray.active = false;
        ray.reason =
            distance < 1e5
                ? fmt::format("{:.1f} px from where the station sees this id: a wrong id, or a marker that moved", distance)
                : std::string("this id lies outside of the image as the station sees the cross: a wrong id");
      }
      ++oriented;
      continue;
    }
    why = fmt::format("station {}: {}", station.name, station.reason);
    for (const int r : rays) {
      survey.rays[static_cast<std::size_t>(r)].active = false;
      survey.rays[static_cast<std::size_t>(r)].reason = "its station takes no part";
    }
  }
  if (oriented < 2) {
    return fail(ErrorCode::kNoUniqueSolution,
                fmt::format("{} of {} stations can be oriented, the axis needs two: {}", oriented, survey.stations.size(),
                            why.empty() ? "add a station at another reading" : why));
  }
  return {};
}

}  // namespace crosstie::bundle::detail
