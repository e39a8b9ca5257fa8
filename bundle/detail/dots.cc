#include "bundle/detail/dots.h"

#include <cmath>
#include <map>
#include <string>
#include <tuple>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

namespace crosstie::bundle::detail {
namespace {

constexpr double kExtrapolation = 2.0;  // of the orientation's sigma: an uncoded dot may lie outside of the coded ones

double typical_sigma_px(const Survey& survey) {
  std::vector<double> sigmas;
  for (const Ray& ray : survey.rays) sigmas.push_back(std::sqrt(0.5 * ray.cov_px2.trace()));
  const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
  std::nth_element(sigmas.begin(), middle, sigmas.end());
  return *middle;
}

/// Outer product of the vector from the ellipse's centre to the circle's, whose sign is not known.
Eigen::Matrix2d eccentricity_square(const Eigen::Matrix2d& shape_px2, double focal_px) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(shape_px2);
  const double minor2 = axes.eigenvalues()(0);
  const double major2 = axes.eigenvalues()(1);
  if (!(minor2 > 0.0)) return Eigen::Matrix2d::Zero();
  const double cos2 = minor2 / major2;
  const double square = major2 * major2 / (focal_px * focal_px) * cos2 * (1.0 - cos2);
  const Eigen::Vector2d minor = axes.eigenvectors().col(0);
  return square * minor * minor.transpose();
}

}  // namespace

std::vector<Dot> collect_dots(const base::Network& network, const Survey& survey, const Weights& weights,
                              const std::vector<std::optional<View>>& views) {
  std::map<std::string, const base::ImageObservations*> by_name;
  for (const base::ImageObservations& image : network.images) by_name[image.image] = &image;
  const double typical_px = typical_sigma_px(survey);
  std::vector<Dot> dots;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (!views[i]) continue;
    const View& view = *views[i];
    const base::Pose network_from_camera = view.camera_from_network.inverse();
    const auto first = dots.size();
    for (const base::Observation& observation : by_name.at(survey.images[i])->observations) {
      if (!observation.centre_px.allFinite()) continue;
      const auto direction = view.camera.unproject(observation.centre_px);
      if (!direction) continue;
      Dot dot;
      dot.image = static_cast<int>(i);
      dot.has_id =
          observation.status == base::ObservationStatus::kCoded || observation.status == base::ObservationStatus::kRefused;
      dot.centre_px = observation.centre_px;
      dot.detector_cov_px2 = usable_covariance(observation.cov_px2, typical_px);
      dot.shape_px2 = shape_of(observation);
      dot.size_px = dot.shape_px2.trace() > 0.0 ? observation.semi_major_px : 0.0;
      dot.direction = network_from_camera.rotation * *direction;
      const double orientation_px = kExtrapolation * view.orientation_sigma_px;
      dot.cov_px2 = weights.of_detector(dot.detector_cov_px2) + orientation_px * orientation_px * Eigen::Matrix2d::Identity() +
                    eccentricity_square(dot.shape_px2, view.camera.focal_px().mean());
      dots.push_back(std::move(dot));
    }
    std::stable_sort(dots.begin() + static_cast<std::ptrdiff_t>(first), dots.end(), [](const Dot& a, const Dot& b) {
      return std::make_tuple(a.centre_px.y(), a.centre_px.x()) < std::make_tuple(b.centre_px.y(), b.centre_px.x());
    });
  }
  return dots;
}

DotGrid::DotGrid(const std::vector<Dot>& dots, int image, int width_px, int height_px) {
  const auto first = std::lower_bound(dots.begin(), dots.end(), image, [](const Dot& dot, int i) { return dot.image < i; });
  const auto last = std::upper_bound(dots.begin(), dots.end(), image, [](int i, const Dot& dot) { return i < dot.image; });
  const auto count = static_cast<double>(last - first);
  if (first == last) return;
  cell_px_ = std::max(1.0, std::sqrt(static_cast<double>(width_px) * height_px / count));
  columns_ = static_cast<int>(width_px / cell_px_) + 1;
  rows_ = static_cast<int>(height_px / cell_px_) + 1;
  const auto cell = [&](const Dot& dot) {
    return static_cast<std::size_t>(row(dot.centre_px.y()) * columns_ + column(dot.centre_px.x()));
  };
  starts_.assign(static_cast<std::size_t>(columns_ * rows_) + 1, 0);
  for (auto dot = first; dot != last; ++dot) {
    ++starts_[cell(*dot) + 1];
    largest_size_px_ = std::max(largest_size_px_, dot->size_px);
    const double largest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(dot->cov_px2).eigenvalues()(1);
    largest_sigma_px_ = std::max(largest_sigma_px_, std::sqrt(largest));
  }
  for (std::size_t k = 1; k < starts_.size(); ++k) starts_[k] += starts_[k - 1];
  std::vector<int> next(starts_.begin(), starts_.end() - 1);
  members_.resize(static_cast<std::size_t>(last - first));
  for (auto dot = first; dot != last; ++dot) {
    members_[static_cast<std::size_t>(next[cell(*dot)]++)] = static_cast<int>(dot - dots.begin());
  }
}

}  // namespace crosstie::bundle::detail
