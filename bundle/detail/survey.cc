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

#include "bundle/detail/survey_knowns.h"
#include "math/median.h"

namespace crosstie::bundle::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr double kLeastShareOfMedian = 1.0 / 3.0;  // a smaller sigma is raised to this
constexpr double kIncredible = 0.1;                // of the median: a smaller sigma is no measurement's
constexpr double kFallbackSigma_px = 0.05;         // where no detector covariance is usable at all

bool usable(const Eigen::Matrix2d& cov) {
  return cov.allFinite() && cov(0, 0) > 0.0 && cov(1, 1) > 0.0 && cov.determinant() > 0.0;
}

/// Makes all covariances positive definite and none absurdly small.
void repair_covariances(Survey& survey) {
  std::vector<double> sigmas;
  for (const Ray& ray : survey.rays) {
    if (usable(ray.cov_px2)) sigmas.push_back(std::sqrt(0.5 * ray.cov_px2.trace()));
  }
  const double typical = sigmas.empty() ? kFallbackSigma_px : math::median(sigmas);
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
