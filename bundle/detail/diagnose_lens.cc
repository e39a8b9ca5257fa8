#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "bundle/detail/diagnose.h"

namespace crosstie::bundle::detail {
namespace {

using base::AdjustedCamera;
using base::AdjustedNetwork;

constexpr double kHighCorrelation = 0.95;
constexpr double kWeakFocal = 0.02;  // relative sigma of a focal length
constexpr double kFlat = 0.02;       // thickness of the points over their length
constexpr double kRolled_rad = std::numbers::pi / 4.0;
constexpr double kSignificant = 0.05;
constexpr double kPoorCoverage = 0.5;  // share of the image's cells that hold points

bool is_aicon(const AdjustedCamera& camera) { return camera.camera.model() == base::LensModel::kAicon; }

std::string name_of(const AdjustedCamera& camera, Eigen::Index parameter) {
  return std::string(base::parameter_names(camera.camera.model())[static_cast<std::size_t>(parameter)]);
}

/// Whether something was known of the focal length before.
bool was_calibrated(const Survey& survey, std::size_t camera) {
  const Eigen::MatrixXd& prior = survey.cameras[camera].camera.covariance();
  return prior.size() > 0 && std::isfinite(prior(0, 0));
}

void about_correlations(const AdjustedCamera& camera, AdjustedNetwork& result) {
  const Eigen::MatrixXd& cov = camera.camera.covariance();
  std::string pairs;
  for (Eigen::Index i = 0; i < cov.rows(); ++i) {
    for (Eigen::Index j = i + 1; j < cov.cols(); ++j) {
      const double scale = std::sqrt(cov(i, i) * cov(j, j));
      const bool both_focal = i == 0 && j == 1 && !is_aicon(camera);  // one scale under two names: always alike
      if (both_focal || !(scale > 0.0) || std::abs(cov(i, j)) < kHighCorrelation * scale) continue;
      pairs +=
          fmt::format("{}{}-{} {:+.3f}", pairs.empty() ? "" : ", ", name_of(camera, i), name_of(camera, j), cov(i, j) / scale);
    }
  }
  if (pairs.empty()) return;
  result.warnings.push_back(
      {"high_correlation", camera.name,
       fmt::format("camera {}: these parameters are correlated by more than {}: {}. Each alone means little; together they "
                   "describe the lens",
                   camera.name, kHighCorrelation, pairs)});
}

void about_focal_length(const AdjustedCamera& camera, AdjustedNetwork& result) {
  const Eigen::Index count = is_aicon(camera) ? 1 : 2;
  for (Eigen::Index k = 0; k < count; ++k) {
    const double relative = std::sqrt(camera.camera.covariance()(k, k)) / camera.camera.parameters()(k);
    if (!(relative > kWeakFocal)) continue;
    result.warnings.push_back(
        {"weak_parameter", camera.name,
         fmt::format("camera {}: {} is known to {:.1f} % only; take images at different distances and tilts, or give a "
                     "calibration",
                     camera.name, name_of(camera, k), 100.0 * relative)});
  }
}

void about_significance(const AdjustedCamera& camera, AdjustedNetwork& result) {
  std::string terms;
  for (Eigen::Index i = 0; i < camera.significance_p.size(); ++i) {
    if (!(camera.significance_p(i) > kSignificant)) continue;
    terms += fmt::format("{}{} (p {:.2f})", terms.empty() ? "" : ", ", name_of(camera, i), camera.significance_p(i));
  }
  if (terms.empty()) return;
  result.warnings.push_back(
      {"not_significant", camera.name,
       fmt::format("camera {}: these distortion terms cannot be told from zero at the 5 % level: {}. A model without them "
                   "describes the lens as well",
                   camera.name, terms)});
}

void about_coverage(const AdjustedCamera& camera, AdjustedNetwork& result) {
  if (camera.coverage >= kPoorCoverage) return;
  result.warnings.push_back(
      {"poor_coverage", camera.name,
       fmt::format("camera {}: points cover {:.0f} % of the image only (limit {:.0f} %); elsewhere its lens model is "
                   "extrapolated. Fill the image up to its corners, at least in some images",
                   camera.name, 100.0 * camera.coverage, 100.0 * kPoorCoverage)});
}

/// Whether two images of a camera are turned against each other, seen along `normal`.
bool was_rolled(const Survey& survey, const State& state, std::size_t camera, const Spread& spread) {
  std::vector<double> rolls;
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    if (survey.camera_of_image[i] != static_cast<int>(camera) || !state.poses[i]) continue;
    const Eigen::Vector3d right = spread.directions.transpose() * (state.poses[i]->rotation * Eigen::Vector3d::UnitX());
    rolls.push_back(std::atan2(right.z(), right.y()));
  }
  for (const double a : rolls) {
    for (const double b : rolls) {
      if (std::abs(std::remainder(a - b, 2.0 * std::numbers::pi)) > kRolled_rad) return true;
    }
  }
  return false;
}

void about_roll(const Survey& survey, const State& state, std::size_t c, const Spread& spread, bool flat,
                AdjustedNetwork& result) {
  const AdjustedCamera& camera = result.cameras[c];
  const Eigen::Index principal = is_aicon(camera) ? 1 : 2;
  const Eigen::MatrixXd& cov = camera.camera.covariance();
  const bool free = cov(principal, principal) > 0.0 || cov(principal + 1, principal + 1) > 0.0;
  if (!free || was_rolled(survey, state, c, spread)) return;
  if (flat) {
    result.warnings.push_back(
        {"planar_not_rolled", camera.name,
         fmt::format("the points are flat and camera {} was never rolled about its axis: its principal point leans on the "
                     "tilted images alone. Take some images turned by 90 degrees",
                     camera.name)});
  } else if (!was_calibrated(survey, c)) {
    result.warnings.push_back(
        {"not_rolled", camera.name,
         fmt::format("camera {} is calibrated with these images, but was never rolled about its axis: principal point and "
                     "distortion lean on the depth of the points. Take some images turned by 90 degrees",
                     camera.name)});
  }
}

}  // namespace

Spread spread_of(const AdjustedNetwork& network) {
  Spread spread;
  if (network.points.empty()) return spread;
  const auto count = static_cast<double>(network.points.size());
  for (const auto& point : network.points) spread.middle_mm += point.xyz_mm / count;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& point : network.points) {
    const Eigen::Vector3d at = point.xyz_mm - spread.middle_mm;
    scatter += at * at.transpose() / count;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter);
  spread.directions = eigen.eigenvectors();
  if (spread.directions.determinant() < 0.0) spread.directions.col(0) *= -1.0;
  spread.along_mm = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  return spread;
}

void about_lenses(const Survey& survey, const State& state, AdjustedNetwork& result) {
  const Spread spread = spread_of(result);
  const bool flat = spread.along_mm(0) < kFlat * spread.along_mm(2);
  std::string on_plane;
  for (std::size_t c = 0; c < result.cameras.size(); ++c) {
    const AdjustedCamera& camera = result.cameras[c];
    if (!camera.estimated || camera.camera.covariance().size() == 0) continue;
    about_correlations(camera, result);
    about_focal_length(camera, result);
    about_significance(camera, result);
    about_coverage(camera, result);
    about_roll(survey, state, c, spread, flat, result);
    const bool free_focal = camera.camera.covariance()(0, 0) > 0.0 && !was_calibrated(survey, c);
    if (flat && free_focal) on_plane += (on_plane.empty() ? "" : ", ") + camera.name;
  }
  if (on_plane.empty()) return;
  result.warnings.push_back(
      {"planar_points", on_plane,
       fmt::format("the points lie in a plane (thickness {:.2g} % of their length) and nothing was known of the focal length "
                   "of {}: it leans on the oblique images alone. Put points in front of the plane, or give a calibration",
                   100.0 * spread.along_mm(0) / spread.along_mm(2), on_plane)});
}

}  // namespace crosstie::bundle::detail
