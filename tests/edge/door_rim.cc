#include "tests/edge/door_rim.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <random>

#include <Eigen/Geometry>

#include "fixtures/fringes.h"

namespace crosstie::tests {
namespace {

using fixtures::Wall;

constexpr double kScale = 0.5;
constexpr int kPiece_px = 11;
constexpr double kBorder_px = 10.0;
constexpr double kResolved_mm = 7.5;  // 3 px: narrower strips of the cut are one edge with the rim in an image
constexpr double kLedge_mm = 8.0;     // height
constexpr double kLedgeFrom_mm = -470.0, kLedgeTo_mm = -390.0, kLedgeHalf_mm = 250.0;  // y, y, z

bool on_ledge(const Eigen::Vector3d& p) {
  return p.y() > kLedgeFrom_mm && p.y() < kLedgeTo_mm && std::abs(p.z()) < kLedgeHalf_mm;
}

/// Where a ray from `from` meets the cone that lies `height_mm` above the face.
std::optional<Eigen::Vector3d> meet(const Wall& wall, const Eigen::Vector3d& from, const Eigen::Vector3d& ray,
                                    double height_mm) {
  double t = 1000.0;
  const double k = std::tan(wall.half_angle_rad);
  for (int i = 0; i < 30; ++i) {
    const Eigen::Vector3d p = from + t * ray;
    const double r = p.head<2>().norm();
    const double off = r - (wall.radius_mm + height_mm - p.z() * k);
    const double slope = p.head<2>().dot(ray.head<2>()) / r + k * ray.z();
    if (std::abs(slope) < 0.05) return std::nullopt;
    t -= off / slope;
    if (std::abs(off) < 1e-9) return from + t * ray;
  }
  return std::nullopt;
}

/// The face as one ray sees it, or a plate on it.
std::optional<Eigen::Vector3d> seen_point(const Wall& wall, const Eigen::Vector3d& from, const Eigen::Vector3d& ray,
                                          bool ledge) {
  if (ledge) {
    const auto p = meet(wall, from, ray, kLedge_mm);
    if (p && on_ledge(*p)) return p;
  }
  const auto p = meet(wall, from, ray, 0.0);
  if (!p || fixtures::distance_mm(*wall.hole, {p->y(), p->z()}) < 0.0) return std::nullopt;
  if (ledge && on_ledge(*p)) return std::nullopt;
  return p;
}

/// A line in space with the way out of its material; nothing where it is not to be seen.
struct Place {
  Eigen::Vector3d point;
  Eigen::Vector3d out;
};
using Line = std::function<std::optional<Place>(double turn)>;

struct Sight {
  const base::Camera& camera;
  base::Pose camera_from_part;

  [[nodiscard]] std::optional<Eigen::Vector2d> operator()(const Eigen::Vector3d& p) const {
    const auto px = camera.project(camera_from_part * p);
    if (!px) return std::nullopt;
    const Eigen::Vector2d far(camera.width_px() - 1.0 - kBorder_px, camera.height_px() - 1.0 - kBorder_px);
    if ((px->array() < kBorder_px).any() || (px->array() > far.array()).any()) return std::nullopt;
    return *px;
  }
};

/// Edge pixels a pixel apart along a line.
void draw(const Sight& sight, const Line& line, base::EdgeClass kind, double sigma_px, std::mt19937_64& random,
          base::EdgePixels& edges) {
  constexpr int kSteps = 20000;
  std::normal_distribution<double> normal;
  std::vector<double> noise;  // of the pixels of an edge, of which each place averages a piece
  for (int i = 0; i < kPiece_px; ++i) noise.push_back(normal(random));
  std::optional<Eigen::Vector2d> last;
  for (int i = 0; i < kSteps; ++i) {
    const auto place = line(static_cast<double>(i) / kSteps);
    if (!place) continue;
    const auto at = sight(place->point);
    if (!at || (last && (*at - *last).norm() < 1.0)) continue;
    last = at;
    const auto ahead = line(static_cast<double>(i) / kSteps + 1e-6);
    const auto inside = sight(place->point + 0.01 * place->out);
    const auto next = ahead ? sight(ahead->point) : std::nullopt;
    if (!inside || !next) continue;
    const Eigen::Vector2d along = (*next - *at).normalized();
    Eigen::Vector2d out(-along.y(), along.x());
    if (out.dot(*inside - *at) < 0.0) out = -out;
    noise.erase(noise.begin());
    noise.push_back(normal(random));
    double off = 0.0;
    for (const double one : noise) off += one / std::sqrt(static_cast<double>(kPiece_px));
    base::EdgePixel pixel;
    pixel.at_px = *at + sigma_px * off * out;
    pixel.out = out;
    pixel.sigma_px = pixel.noise_px = std::max(sigma_px, 1e-3);
    pixel.step = -50.0;
    pixel.kind = kind;
    edges.pixels.push_back(pixel);
  }
}

}  // namespace

Door::Door()
    : scene_(*fixtures::with_image_scale(*fixtures::make_scene("door"), kScale)), head_([&] {
        const auto station =
            fixtures::FringeStation::make(scene_, scene_.machine->scene_from_machine *
                                                      machine_from_rig(*scene_.machine, scene_.machine->stations[1].axis_mm));
        return station->head();
      }()) {}

fixtures::RimPoint Door::rim(double turn) const { return fixtures::rim_point(*scene_.wall, *scene_.wall->hole, turn); }

std::vector<DoorStation> Door::stations(const DoorNoise& noise, std::uint64_t seed) const {
  const Wall& wall = *scene_.wall;
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<DoorStation> stations;
  for (const fixtures::Station& stop : scene_.machine->stations) {
    DoorStation& station = stations.emplace_back();
    station.name = stop.name;
    station.part_from_rig =
        wall.scene_from_part.inverse() * scene_.machine->scene_from_machine * machine_from_rig(*scene_.machine, stop.axis_mm);
    const int width = head_.left.width_px();
    const int height = head_.left.height_px();
    const Eigen::Vector3d& eye = station.part_from_rig.translation_mm;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        float depth = std::numeric_limits<float>::quiet_NaN();
        if (const auto ray = head_.left.unproject(Eigen::Vector2d(x, y))) {
          const Eigen::Vector3d in_part = station.part_from_rig.rotation * ray->normalized();
          if (const auto p = seen_point(wall, eye, in_part, noise.ledge)) {
            const double distance = (*p - eye).norm() + noise.depth_mm * normal(random);
            depth = static_cast<float>(distance * ray->normalized().z());
          }
        }
        station.depth_mm.push_back(depth);
        station.sigma_mm.push_back(static_cast<float>(std::max(noise.depth_mm, 1e-3)));
      }
    }
    const auto ring = [&](double grown_mm) -> Line {
      return [&wall, grown_mm](double turn) {
        const auto at = fixtures::outline_point(*wall.hole, turn, grown_mm);
        const Eigen::Vector2d inward = Eigen::Vector2d(-at.tangent.y(), at.tangent.x()).normalized();
        return std::optional<Place>({fixtures::face_point(wall, at.at_mm), {0.0, inward.x(), inward.y()}});
      };
    };
    for (std::size_t camera = 0; camera < 2; ++camera) {
      const base::Camera& lens = camera == 0 ? head_.left : head_.right;
      const base::Pose rig_from_camera = camera == 0 ? base::Pose{} : head_.right_from_left.inverse();
      const Sight sight{lens, (station.part_from_rig * rig_from_camera).inverse()};
      base::EdgePixels& edges = station.edges[camera];
      edges.camera = camera == 0 ? head_.left_name : head_.right_name;
      edges.width = width;
      edges.height = height;
      edges.blur_px = 0.7;
      edges.piece_px = kPiece_px;
      draw(sight, ring(0.0), base::EdgeClass::kMaterial, noise.edge_px, random, edges);
      if (noise.far_rim) {
        const Eigen::Vector3d from = (station.part_from_rig * rig_from_camera).translation_mm;
        const Line far = [&](double turn) -> std::optional<Place> {
          auto place = *ring(0.0)(turn);
          place.point.x() -= wall.thickness_mm;
          const auto over = meet(wall, from, (place.point - from).normalized(), 0.0);
          if (!over || fixtures::distance_mm(*wall.hole, {over->y(), over->z()}) > -kResolved_mm) return std::nullopt;
          return place;
        };
        draw(sight, far, base::EdgeClass::kMaterial, noise.edge_px, random, edges);
      }
      if (noise.shadows) draw(sight, ring(45.0), base::EdgeClass::kShadow, noise.edge_px, random, edges);
      if (noise.paint) draw(sight, ring(25.0), base::EdgeClass::kPaint, noise.edge_px, random, edges);
      if (noise.ledge) {
        const Line side = [&](double turn) -> std::optional<Place> {
          const double z = (2.0 * turn - 1.0) * kLedgeHalf_mm;
          const double r = wall.radius_mm + kLedge_mm - z * std::tan(wall.half_angle_rad);
          return Place{{std::sqrt(r * r - kLedgeTo_mm * kLedgeTo_mm), kLedgeTo_mm, z}, Eigen::Vector3d::UnitY()};
        };
        draw(sight, side, base::EdgeClass::kMaterial, noise.edge_px, random, edges);
      }
    }
  }
  return stations;
}

std::vector<edge::StationView> Door::views(const std::vector<DoorStation>& stations) const {
  std::vector<edge::StationView> views;
  for (const DoorStation& station : stations) {
    edge::StationView& view = views.emplace_back();
    view.name = station.name;
    view.head = &head_;
    view.edges = {&station.edges[0], &station.edges[1]};
    view.depth_mm = &station.depth_mm;
    view.sigma_mm = &station.sigma_mm;
    view.frame_from_rig = station.part_from_rig;
  }
  return views;
}

RimStatistics Door::compare(const base::EdgeCurve& curve) const { return compare_rim(curve, *scene_.wall); }

RimStatistics compare_rim(const base::EdgeCurve& curve, const Wall& wall) {
  constexpr int kSteps = 8000;
  std::vector<fixtures::RimPoint> rim;
  double length = 0.0;
  for (int i = 0; i < kSteps; ++i) rim.push_back(fixtures::rim_point(wall, *wall.hole, static_cast<double>(i) / kSteps));
  for (std::size_t i = 0; i < rim.size(); ++i) length += (rim[(i + 1) % rim.size()].point_mm - rim[i].point_mm).norm();
  RimStatistics result;
  for (const base::EdgePoint& point : curve.points) {
    const auto nearest = std::min_element(rim.begin(), rim.end(), [&](const auto& a, const auto& b) {
      return (a.point_mm - point.point_mm).squaredNorm() < (b.point_mm - point.point_mm).squaredNorm();
    });
    // Half a step beside it the rim leaves its tangent by less than a micrometre.
    const Eigen::Vector3d error = point.point_mm - nearest->point_mm;
    const Eigen::Vector3d across = nearest->normal.cross(nearest->tangent);
    // Its normal turns by more than what is tested: that of the very place.
    const auto next = std::next(nearest) == rim.end() ? rim.begin() : std::next(nearest);
    const double part = nearest->tangent.dot(error) / (next->point_mm - nearest->point_mm).norm();
    const double turn = (static_cast<double>(nearest - rim.begin()) + part) / kSteps;
    const fixtures::RimPoint here = fixtures::rim_point(wall, *wall.hole, turn - std::floor(turn));
    const double u = across.dot(error);
    const double v = nearest->normal.dot(error);
    ++result.count;
    result.mean_u_mm += u;
    result.mean_v_mm += v;
    result.rms_u_mm += u * u;
    result.rms_v_mm += v * v;
    result.normalised_u += u * u / across.dot(point.cov_mm2 * across);
    result.normalised_v += v * v / nearest->normal.dot(point.cov_mm2 * nearest->normal);
    result.normalised_tilt +=
        0.5 * (std::pow(point.normal.dot(here.normal.cross(here.tangent)), 2) / point.tilt_variance_rad2.x() +
               std::pow(point.normal.dot(here.tangent), 2) / point.tilt_variance_rad2.y());
    result.farthest_mm = std::max(result.farthest_mm, std::hypot(u, v));
    result.most_turn_rad = std::max(result.most_turn_rad, std::acos(std::min(1.0, here.normal.dot(point.normal))));
  }
  const auto n = static_cast<double>(std::max(1, result.count));
  for (double* value :
       {&result.mean_u_mm, &result.mean_v_mm, &result.normalised_u, &result.normalised_v, &result.normalised_tilt})
    *value /= n;
  for (double* value : {&result.rms_u_mm, &result.rms_v_mm}) *value = std::sqrt(*value / n);
  double gaps = 0.0;
  for (const base::EdgeGap& gap : curve.gaps) gaps += gap.length_mm;
  result.covered = 1.0 - gaps / length;
  return result;
}

void RimStatistics::add(const RimStatistics& other) {
  const double all = count + other.count;
  const auto mean = [&](double& own, double theirs) { own = (count * own + other.count * theirs) / all; };
  const auto root = [&](double& own, double theirs) {
    own = std::sqrt((count * own * own + other.count * theirs * theirs) / all);
  };
  mean(mean_u_mm, other.mean_u_mm);
  mean(mean_v_mm, other.mean_v_mm);
  mean(normalised_u, other.normalised_u);
  mean(normalised_v, other.normalised_v);
  mean(normalised_tilt, other.normalised_tilt);
  root(rms_u_mm, other.rms_u_mm);
  root(rms_v_mm, other.rms_v_mm);
  mean(covered, other.covered);
  farthest_mm = std::max(farthest_mm, other.farthest_mm);
  most_turn_rad = std::max(most_turn_rad, other.most_turn_rad);
  count += other.count;
}

}  // namespace crosstie::tests
