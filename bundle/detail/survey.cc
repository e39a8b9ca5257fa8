#include "bundle/detail/survey.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <tuple>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace crosstie::bundle::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr double kLeastShareOfMedian = 1.0 / 3.0;  // a smaller sigma is raised to this
constexpr double kIncredible = 0.1;                // of the median: a smaller sigma is no measurement's
constexpr double kFallbackSigma_px = 0.05;         // where no detector covariance is usable at all

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

bool usable(const Eigen::Matrix2d& cov) {
  return cov.allFinite() && cov(0, 0) > 0.0 && cov(1, 1) > 0.0 && cov.determinant() > 0.0;
}

/// Makes all covariances positive definite and none absurdly small.
void repair_covariances(Survey& survey) {
  std::vector<double> sigmas;
  for (const Ray& ray : survey.rays) {
    if (usable(ray.cov_px2)) sigmas.push_back(std::sqrt(0.5 * ray.cov_px2.trace()));
  }
  const double typical = sigmas.empty() ? kFallbackSigma_px : median(sigmas);
  if (sigmas.size() < survey.rays.size()) {
    survey.warnings.push_back(
        {"no_image_covariance", "",
         fmt::format("{} of {} image points came without a usable covariance; {:.3g} px is assumed for each of them",
                     survey.rays.size() - sigmas.size(), survey.rays.size(), typical)});
  }
  for (Ray& ray : survey.rays) ray.cov_px2 = usable_covariance(ray.cov_px2, typical);
}

Result<> add_cameras(const base::Network& network, Survey& survey) {
  survey.cameras = network.cameras;
  std::sort(survey.cameras.begin(), survey.cameras.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  for (std::size_t i = 1; i < survey.cameras.size(); ++i) {
    if (survey.cameras[i].name == survey.cameras[i - 1].name) {
      return fail(ErrorCode::kBadInput, "camera " + survey.cameras[i].name + " is given twice");
    }
  }
  return {};
}

Result<> add_images(const base::Network& network, Survey& survey) {
  std::vector<const base::ImageObservations*> sorted;
  for (const auto& image : network.images) sorted.push_back(&image);
  std::sort(sorted.begin(), sorted.end(), [](const auto* a, const auto* b) { return a->image < b->image; });
  std::set<int> ids;
  for (const auto* image : sorted) {
    if (!survey.images.empty() && survey.images.back() == image->image) {
      return fail(ErrorCode::kBadInput, "image " + image->image + " is given twice; rename one of them");
    }
    const auto camera = std::find_if(survey.cameras.begin(), survey.cameras.end(),
                                     [&](const auto& candidate) { return candidate.name == image->camera; });
    if (camera == survey.cameras.end()) {
      return fail(ErrorCode::kBadInput,
                  "image " + image->image + " names the camera " + image->camera + ", which is not given");
    }
    const bool sized = image->width_px > 0 && image->height_px > 0;
    if (sized && (image->width_px != camera->camera.width_px() || image->height_px != camera->camera.height_px())) {
      return fail(
          ErrorCode::kBadInput,
          fmt::format("image {} has {} x {} px, its camera {} has {} x {}; give them separate cameras", image->image,
                      image->width_px, image->height_px, camera->name, camera->camera.width_px(), camera->camera.height_px()));
    }
    survey.images.push_back(image->image);
    survey.camera_of_image.push_back(static_cast<int>(camera - survey.cameras.begin()));
    for (const base::Observation& observation : image->observations) {
      if (observation.status != base::ObservationStatus::kCoded) continue;
      if (!observation.centre_px.allFinite()) {
        return fail(ErrorCode::kBadInput,
                    fmt::format("image {}, id {}: the image point is not finite", image->image, observation.id));
      }
      ids.insert(observation.id);
    }
  }
  survey.ids.assign(ids.begin(), ids.end());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    std::vector<Ray> rays;
    for (const base::Observation& observation : sorted[i]->observations) {
      if (observation.status != base::ObservationStatus::kCoded) continue;
      const auto point = std::lower_bound(survey.ids.begin(), survey.ids.end(), observation.id) - survey.ids.begin();
      rays.push_back({static_cast<int>(i), static_cast<int>(point), observation.centre_px, observation.cov_px2,
                      observation.semi_major_px, false, observation.centre_px, shape_of(observation)});
    }
    std::sort(rays.begin(), rays.end(), [](const Ray& a, const Ray& b) {
      return std::tie(a.point, a.measured_px.y(), a.measured_px.x()) < std::tie(b.point, b.measured_px.y(), b.measured_px.x());
    });
    for (std::size_t k = 1; k < rays.size(); ++k) {
      if (rays[k].point == rays[k - 1].point) rays[k].twin = rays[k - 1].twin = true;
    }
    survey.rays.insert(survey.rays.end(), rays.begin(), rays.end());
  }
  survey.rays_of_image.resize(survey.images.size());
  survey.rays_of_point.resize(survey.ids.size());
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    survey.rays_of_image[static_cast<std::size_t>(survey.rays[r].image)].push_back(static_cast<int>(r));
    survey.rays_of_point[static_cast<std::size_t>(survey.rays[r].point)].push_back(static_cast<int>(r));
  }
  return {};
}

Result<> add_bars(const base::Network& network, Survey& survey) {
  int defining = 0;
  int used = 0;
  for (const base::ScaleBar& bar : network.scale_bars) {
    const std::string name = fmt::format("scale bar {}-{}", bar.id_a, bar.id_b);
    if (bar.id_a == bar.id_b) return fail(ErrorCode::kBadInput, name + " has the same point at both ends");
    if (!(bar.length_mm > 0.0) || !std::isfinite(bar.length_at_temperature_mm())) {
      return fail(ErrorCode::kBadInput, fmt::format("{}: a length of {} mm is not possible", name, bar.length_mm));
    }
    const bool is_used = bar.role == base::ScaleBarRole::kUsed;
    if (!std::isfinite(bar.sigma_mm) || bar.sigma_mm < 0.0 || (is_used && bar.sigma_mm == 0.0)) {
      return fail(ErrorCode::kBadInput, fmt::format("{}: a used bar needs a positive sigma, not {} mm", name, bar.sigma_mm));
    }
    const int a = survey.point_of(bar.id_a);
    const int b = survey.point_of(bar.id_b);
    if (a < 0 || b < 0) {
      survey.warnings.push_back({"bar_not_seen", name, name + " is not measured: an end of it is seen in no image"});
      continue;
    }
    defining += bar.role == base::ScaleBarRole::kDefines ? 1 : 0;
    used += is_used ? 1 : 0;
    survey.bars.push_back({a, b, bar});
  }
  std::stable_sort(survey.bars.begin(), survey.bars.end(), [](const Bar& x, const Bar& y) {
    return std::tie(x.bar.id_a, x.bar.id_b) < std::tie(y.bar.id_a, y.bar.id_b);
  });
  if (defining > 1 || (defining == 1 && used > 0)) {
    return fail(ErrorCode::kBadInput,
                "more than one length defines the scale; let one define it, or give each a sigma and the role used");
  }
  survey.scale_is_free = network.scale_is_free;
  std::size_t controlled = 0;
  for (const Control& control : survey.control) controlled += control.points.size();
  const bool determined = defining + used > 0 || controlled > 1;
  if (!determined && !network.scale_is_free) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        "nothing determines the scale: give a scale bar whose ends are both seen, or a known distance, or control points, "
        "or say that the scale is free");
  }
  if (determined && network.scale_is_free) {
    return fail(ErrorCode::kBadInput,
                "the scale is said to be free, yet a bar or control points are to determine it; choose one of the two");
  }
  if (defining > 0 && controlled > 1) {
    return fail(ErrorCode::kBadInput,
                "a length without a sigma defines the scale, and so do the control points; give the length a sigma");
  }
  return {};
}

Result<> add_rigs(const base::Network& network, Survey& survey) {
  survey.rig_of_camera.assign(survey.cameras.size(), -1);
  survey.station_of_image.assign(survey.images.size(), -1);
  for (const base::NetworkRig& given : network.rigs) {
    const auto bad = [&](const std::string& what) {
      return fail(ErrorCode::kBadInput, fmt::format("rig {}: {}", given.name, what));
    };
    if (given.cameras.size() < 2) return bad("it needs two cameras or more");
    Rig rig{given.name, {}};
    const int number = static_cast<int>(survey.rigs.size());
    for (const std::string& name : given.cameras) {
      const auto camera = std::find_if(survey.cameras.begin(), survey.cameras.end(),
                                       [&](const auto& candidate) { return candidate.name == name; });
      if (camera == survey.cameras.end()) return bad("no image was taken by its camera " + name);
      const auto index = static_cast<std::size_t>(camera - survey.cameras.begin());
      if (survey.rig_of_camera[index] >= 0) return bad("camera " + name + " is named twice");
      survey.rig_of_camera[index] = number;
      rig.cameras.push_back(static_cast<int>(index));
    }
    for (const std::vector<std::string>& names : given.stations) {
      Station station{"", number, {}};
      for (const std::string& name : names) {
        const auto image = std::lower_bound(survey.images.begin(), survey.images.end(), name);
        if (image == survey.images.end() || *image != name) return bad("there is no image " + name);
        const auto index = static_cast<std::size_t>(image - survey.images.begin());
        const int camera = survey.camera_of_image[index];
        if (survey.rig_of_camera[static_cast<std::size_t>(camera)] != number) {
          return bad(fmt::format("image {} is of camera {}, which is not on it", name,
                                 survey.cameras[static_cast<std::size_t>(camera)].name));
        }
        if (survey.station_of_image[index] >= 0) return bad("image " + name + " stands in two stations");
        for (const int other : station.images) {
          if (survey.camera_of_image[static_cast<std::size_t>(other)] == camera) {
            return bad(fmt::format("images {} and {} of one station are of the same camera",
                                   survey.images[static_cast<std::size_t>(other)], name));
          }
        }
        survey.station_of_image[index] = static_cast<int>(survey.stations.size());
        station.images.push_back(static_cast<int>(index));
      }
      if (station.images.empty()) continue;
      std::sort(station.images.begin(), station.images.end(), [&](int a, int b) {
        const auto place = [&](int image) {
          return std::find(rig.cameras.begin(), rig.cameras.end(), survey.camera_of_image[static_cast<std::size_t>(image)]);
        };
        return place(a) < place(b);
      });
      station.name = survey.images[static_cast<std::size_t>(station.images.front())];
      survey.stations.push_back(std::move(station));
    }
    survey.rigs.push_back(std::move(rig));
  }
  return {};
}

/// The root of the inverse of a covariance; directions without variance get a thousandth of the least sigma.
Result<Eigen::MatrixXd> whitening_of(const Eigen::MatrixXd& cov, const std::string& name) {
  constexpr double kSingular = 1e-12;  // over the largest eigenvalue: rounding of a direction without variance
  constexpr double kExact = 1e-6;      // over the least variance
  if (cov.size() == 0) return Eigen::MatrixXd(0, 0);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(cov);
  Eigen::VectorXd values = eigen.eigenvalues();
  const double largest = values.maxCoeff();
  if (!(largest > 0.0) || values.minCoeff() < -1e-9 * largest) {
    return fail(ErrorCode::kBadInput, name + ": the covariance is not positive semi-definite");
  }
  const double least = *std::find_if(values.begin(), values.end(), [&](double v) { return v > kSingular * largest; });
  values = values.unaryExpr([&](double v) { return v > kSingular * largest ? v : kExact * least; });
  return Eigen::MatrixXd(values.cwiseSqrt().cwiseInverse().asDiagonal() * eigen.eigenvectors().transpose());
}

Result<> add_control(const base::Network& network, Survey& survey) {
  std::set<int> known;
  for (const base::ControlGroup& group : network.control) {
    const std::string name =
        group.ids.size() == 1 ? fmt::format("control point {}", group.ids.front()) : std::string("control points");
    const auto count = static_cast<Eigen::Index>(3 * group.ids.size());
    if (group.xyz_mm.size() != count || group.cov_mm2.rows() != count || group.cov_mm2.cols() != count ||
        !group.xyz_mm.allFinite() || !group.cov_mm2.allFinite()) {
      return fail(ErrorCode::kBadInput, name + ": coordinates and covariance must be finite and belong to the ids");
    }
    Control control;
    std::vector<Eigen::Index> present;
    std::vector<Eigen::Index> observed;  // of `present`
    for (std::size_t k = 0; k < group.ids.size(); ++k) {
      if (!known.insert(group.ids[k]).second) {
        return fail(ErrorCode::kBadInput, fmt::format("control point {} is given twice", group.ids[k]));
      }
      const int point = survey.point_of(group.ids[k]);
      if (point < 0) {
        survey.warnings.push_back({"control_not_seen", fmt::format("{}", group.ids[k]),
                                   fmt::format("control point {} is seen in no image", group.ids[k])});
        continue;
      }
      control.points.push_back(point);
      control.held.push_back({});
      for (Eigen::Index axis = 0; axis < 3; ++axis) {
        const Eigen::Index at = 3 * static_cast<Eigen::Index>(k) + axis;
        const bool held = group.cov_mm2(at, at) == 0.0;
        control.held.back()[static_cast<std::size_t>(axis)] = held;
        if (!held) observed.push_back(static_cast<Eigen::Index>(present.size()));
        present.push_back(at);
      }
    }
    if (control.points.empty()) continue;
    control.xyz_mm = group.xyz_mm(present);
    const Eigen::MatrixXd cov = group.cov_mm2(present, present);
    control.sigma_mm = cov.diagonal().cwiseMax(0.0).cwiseSqrt();
    auto root = whitening_of(cov(observed, observed), name);
    if (!root) return fail(std::move(root));
    control.whitening = Eigen::MatrixXd::Zero(root->rows(), control.xyz_mm.size());
    control.whitening(Eigen::all, observed) = *root;
    survey.control.push_back(std::move(control));
  }
  return {};
}

Result<> add_datum(const base::Network& network, Survey& survey) {
  if (!network.datum.empty() && !network.control.empty()) {
    return fail(ErrorCode::kBadInput,
                "control points define the frame already; leave out the datum points, or the control points");
  }
  std::set<int> known;
  for (const base::DatumPoint& point : network.datum) {
    if (!point.xyz_mm.allFinite() || !known.insert(point.id).second) {
      return fail(ErrorCode::kBadInput, fmt::format("datum point {} is given twice, or is not finite", point.id));
    }
    const int index = survey.point_of(point.id);
    if (index < 0) {
      survey.warnings.push_back(
          {"datum_point_not_seen", fmt::format("{}", point.id), fmt::format("datum point {} is seen in no image", point.id)});
      continue;
    }
    survey.datum.push_back({index, point.xyz_mm, point.axes});
  }
  if (!network.datum.empty() && survey.datum.empty()) {
    return fail(ErrorCode::kNoUniqueSolution,
                "none of the datum points is seen in an image; compare their ids with the markers'");
  }
  if (!network.datum.empty()) return {};
  for (const Control& control : survey.control) {
    for (std::size_t k = 0; k < control.points.size(); ++k) {
      survey.datum.push_back(
          {control.points[k], control.xyz_mm.segment<3>(3 * static_cast<Eigen::Index>(k)), {true, true, true}});
    }
  }
  return {};
}

Result<> add_start_values(const base::Network& network, Survey& survey) {
  survey.start_poses.resize(survey.images.size());
  survey.start_points.resize(survey.ids.size());
  for (const base::StartPose& start : network.start_poses) {
    const auto image = std::lower_bound(survey.images.begin(), survey.images.end(), start.image);
    if (image == survey.images.end() || *image != start.image) {
      return fail(ErrorCode::kBadInput, "there is a start pose of the image " + start.image + ", but no such image");
    }
    survey.start_poses[static_cast<std::size_t>(image - survey.images.begin())] = start.network_from_camera;
  }
  for (const base::ReferencePoint& start : network.start_points) {
    if (const int point = survey.point_of(start.id); point >= 0)
      survey.start_points[static_cast<std::size_t>(point)] = start.xyz_mm;
  }
  return {};
}

}  // namespace

int Survey::point_of(int id) const {
  const auto found = std::lower_bound(ids.begin(), ids.end(), id);
  return found != ids.end() && *found == id ? static_cast<int>(found - ids.begin()) : -1;
}

Eigen::Matrix2d usable_covariance(const Eigen::Matrix2d& cov_px2, double typical_px) {
  if (!usable(cov_px2) || cov_px2.trace() < 2.0 * std::pow(kIncredible * typical_px, 2)) {
    return typical_px * typical_px * Eigen::Matrix2d::Identity();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(cov_px2);
  const double least = std::pow(kLeastShareOfMedian * typical_px, 2);
  if (eigen.eigenvalues()(0) >= least) return cov_px2;
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(least).asDiagonal() * eigen.eigenvectors().transpose();
}

Eigen::Matrix2d shape_of(const base::Observation& observation) {
  if (!(observation.semi_minor_px > 0.0) || !std::isfinite(observation.semi_major_px) ||
      !std::isfinite(observation.angle_rad)) {
    return Eigen::Matrix2d::Zero();
  }
  const Eigen::Matrix2d axes = Eigen::Rotation2Dd(observation.angle_rad).toRotationMatrix();
  const Eigen::Vector2d squares(observation.semi_major_px * observation.semi_major_px,
                                observation.semi_minor_px * observation.semi_minor_px);
  return axes * squares.asDiagonal() * axes.transpose();
}

Result<Survey> make_survey(const base::Network& network) {
  Survey survey;
  survey.dot_diameter_mm = network.dot_diameter_mm;
  if (auto ok = add_cameras(network, survey); !ok) return fail(std::move(ok));
  if (auto ok = add_images(network, survey); !ok) return fail(std::move(ok));
  if (survey.images.size() < 2) {
    return fail(ErrorCode::kNoUniqueSolution,
                "one image does not determine depths; at least two from different places are needed");
  }
  if (survey.rays.empty()) {
    return fail(ErrorCode::kNoUniqueSolution,
                "no coded marker was read in any image; check the marker family and the ids in use");
  }
  for (const auto& add : {add_rigs, add_control, add_datum, add_bars, add_start_values}) {
    if (auto ok = add(network, survey); !ok) return fail(std::move(ok));
  }
  repair_covariances(survey);
  survey.coded_points = survey.ids.size();
  return survey;
}

}  // namespace crosstie::bundle::detail
