#include "tests/study/comparison.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/calibration_reader.h"
#include "base/commissioning_reader.h"
#include "base/json_file.h"
#include "base/ply.h"
#include "base/stitching_reader.h"
#include "base/table.h"
#include "math/head_point.h"
#include "tests/support/normalised_square.h"
#include "tests/support/true_rim.h"

namespace crosstie::study {
namespace {

namespace fs = std::filesystem;
using base::Result;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using nlohmann::ordered_json;

ordered_json stage(const VectorXd& error, const MatrixXd& cov) {
  return {{"square", tests::normalised_square(error, cov)}, {"dof", error.size()}};
}

base::Head true_head(const fixtures::Scene& scene) {
  const auto camera = [&](const std::string& name) {
    return *std::find_if(scene.cameras.begin(), scene.cameras.end(), [&](const auto& one) { return one.name == name; })->camera;
  };
  return {.left_name = scene.head->left,
          .right_name = scene.head->right,
          .left = camera(scene.head->left),
          .right = camera(scene.head->right),
          .right_from_left = scene.head->right_from_left};
}

/// Errors of values that lie in a band of a sigma each.
struct Band {
  std::vector<double> errors, sigmas;

  void add(double error, double sigma) {
    errors.push_back(error);
    sigmas.push_back(sigma);
  }
  [[nodiscard]] ordered_json json() const {
    const auto count = static_cast<double>(errors.size());
    double in_1 = 0.0, in_2 = 0.0, mean = 0.0, square = 0.0, variance = 0.0, normalised = 0.0;
    for (std::size_t i = 0; i < errors.size(); ++i) {
      const double w = std::abs(errors[i]) / sigmas[i];
      in_1 += w < 1.0 ? 1.0 : 0.0;
      in_2 += w < 2.0 ? 1.0 : 0.0;
      mean += errors[i];
      square += errors[i] * errors[i];
      variance += sigmas[i] * sigmas[i];
      normalised += w * w;
    }
    return {{"count", errors.size()},
            {"in_1", in_1 / count},
            {"in_2", in_2 / count},
            {"mean", mean / count},
            {"rms", std::sqrt(square / count)},
            {"sigma", std::sqrt(variance / count)},
            {"square", normalised / count}};
  }
};

/// The head that calibrate found: lenses, rig.
Result<> add_calibration(const base::Head& truth, const fs::path& results, ordered_json& stages) {
  const auto found = base::read_calibration(results / "calibrate");
  if (!found) return tl::unexpected(found.error());
  const auto cov = base::joint_covariance(*found, {truth.left_name, truth.right_name}, true);
  if (!cov) return tl::unexpected(cov.error());
  base::Head head = truth;
  for (const base::CalibratedCamera& camera : found->cameras)
    (camera.name == truth.left_name ? head.left : head.right) = camera.camera;
  head.right_from_left = found->rig->right_from_left;
  const VectorXd error = math::head_change(truth, head);
  const Eigen::Index lenses = error.size() - 6;
  stages["lenses"] = stage(error.head(lenses), cov->topLeftCorner(lenses, lenses));
  stages["rig"] = stage(error.tail<6>(), cov->bottomRightCorner<6, 6>());
  return {};
}

/// The head's path in the machine, at the beginning, in the middle and at the end of its travel together; the head as commission left it.
void add_frame(const fixtures::Scene& scene, const base::Head& truth, const base::Commissioning& found, ordered_json& stages) {
  const base::MachineFrame& frame = found.frame;
  VectorXd error(18);
  MatrixXd by(18, frame.cov.rows());
  const std::array<double, 3> places = {frame.axis.from_mm, frame.axis.middle_mm(), frame.axis.to_mm};
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double axis_mm = places[static_cast<std::size_t>(i)];
    error.segment<6>(6 * i) =
        base::difference(fixtures::machine_from_rig(*scene.machine, axis_mm), frame.at(axis_mm)->machine_from_rig);
    by.middleRows<6>(6 * i) = frame.jacobian(axis_mm);
  }
  stages["frame"] = stage(error, by * frame.cov * by.transpose());
  stages["head"] = stage(math::head_change(truth, found.head), found.head.cov);
}

/// Points of every scan, far from each other, along the wall's normal: the cameras' noise of each and the head's calibration, common to all.
Result<> add_cloud(const fixtures::Scene& scene, const base::Head& head, const fs::path& results, ordered_json& stages) {
  constexpr std::size_t kPoints = 60;
  constexpr double kBesideRimMm = 6.0;
  constexpr double kApartPx = 8.0;
  const fixtures::Wall& wall = *scene.wall;
  std::vector<double> errors, variances;
  std::vector<VectorXd> by_head;
  std::mt19937_64 random(7);
  for (const fixtures::Station& stop : scene.machine->stations) {
    if (!stop.scan) continue;
    const auto cloud = base::read_ply(results / "scan" / stop.name / "cloud.ply");
    if (!cloud) return tl::unexpected(cloud.error());
    const auto field = [&](const char* name) -> const std::vector<double>& {
      return std::find_if(cloud->fields.begin(), cloud->fields.end(), [&](const auto& one) { return one.name == name; })
          ->values;
    };
    const std::vector<double>&sigmas = field("sigma_mm"), &columns = field("column"), &rows = field("row");
    const base::Pose part_from_rig = wall.scene_from_part.inverse() * scene.machine->scene_from_machine *
                                     fixtures::machine_from_rig(*scene.machine, stop.axis_mm);
    std::vector<Vector2d> taken;
    for (int tries = 0; tries < 100'000 && taken.size() < kPoints; ++tries) {
      const std::size_t i = random() % cloud->points.size();
      const Vector3d p = part_from_rig * cloud->points[i];
      const Vector2d px(columns[i], rows[i]);
      if (fixtures::distance_mm(*wall.hole, p.tail<2>()) < kBesideRimMm) continue;  // the cut, the rim
      if (std::any_of(taken.begin(), taken.end(), [&](const Vector2d& q) { return (q - px).norm() < kApartPx; })) continue;
      taken.push_back(px);
      const Vector3d normal = part_from_rig.rotation.conjugate() * fixtures::face_normal(wall, p);
      const double from_axis_mm = std::hypot(p.x(), p.y());
      errors.push_back((from_axis_mm - wall.radius_mm + p.z() * std::tan(wall.half_angle_rad)) * std::cos(wall.half_angle_rad));
      variances.push_back(std::pow(sigmas[i] * normal.dot(cloud->points[i].normalized()), 2));
      by_head.emplace_back(math::point_by_head(head, cloud->points[i]).transpose() * normal);
    }
  }
  const auto count = static_cast<Eigen::Index>(errors.size());
  MatrixXd by(count, head.cov.rows());
  for (Eigen::Index i = 0; i < count; ++i) by.row(i) = by_head[static_cast<std::size_t>(i)].transpose();
  MatrixXd cov = by * head.cov * by.transpose();
  cov.diagonal() += Eigen::Map<const VectorXd>(variances.data(), count);
  stages["cloud"] = stage(Eigen::Map<const VectorXd>(errors.data(), count), cov);
  return {};
}

/// The stations that a point of the rim came from, by its column "source": "x0250+x0750".
std::vector<std::size_t> sources_of(const std::string& text, const base::Stitching& stitching) {
  std::vector<std::size_t> sources;
  for (std::size_t k = 0; k < stitching.stations.size(); ++k) {
    if (("+" + text + "+").find("+" + stitching.stations[k].name + "+") != std::string::npos) sources.push_back(k);
  }
  return sources;
}

/// What the errors of the stations' places and of the head do to a point of the rim, across it and along its normal: as they are, and as
/// the joint covariance predicts it. A point takes part in the stations that saw it alike.
struct SharedEffect {
  Vector2d head = Vector2d::Zero();
  Vector2d places = Vector2d::Zero();
  MatrixXd by;  ///< 2 x the parameters of Stitching::covariance
};

SharedEffect shared_effect(const fixtures::Scene& scene, const base::Head& truth, const base::Stitching& found,
                           const std::vector<std::size_t>& sources, const Vector3d& p,
                           const Eigen::Matrix<double, 2, 3>& axes) {
  SharedEffect effect;
  effect.by = MatrixXd::Zero(2, found.covariance.rows());
  const double share = 1.0 / static_cast<double>(sources.size());
  for (const std::size_t k : sources) {
    const base::StitchedStation& station = found.stations[k];
    const auto stop = std::find_if(scene.machine->stations.begin(), scene.machine->stations.end(),
                                   [&](const auto& one) { return one.name == station.name; });
    const base::Pose machine_from_rig = fixtures::machine_from_rig(*scene.machine, stop->axis_mm);
    const Vector3d p_in_rig = machine_from_rig.inverse() * p;
    effect.places += share * axes * (station.machine_from_rig * p_in_rig - p);
    const auto left_px = truth.left.project(p_in_rig);
    const auto right_px = truth.right.project(truth.right_from_left * p_in_rig);
    if (left_px && right_px) {
      const auto seen =
          math::point_of_left_ray(found.head->left, found.head->right, found.head->right_from_left, *left_px, *right_px);
      if (seen) effect.head += share * axes * (machine_from_rig.rotation * (*seen - p_in_rig));
    }
    const auto at = static_cast<Eigen::Index>(6 * k);
    effect.by.middleCols<3>(at) += share * axes * -base::skew(p);
    effect.by.middleCols<3>(at + 3) += share * axes;
    const auto first = static_cast<Eigen::Index>(6 * found.stations.size());
    effect.by.rightCols(effect.by.cols() - first) +=
        share * axes * machine_from_rig.rotation.toRotationMatrix() * math::point_by_head(*found.head, p_in_rig);
  }
  return effect;
}

/// Mean squares over the rim, measured and predicted.
struct Budget {
  std::array<std::vector<Vector2d>, 2> squares;

  void add(const Vector2d& error, const Vector2d& variance) {
    squares[0].push_back(error.cwiseAbs2());
    squares[1].push_back(variance);
  }
  [[nodiscard]] ordered_json json() const {
    std::array<Vector2d, 2> mean = {Vector2d::Zero(), Vector2d::Zero()};
    for (std::size_t k = 0; k < 2; ++k) {
      for (const Vector2d& one : squares[k]) mean[k] += one / static_cast<double>(squares[k].size());
    }
    return {{"u", mean[0].x()}, {"v", mean[0].y()}, {"predicted_u", mean[1].x()}, {"predicted_v", mean[1].y()}};
  }
};

/// The points of the rim. "head": what its errors do while the pixels stay, "places": of the stations, "shared": both together (they
/// compensate each other in part, since the places were found through the head), "own": what is left, of the edge pixels and of the
/// surface beside them.
Result<> add_edge(const fixtures::Scene& scene, const base::Head& truth, const fs::path& job, const base::Stitching& stitching,
                  ordered_json& result) {
  const auto table = base::read_table(job / "results" / "edge" / "edge.csv");
  if (!table) return tl::unexpected(table.error());
  const tests::TrueRim rim = tests::TrueRim::read(job);
  const std::vector<Vector3d> points = tests::triples(*table, {"x_mm", "y_mm", "z_mm"});
  const std::vector<double> sigma_u = tests::column(*table, "sigma_u_mm"), sigma_v = tests::column(*table, "sigma_v_mm");
  const std::size_t source = *table->column("source");
  const auto count = static_cast<Eigen::Index>(points.size());
  const Eigen::Index first_of_head = static_cast<Eigen::Index>(6 * stitching.stations.size());
  const MatrixXd& joint = stitching.covariance;
  Band u, v, own_u;
  Budget total, head, places, shared, own;
  VectorXd error(2 * count), own_variance(2 * count);
  MatrixXd by(2 * count, joint.rows());
  ordered_json rest = ordered_json::array();
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const std::size_t near = rim.nearest(points[at]);
    Eigen::Matrix<double, 2, 3> axes;
    axes << rim.normals[near].cross(rim.tangents[near]).transpose(), rim.normals[near].transpose();
    const Vector2d off = rim.off_mm(points[at]);
    const Vector2d variance(std::pow(sigma_u[at], 2), std::pow(sigma_v[at], 2));
    const SharedEffect effect =
        shared_effect(scene, truth, stitching, sources_of(table->rows[at][source], stitching), rim.points[near], axes);
    const auto predicted = [&](Eigen::Index from, Eigen::Index size) -> Vector2d {
      const MatrixXd part = effect.by.middleCols(from, size);
      return (part * joint.block(from, from, size, size) * part.transpose()).diagonal();
    };
    const Vector2d common = predicted(0, joint.rows());
    const Vector2d left = (variance - common).cwiseMax(0.01 * variance);
    u.add(off.x(), sigma_u[at]);
    v.add(off.y(), sigma_v[at]);
    total.add(off, variance);
    head.add(effect.head, predicted(first_of_head, joint.rows() - first_of_head));
    places.add(effect.places, predicted(0, first_of_head));
    shared.add(effect.head + effect.places, common);
    const Vector2d alone = off - effect.head - effect.places;
    own.add(alone, left);
    own_u.add(alone.x(), std::sqrt(left.x()));
    rest.push_back({std::round(1e5 * alone.x()) / 1e5, std::round(1e5 * std::sqrt(left.x())) / 1e5});
    error.segment<2>(2 * i) = off;
    own_variance.segment<2>(2 * i) = left;
    by.middleRows<2>(2 * i) = effect.by;
  }
  MatrixXd cov = by * joint * by.transpose();
  cov.diagonal() += own_variance;
  result["stages"]["edge"] = stage(error, cov);
  result["edge"] = {{"u", u.json()}, {"v", v.json()}, {"own_u", own_u.json()}};
  result["budget"] = {{"total", total.json()},
                      {"head", head.json()},
                      {"places", places.json()},
                      {"shared", shared.json()},
                      {"own", own.json()}};
  return {};
}

/// Corrections and torch of the tool path.
Result<> add_path(const fs::path& job, ordered_json& result) {
  const auto path = base::read_json(job / "results" / "edge" / "path.json");
  if (!path) return tl::unexpected(path.error());
  const tests::TrueRim rim = tests::TrueRim::read(job);
  Band u, v, tilt_u, tilt_t;
  for (const auto& point : path->at("points")) {
    const auto numbers = [&](const char* name) { return point.at(name).get<std::vector<double>>(); };
    const auto vector = [&](const char* name) {
      const std::vector<double> xyz = numbers(name);
      return Vector3d(xyz.at(0), xyz.at(1), xyz.at(2));
    };
    const Vector3d tip = vector("xyz_mm");
    const Vector2d off = rim.off_mm(tip);
    const Vector3d torch = rim.axes_at(tip).transpose() * vector("torch");
    u.add(off.x(), numbers("sigma_uv_mm").at(0));
    v.add(off.y(), numbers("sigma_uv_mm").at(1));
    tilt_u.add(torch.x(), numbers("sigma_torch_rad").at(0));
    tilt_t.add(torch.y(), numbers("sigma_torch_rad").at(1));
  }
  result["path"] = {{"u", u.json()}, {"v", v.json()}, {"tilt_u", tilt_u.json()}, {"tilt_t", tilt_t.json()}};
  return {};
}

}  // namespace

Result<ordered_json> compare(const fixtures::Scene& scene, const fs::path& job) {
  const fs::path results = job / "results";
  const base::Head truth = true_head(scene);
  ordered_json result = {{"stages", ordered_json::object()}};
  ordered_json& stages = result["stages"];
  if (auto ok = add_calibration(truth, results, stages); !ok) return base::fail(std::move(ok));
  const auto commissioning = base::read_commissioning(results / "commission");
  if (!commissioning) return tl::unexpected(commissioning.error());
  add_frame(scene, truth, *commissioning, stages);
  if (auto ok = add_cloud(scene, commissioning->head, results, stages); !ok) return base::fail(std::move(ok));
  const auto stitching = base::read_stitching(results / "stitch");
  if (!stitching) return tl::unexpected(stitching.error());
  const auto stations = static_cast<Eigen::Index>(stitching->stations.size());
  VectorXd error(6 * stations);
  for (Eigen::Index k = 0; k < stations; ++k) {
    const base::StitchedStation& station = stitching->stations[static_cast<std::size_t>(k)];
    for (const fixtures::Station& stop : scene.machine->stations) {
      if (stop.name != station.name) continue;
      error.segment<6>(6 * k) =
          base::difference(fixtures::machine_from_rig(*scene.machine, stop.axis_mm), station.machine_from_rig);
    }
  }
  stages["stations"] = stage(error, stitching->covariance.topLeftCorner(6 * stations, 6 * stations));
  const auto edge = base::read_json(results / "edge" / "result.json");
  if (!edge) return tl::unexpected(edge.error());
  stages["part"] = stage(base::difference(tests::true_machine_from_part(job), tests::pose_of(edge->at("machine_from_part"))),
                         tests::cov_of(edge->at("machine_from_part_cov")));
  if (auto ok = add_edge(scene, truth, job, *stitching, result); !ok) return base::fail(std::move(ok));
  if (auto ok = add_path(job, result); !ok) return base::fail(std::move(ok));
  return result;
}

}  // namespace crosstie::study
