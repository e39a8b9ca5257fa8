// crosstie.fit()

#include <pybind11/stl.h>
#include <nlohmann/json.hpp>

#include "app/fit_result.h"
#include "python/arrays.h"
#include "python/call.h"
#include "python/module.h"
#include "python/values.h"

namespace crosstie::python {
namespace {

py::dict fit(const py::object& points, const std::string& shape, std::optional<double> sigma_mm, const py::object& cov_mm2,
             std::optional<double> radius_mm, double radius_sigma_mm, bool robust) {
  const std::vector<Eigen::Vector3d> points_mm = points_from(points, "points");
  std::vector<Eigen::Matrix3d> covariances;
  if (!cov_mm2.is_none()) covariances = covariances_from(cov_mm2, "cov_mm2");
  math::ShapeFitOptions options;
  options.sigma_mm = sigma_mm;
  options.cov_mm2 = covariances;
  if (radius_mm) options.radius = {*radius_mm, radius_sigma_mm};
  options.robust = robust;
  app::FittedShape fitted = call([&](const base::Progress&) { return app::fit_shape(shape, points_mm, options); });

  py::dict result = python_of(app::fit_json(fitted));
  std::vector<std::int64_t> rejected;
  for (const math::RejectedPoint& one : fitted.quality.rejected) rejected.push_back(static_cast<std::int64_t>(one.index));
  const auto residuals = static_cast<py::ssize_t>(fitted.quality.residuals_mm.size());
  const auto left_out = static_cast<py::ssize_t>(rejected.size());
  result["residuals_mm"] = array_of<double>(std::move(fitted.quality.residuals_mm), {residuals});
  result["rejected"] = array_of<std::int64_t>(std::move(rejected), {left_out});
  result["warnings"] = warnings_list(fitted.quality.warnings);
  return result;
}

}  // namespace

void add_fit(py::module_& module) {
  module.def(
      "fit", &fit, py::arg("points"), py::arg("shape"), py::kw_only(), py::arg("sigma_mm") = py::none(),
      py::arg("cov_mm2") = py::none(), py::arg("radius_mm") = py::none(), py::arg("radius_sigma_mm") = 0.0,
      py::arg("robust") = false,
      "Fits a shape to points by their orthogonal distances, without a guess.\n\n"
      "points           (N, 3) [mm], in any frame: the shape is in the same\n"
      "shape            line, plane, circle, sphere, cylinder or cone\n"
      "sigma_mm         of each coordinate; or\n"
      "cov_mm2          (N, 3, 3) of each point; neither: told by the residuals\n"
      "radius_mm        known radius: held, or with radius_sigma_mm an observation\n"
      "robust           find points that do not belong to the shape and leave them out\n\n"
      "Returns the keys of a result of `crosstie fit`: shape, point_mm (3,), direction (3,), diameter_mm, apex_angle_rad,\n"
      "distance_mm, sigmas of the same names, params with params_cov (P, P) along params_axes, rms_mm, form_mm, sigma0,\n"
      "redundancy, count; and residuals_mm (N,), rejected (indices of points), warnings.");
}

}  // namespace crosstie::python
