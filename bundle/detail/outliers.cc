#include "bundle/detail/outliers.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "bundle/detail/triangulate.h"
#include "math/cofactors.h"
#include "math/distributions.h"

namespace crosstie::bundle::detail {
namespace {

constexpr double kUncontrolled = 1e-3;  // redundancy below which a residual says nothing
constexpr int kLeastRaysOfImage = 4;
constexpr std::size_t kLeastRaysOfUncoded = 3;  // two rays have one condition only, and no id says that they belong together

std::vector<int> active_rays(const State& state, const std::vector<int>& rays) {
  std::vector<int> active;
  for (const int r : rays) {
    if (state.active[static_cast<std::size_t>(r)]) active.push_back(r);
  }
  return active;
}

/// Why a point never got a position.
std::string lonely(const Survey& survey, const State& state, int point) {
  int oriented = 0;
  for (const int r : survey.rays_of_point[static_cast<std::size_t>(point)]) {
    oriented += state.poses[static_cast<std::size_t>(survey.rays[static_cast<std::size_t>(r)].image)] ? 1 : 0;
  }
  return oriented < 2 ? "one ray only" : "its rays do not meet in one place";
}

/// Whether another image of the same station, with rays enough of its own, tells where this one stands.
bool carried_by_rig(const Survey& survey, const State& state, int image) {
  const int station = survey.station_of_image[static_cast<std::size_t>(image)];
  const auto mounted = [&](int i) {
    return state.mounts[static_cast<std::size_t>(survey.camera_of_image[static_cast<std::size_t>(i)])].has_value();
  };
  if (station < 0 || !mounted(image)) return false;
  const std::vector<int>& images = survey.stations[static_cast<std::size_t>(station)].images;
  return std::any_of(images.begin(), images.end(), [&](int other) {
    return other != image && mounted(other) && state.poses[static_cast<std::size_t>(other)] &&
           static_cast<int>(active_rays(state, survey.rays_of_image[static_cast<std::size_t>(other)]).size()) >=
               kLeastRaysOfImage;
  });
}

double critical_value(const AdjustOptions& options, int redundancy) {
  return redundancy > 3 ? math::tau_quantile(1.0 - options.significance, 2.0, redundancy) : 1e300;
}

}  // namespace

double standardised(const Eigen::VectorXd& whitened_residual, const Eigen::MatrixXd& residual_cofactor) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(residual_cofactor);
  double sum = 0.0;
  int rank = 0;
  for (Eigen::Index i = 0; i < whitened_residual.size(); ++i) {
    if (eigen.eigenvalues()(i) < kUncontrolled) continue;
    sum += std::pow(eigen.eigenvectors().col(i).dot(whitened_residual), 2) / eigen.eigenvalues()(i);
    ++rank;
  }
  return rank > 0 ? std::sqrt(sum / rank) : 0.0;
}

std::vector<double> standardised_of_rays(const Survey& survey, const State& state, const Estimate& at, const Weights& weights) {
  std::vector<double> w(survey.rays.size(), 0.0);
  for (int g = 0; g < at.rows.group_count(); ++g) {
    const int r = at.network.ray_of_group[static_cast<std::size_t>(g)];
    if (r >= 0) {
      w[static_cast<std::size_t>(r)] = standardised(at.rows.residual(g), at.residual_cofactors()[static_cast<std::size_t>(g)]);
    }
  }
  // Rejected rays: J Q J' is the same in every datum.
  const auto cofactors = math::Cofactors::make(at.equations, at.equations.null_space());
  if (!cofactors) return w;
  const std::vector<Eigen::Matrix2d> whitening = weights.whitening();
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    const Ray& ray = survey.rays[r];
    const int image = at.network.image_block[static_cast<std::size_t>(ray.image)];
    const int point = at.network.point_block[static_cast<std::size_t>(ray.point)];
    if (state.active[r] || image < 0 || point < 0) continue;
    math::WhitenedRows row;
    if (!at.network.model.linearise(*at.network.image_point(survey, static_cast<int>(r), whitening[r]), row)) continue;
    std::vector<int> blocks;
    Eigen::MatrixXd jacobian(2, 0);
    for (std::size_t t = 0; t < row.terms(0).size(); ++t) {
      blocks.push_back(row.terms(0)[t].block);
      const Eigen::Index before = jacobian.cols();
      jacobian.conservativeResize(2, before + row.terms(0)[t].size);
      jacobian.rightCols(row.terms(0)[t].size) = row.jacobian(0, t);
    }
    const Eigen::Matrix2d cov = Eigen::Matrix2d::Identity() + jacobian * cofactors->joint(blocks) * jacobian.transpose();
    const Eigen::Vector2d residual = row.residual(0);
    w[r] = std::sqrt(0.5 * residual.dot(cov.ldlt().solve(residual)));
  }
  return w;
}

void prune(const Survey& survey, const AdjustOptions& options, State& state, Reasons& reasons) {
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t r = 0; r < survey.rays.size(); ++r) {
      if (state.active[r] && !state.knows(survey.rays[r])) state.active[r] = 0;
    }
    for (std::size_t p = 0; p < survey.ids.size(); ++p) {
      if (!state.points[p]) continue;
      const std::vector<int> rays = active_rays(state, survey.rays_of_point[p]);
      std::string reason;
      if (rays.empty() || rays.size() == 1) {
        std::size_t oriented = 0;
        for (const int r : survey.rays_of_point[p]) {
          oriented += state.poses[static_cast<std::size_t>(survey.rays[static_cast<std::size_t>(r)].image)] ? 1U : 0U;
        }
        reason = oriented < 2 ? "one ray only" : "one ray only: its other rays do not agree with it";
      } else if (p >= survey.coded_points && rays.size() < kLeastRaysOfUncoded) {
        reason = "uncoded target with two rays only: its other rays do not agree with them";
      } else if (largest_angle(survey, state, rays) < options.min_angle_rad) {
        reason = fmt::format("rays nearly parallel: they meet at less than {:.2g} degrees",
                             options.min_angle_rad * 180.0 / 3.14159265358979);
      }
      if (reason.empty()) continue;
      state.points[p].reset();
      reasons.point[p] = reason;
      changed = true;
    }
    for (std::size_t i = 0; i < survey.images.size(); ++i) {
      if (!state.poses[i]) continue;
      const std::size_t count = active_rays(state, survey.rays_of_image[i]).size();
      if (static_cast<int>(count) >= kLeastRaysOfImage || (count > 0 && carried_by_rig(survey, state, static_cast<int>(i))))
        continue;
      state.poses[i].reset();
      reasons.image[i] =
          fmt::format("image not oriented: only {} usable markers, at least {} are needed", count, kLeastRaysOfImage);
      changed = true;
    }
  }
}

void sort_out_points(const Survey& survey, const AdjustOptions& options, double tolerance_px, State& state, Reasons& reasons) {
  constexpr double kOutside = 0.2;  // share of the rays that must disagree before a point counts as moved
  const auto directions = ray_directions(survey, state);
  for (std::size_t p = 0; p < survey.ids.size(); ++p) {
    std::vector<int> rays;
    bool all_agree = state.points[p].has_value();
    for (const int r : survey.rays_of_point[p]) {
      const Ray& ray = survey.rays[static_cast<std::size_t>(r)];
      if (ray.twin || !state.poses[static_cast<std::size_t>(ray.image)]) continue;
      rays.push_back(r);
      all_agree = all_agree && distance_px(survey, state, ray) < tolerance_px;
    }
    if (all_agree || rays.size() < 2) continue;
    // Misread ids lie where another marker is: they say nothing about this point.
    std::erase_if(rays, [&](int r) {
      const Ray& ray = survey.rays[static_cast<std::size_t>(r)];
      if (state.points[p] && distance_px(survey, state, ray) < tolerance_px) return false;
      for (std::size_t q = 0; q < survey.ids.size(); ++q) {
        if (q == p || !state.points[q]) continue;
        const auto pixel = project_into(survey, state, ray.image, *state.points[q]);
        if (pixel && (*pixel - ray.measured_px).norm() < std::max(tolerance_px, 0.5 * ray.size_px)) return true;
      }
      return false;
    });
    std::vector<Triangulation> places;
    std::vector<int> left = rays;
    while (left.size() > 1) {
      auto place = triangulate(survey, state, directions, left, tolerance_px, options.min_angle_rad);
      if (!place) break;
      std::erase_if(left, [&](int r) { return std::find(place->rays.begin(), place->rays.end(), r) != place->rays.end(); });
      places.push_back(std::move(*place));
    }
    const double outside =
        places.empty() ? 1.0 : 1.0 - static_cast<double>(places[0].rays.size()) / static_cast<double>(rays.size());
    const bool moved = (places.size() > 1 && outside > kOutside) || (places.size() < 2 && rays.size() > 3 && outside > 0.5);
    if (moved) {
      state.points[p].reset();
      reasons.point[p] =
          fmt::format("moved between images: {} rays meet in {} places", rays.size(), std::max<std::size_t>(places.size(), 2));
      for (const int r : survey.rays_of_point[p]) state.active[static_cast<std::size_t>(r)] = 0;
    } else if (!places.empty() && !state.points[p]) {
      state.points[p] = places[0].point;
    }
  }
}

int reject_largest(const Survey& survey, const AdjustOptions& options, const Estimate& at, State& state) {
  const double limit = critical_value(options, at.redundancy) * at.sigma0();
  struct Suspect {
    int ray;
    double w;
  };
  std::vector<Suspect> suspects;
  for (int g = 0; g < at.rows.group_count(); ++g) {
    const int r = at.network.ray_of_group[static_cast<std::size_t>(g)];
    if (r < 0) continue;
    const double w = standardised(at.rows.residual(g), at.residual_cofactors()[static_cast<std::size_t>(g)]);
    if (w > limit) suspects.push_back({r, w});
  }
  std::stable_sort(suspects.begin(), suspects.end(), [](const Suspect& a, const Suspect& b) { return a.w > b.w; });
  std::vector<char> image_hit(survey.images.size(), 0);
  std::vector<char> point_hit(survey.ids.size(), 0);
  const int most = std::max(1, static_cast<int>(suspects.size()) / 3);
  int rejected = 0;
  for (const Suspect& suspect : suspects) {
    if (rejected == most) break;
    const Ray& ray = survey.rays[static_cast<std::size_t>(suspect.ray)];
    char& image = image_hit[static_cast<std::size_t>(ray.image)];
    char& point = point_hit[static_cast<std::size_t>(ray.point)];
    if (image || point) continue;
    image = point = 1;
    state.active[static_cast<std::size_t>(suspect.ray)] = 0;
    ++rejected;
  }
  return rejected;
}

int readmit(const Survey& survey, const AdjustOptions& options, const std::vector<double>& w, double sigma0, int redundancy,
            const Reasons& reasons, State& state) {
  const double limit = critical_value(options, redundancy) * sigma0;
  const auto agrees = [&](int r) {
    return w[static_cast<std::size_t>(r)] < limit && state.knows(survey.rays[static_cast<std::size_t>(r)]);
  };
  int count = 0;
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    const Ray& ray = survey.rays[r];
    if (state.active[r] || !agrees(static_cast<int>(r)) || !reasons.point[static_cast<std::size_t>(ray.point)].empty())
      continue;
    if (ray.twin) {
      int agreeing = 0;
      for (const int other : survey.rays_of_image[static_cast<std::size_t>(ray.image)]) {
        if (survey.rays[static_cast<std::size_t>(other)].point == ray.point && agrees(other)) ++agreeing;
      }
      if (agreeing != 1) continue;
    }
    state.active[r] = 1;
    ++count;
  }
  return count;
}

void explain(const Survey& survey, const State& state, double tolerance_px, Reasons& reasons) {
  constexpr double kDotWithoutSize_px = 5.0;
  for (std::size_t r = 0; r < survey.rays.size(); ++r) {
    const Ray& ray = survey.rays[r];
    if (state.active[r] || !reasons.ray[r].empty()) continue;
    const auto& of_image = reasons.image[static_cast<std::size_t>(ray.image)];
    const auto& of_point = reasons.point[static_cast<std::size_t>(ray.point)];
    if (!state.poses[static_cast<std::size_t>(ray.image)]) {
      reasons.ray[r] = of_image.empty() ? "image not oriented" : of_image;
      continue;
    }
    std::string at_place_of;
    for (std::size_t q = 0; q < survey.ids.size(); ++q) {
      if (static_cast<int>(q) == ray.point || !state.points[q]) continue;
      const auto pixel = project_into(survey, state, ray.image, *state.points[q]);
      if (pixel && (*pixel - ray.measured_px).norm() < std::max(tolerance_px, 0.5 * ray.size_px)) {
        at_place_of = fmt::format("at the place of id {}", survey.ids[q]);
      }
    }
    if (!state.points[static_cast<std::size_t>(ray.point)]) {
      reasons.ray[r] = !at_place_of.empty() ? "wrong id: image point lies " + at_place_of
                       : of_point.empty()   ? lonely(survey, state, ray.point)
                                            : of_point;
      continue;
    }
    const double distance = distance_px(survey, state, ray);
    const double dot = ray.size_px > 0.0 ? ray.size_px : kDotWithoutSize_px;
    if (!at_place_of.empty() || distance > dot) {
      reasons.ray[r] = fmt::format(
          "{}wrong id: image point lies {:.1f} px from where id {} is expected{}", ray.twin ? "duplicate id in image; " : "",
          distance, survey.ids[static_cast<std::size_t>(ray.point)], at_place_of.empty() ? "" : ", " + at_place_of);
    } else {
      reasons.ray[r] = ray.twin ? "duplicate id in image" : fmt::format("blunder: image point lies {:.2f} px off", distance);
    }
  }
}

}  // namespace crosstie::bundle::detail
