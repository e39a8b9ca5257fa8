#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json_fwd.hpp>

#include "base/result.h"
#include "math/shape_fit.h"

namespace crosstie::app {

/// A fit of any shape, in the words of the results.
struct FittedShape {
  std::string shape;  ///< "line", "plane", "circle", "sphere", "cylinder", "cone"
  Eigen::Vector3d point_mm = Eigen::Vector3d::Zero();
  std::optional<Eigen::Vector3d> direction;
  std::optional<double> radius_mm;
  std::optional<math::Cone> cone;
  std::size_t points = 0;  ///< in the file
  math::ShapeQuality quality;
};

/// One line of the table for people: a value with its standard deviation (nothing: it has none).
struct FitFigure {
  std::string name;
  std::string unit;
  double value = 0.0;
  std::optional<double> sigma;
  double shown_sigma = 0.0;  ///< whose digits are shown: the largest of the components of a vector
};

/// The shapes that fit_shape() knows.
[[nodiscard]] std::vector<std::string> shape_names();

/// kUsage for a shape that there is not.
base::Result<FittedShape> fit_shape(const std::string& shape, std::span<const Eigen::Vector3d> points_mm,
                                    const math::ShapeFitOptions& options);

[[nodiscard]] std::vector<FitFigure> figures_of(const FittedShape& fit);

/// The body of the result (docs/formats.md).
[[nodiscard]] nlohmann::ordered_json fit_json(const FittedShape& fit);

}  // namespace crosstie::app
