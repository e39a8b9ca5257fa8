#include "bundle/detail/views.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "bundle/detail/frame.h"
#include "math/cofactors.h"

namespace crosstie::bundle::detail {
namespace {

constexpr std::size_t kPartners = 5;
constexpr double kLeastAngle_rad = 0.087;  // 5 degrees: below it, depth is too weak to predict into a third image

/// Largest sigma of a prediction from the image's unknowns alone, in the datum of the points.
std::vector<double> orientation_sigmas_px(const Survey& survey, const Estimate& at, const Weights& weights) {
  std::vector<double> sigmas(survey.images.size(), 0.0);
  const auto cofactors = math::Cofactors::make(at.equations, inner_conditions(at.network, at.equations.null_space()));
  if (!cofactors) return sigmas;
  std::vector<Eigen::MatrixXd> of_image(survey.images.size());
  for (int g = 0; g < at.rows.group_count(); ++g) {
    const int r = at.network.ray_of_group[static_cast<std::size_t>(g)];
    if (r < 0) continue;
    const auto image = static_cast<std::size_t>(survey.rays[static_cast<std::size_t>(r)].image);
    const auto terms = at.rows.terms(g);
    std::vector<int> blocks;
    Eigen::MatrixXd jacobian(2, 0);
    for (std::size_t t = 0; t < terms.size(); ++t) {
      if (at.network.model.blocks[static_cast<std::size_t>(terms[t].block)].role != math::BlockRole::kKept) continue;
      blocks.push_back(terms[t].block);
      jacobian.conservativeResize(2, jacobian.cols() + terms[t].size);
      jacobian.rightCols(terms[t].size) = at.rows.jacobian(g, t);
    }
    if (blocks.empty()) continue;
    if (of_image[image].size() == 0) of_image[image] = cofactors->joint(blocks);
    const Eigen::Matrix2d factor = weights.covariance(r).llt().matrixL();
    const Eigen::Matrix2d cov = factor * jacobian * of_image[image] * jacobian.transpose() * factor.transpose();
    const double largest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(cov).eigenvalues()(1);
    sigmas[image] = std::max(sigmas[image], std::sqrt(std::max(0.0, largest)));
  }
  return sigmas;
}

}  // namespace

std::vector<std::optional<View>> make_views(const Survey& survey, const State& state, const Estimate& at,
                                            const Weights& weights) {
  const std::vector<double> sigmas = orientation_sigmas_px(survey, at, weights);
  std::vector<std::optional<View>> views(survey.images.size());
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    if (!state.poses[i]) continue;
    const auto c = static_cast<std::size_t>(survey.camera_of_image[i]);
    const base::Camera& start = survey.cameras[c].camera;
    auto camera = base::Camera::make(start.model(), start.width_px(), start.height_px(), state.lenses[c]);
    if (!camera) continue;
    views[i] = View{std::move(*camera), state.poses[i]->inverse(), state.poses[i]->translation_mm, sigmas[i]};
  }
  return views;
}

std::optional<Sight> see(const View& view, const Eigen::Vector3d& point) {
  Sight sight;
  const auto pixel = view.camera.project(view.camera_from_network * point, &sight.jacobian);
  if (!pixel) return {};
  if (!(pixel->x() >= 0.0 && pixel->y() >= 0.0 && pixel->x() <= view.camera.width_px() - 1 &&
        pixel->y() <= view.camera.height_px() - 1)) {
    return {};
  }
  sight.pixel = *pixel;
  sight.jacobian = sight.jacobian * view.camera_from_network.rotation.toRotationMatrix();
  return sight;
}

double angle_at(const Eigen::Vector3d& point, const View& a, const View& b) {
  const Eigen::Vector3d to_a = a.centre - point;
  const Eigen::Vector3d to_b = b.centre - point;
  return std::atan2(to_a.cross(to_b).norm(), to_a.dot(to_b));
}

std::vector<std::vector<int>> partner_images(const Survey& survey, const State& state,
                                             const std::vector<std::optional<View>>& views) {
  const std::size_t count = views.size();
  std::vector<double> scores(count * count, 0.0);
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    if (!state.points[p]) continue;
    std::vector<std::size_t> images;
    for (const int r : survey.rays_of_point[p]) {
      const auto image = static_cast<std::size_t>(survey.rays[static_cast<std::size_t>(r)].image);
      if (state.active[static_cast<std::size_t>(r)] && views[image]) images.push_back(image);
    }
    for (const std::size_t i : images) {
      for (const std::size_t j : images) {
        if (j <= i) continue;
        const double angle = angle_at(*state.points[p], *views[i], *views[j]);
        if (angle < kLeastAngle_rad) continue;
        const double score = std::max(0.0, std::sin(2.0 * angle));
        scores[i * count + j] += score;
        scores[j * count + i] += score;
      }
    }
  }
  std::vector<std::vector<int>> partners(count);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < count; ++j) {
      if (scores[i * count + j] > 0.0) partners[i].push_back(static_cast<int>(j));
    }
    std::stable_sort(partners[i].begin(), partners[i].end(), [&](int a, int b) {
      return scores[i * count + static_cast<std::size_t>(a)] > scores[i * count + static_cast<std::size_t>(b)];
    });
    if (partners[i].size() > kPartners) partners[i].resize(kPartners);
  }
  return partners;
}

}  // namespace crosstie::bundle::detail
