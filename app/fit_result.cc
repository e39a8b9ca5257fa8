#include "app/fit_result.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;
using nlohmann::ordered_json;

/// The seven parameters of math::ShapeCovariance with their units.
constexpr std::array<const char*, 7> kParameters = {"u_mm", "v_mm", "w_mm", "a_rad", "b_rad", "size_mm", "half_angle_rad"};

ordered_json vector_json(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

ordered_json sigmas_json(const Eigen::Matrix3d& covariance) { return vector_json(covariance.diagonal().cwiseSqrt()); }

/// The estimated parameters: those with a variance; where none is known, all that may be zero are left out alike.
std::vector<int> estimated(const math::ShapeCovariance& covariance) {
  std::vector<int> parameters;
  for (int i = 0; i < 7; ++i) {
    if (covariance(i, i) != 0.0) parameters.push_back(i);
  }
  return parameters;
}

/// What a shape has of place, direction and size, under the names that its kind gives them.
template <typename Shape>
void describe(const Shape& shape, FittedShape& to) {
  if constexpr (requires { shape.centre_mm; }) {
    to.point_mm = shape.centre_mm;
  } else {
    to.point_mm = shape.point_mm;
  }
  if constexpr (requires { shape.normal; }) to.direction = shape.normal;
  if constexpr (requires { shape.direction; }) to.direction = shape.direction;
  if constexpr (requires { shape.radius_mm; }) to.radius_mm = shape.radius_mm;
  if constexpr (std::is_same_v<Shape, math::Cone>) to.cone = shape;
}

using Points = std::span<const Eigen::Vector3d>;

/// One of the fits of math/shape_fit.h, described.
template <auto kFit>
Result<FittedShape> described(Points points, const math::ShapeFitOptions& options) {
  auto fit = kFit(points, options);
  if (!fit) return base::fail(std::move(fit));
  FittedShape result;
  result.quality = std::move(fit->quality);
  describe(fit->shape, result);
  return result;
}

struct NamedFit {
  const char* shape;
  Result<FittedShape> (*fit)(Points, const math::ShapeFitOptions&);
};
constexpr std::array<NamedFit, 6> kFits = {{{"line", described<math::fit_line>},
                                            {"plane", described<math::fit_plane>},
                                            {"circle", described<math::fit_circle>},
                                            {"sphere", described<math::fit_sphere>},
                                            {"cylinder", described<math::fit_cylinder>},
                                            {"cone", described<math::fit_cone>}}};

}  // namespace

std::vector<std::string> shape_names() {
  std::vector<std::string> names;
  for (const NamedFit& one : kFits) names.emplace_back(one.shape);
  return names;
}

Result<FittedShape> fit_shape(const std::string& shape, std::span<const Eigen::Vector3d> points_mm,
                              const math::ShapeFitOptions& options) {
  const auto named = std::find_if(kFits.begin(), kFits.end(), [&](const NamedFit& one) { return shape == one.shape; });
  if (named == kFits.end()) {
    return base::fail(ErrorCode::kUsage,
                      fmt::format("the shape is line, plane, circle, sphere, cylinder or cone, not '{}'", shape));
  }
  auto fit = named->fit(points_mm, options);
  if (!fit) return fit;
  fit->shape = shape;
  fit->points = points_mm.size();
  return fit;
}

std::vector<FitFigure> figures_of(const FittedShape& fit) {
  std::vector<FitFigure> figures;
  const auto add = [&](const std::string& name, const char* unit, const Eigen::Vector3d& value, const Eigen::Matrix3d& cov) {
    const Eigen::Vector3d sigma = cov.diagonal().cwiseSqrt();
    for (int i = 0; i < 3; ++i) {
      figures.push_back({fmt::format("{} {}", name, "xyz"[i]), unit, value(i), sigma(i), sigma.maxCoeff()});
    }
  };
  const auto add_one = [&](const char* name, const char* unit, double value, double sigma) {
    figures.push_back({name, unit, value, sigma, sigma});
  };
  const bool has_centre = fit.shape == "circle" || fit.shape == "sphere";
  add(has_centre ? "centre" : "point", "mm", fit.point_mm, fit.quality.point_cov_mm2());
  if (fit.direction) add(fit.shape == "plane" ? "normal" : "direction", "", *fit.direction, fit.quality.direction_cov_rad2());
  if (fit.radius_mm) add_one("diameter", "mm", 2.0 * *fit.radius_mm, 2.0 * fit.quality.size_sigma_mm());
  if (fit.cone) {
    add_one("distance", "mm", fit.cone->distance_mm, fit.quality.size_sigma_mm());
    add_one("apex angle", "rad", 2.0 * fit.cone->half_angle_rad, 2.0 * fit.quality.half_angle_sigma_rad());
  }
  figures.push_back({"rms", "mm", fit.quality.rms_mm, std::nullopt, 0.0});
  figures.push_back({"form", "mm", fit.quality.form_mm, std::nullopt, 0.0});
  return figures;
}

ordered_json fit_json(const FittedShape& fit) {
  const math::ShapeQuality& quality = fit.quality;
  ordered_json json;
  json["shape"] = fit.shape;
  json["point_mm"] = vector_json(fit.point_mm);
  json["direction"] = fit.direction ? vector_json(*fit.direction) : ordered_json();
  json["diameter_mm"] = fit.radius_mm ? ordered_json(2.0 * *fit.radius_mm) : ordered_json();
  json["apex_angle_rad"] = fit.cone ? ordered_json(2.0 * fit.cone->half_angle_rad) : ordered_json();
  json["distance_mm"] = fit.cone ? ordered_json(fit.cone->distance_mm) : ordered_json();
  ordered_json& sigmas = json["sigmas"];
  sigmas["point_mm"] = sigmas_json(quality.point_cov_mm2());
  sigmas["direction"] = fit.direction ? sigmas_json(quality.direction_cov_rad2()) : ordered_json();
  sigmas["diameter_mm"] = fit.radius_mm ? ordered_json(2.0 * quality.size_sigma_mm()) : ordered_json();
  sigmas["apex_angle_rad"] = fit.cone ? ordered_json(2.0 * quality.half_angle_sigma_rad()) : ordered_json();
  sigmas["distance_mm"] = fit.cone ? ordered_json(quality.size_sigma_mm()) : ordered_json();
  const std::vector<int> parameters = estimated(quality.covariance);
  json["params"] = ordered_json::array();
  json["params_cov"] = ordered_json::array();
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    json["params"].push_back(kParameters[static_cast<std::size_t>(parameters[i])]);
    for (std::size_t j = i; j < parameters.size(); ++j) {
      json["params_cov"].push_back(quality.covariance(parameters[i], parameters[j]));
    }
  }
  json["params_axes"] = ordered_json::array();
  for (int i = 0; i < 3; ++i) json["params_axes"].push_back(vector_json(quality.frame.col(i)));
  json["rms_mm"] = quality.rms_mm;
  json["form_mm"] = quality.form_mm;
  json["sigma0"] = quality.sigma0;
  json["redundancy"] = quality.redundancy;
  json["points"] = fit.points;
  json["count"] = quality.count;
  std::size_t strays = 0;
  for (const math::RejectedPoint& one : quality.rejected) {
    strays += one.reason == math::RejectedPointReason::kNoConsensus ? 1U : 0U;
  }
  json["rejected"] = {
      {"count", quality.rejected.size()}, {"no_consensus", strays}, {"residual", quality.rejected.size() - strays}};
  return json;
}

}  // namespace crosstie::app
