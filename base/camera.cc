#include "base/camera.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <string>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "base/detail/distortion.h"
#include "base/detail/lens.h"
#include "base/detail/spline.h"

namespace crosstie::base {
namespace {

using detail::Distorted;
using detail::Lens;

constexpr double kMaxTangent = 57.289961630759424;  // of 89 degrees
constexpr double kUnprojectTolerancePx = 1e-9;

/// What a parameter must be like; the reason why it is not.
std::string_view fault_of(LensModel model, int index, double value) {
  if (!std::isfinite(value)) return "is not finite";
  const bool positive = model == LensModel::kAicon ? index == 0 || index > 10 : index < 2;
  return positive && !(value > 0.0) ? "is not positive" : "";
}

/// The tangent of the angle to the axis at which the stereographic radius is |u|.
double tangent_of_stereographic(double u) {
  const double half = 0.5 * u;  // tan(angle / 2)
  return half * half < 1.0 ? std::min(u / (1.0 - half * half), kMaxTangent) : kMaxTangent;
}

/// (x', y') of any lens at a direction (X/Z, Y/Z), as detail::distort.
Distorted distorted(LensModel model, const Eigen::VectorXd& parameters, const Lens& lens, const Eigen::Vector2d& tangent) {
  if (!model.is_splined()) return detail::distort(lens.distortion, tangent.x(), tangent.y());
  const Eigen::Vector3d p(tangent.x(), tangent.y(), 1.0);
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  detail::project_splined(model, parameters.data(), p.data(), pixel.data(), by_point.data(), nullptr);
  return {(pixel.x() - lens.cx) / lens.fx, (pixel.y() - lens.cy) / lens.fy, by_point(0, 0) / lens.fx,
          by_point(0, 1) / lens.fx,        by_point(1, 0) / lens.fy,        by_point(1, 1) / lens.fy};
}

}  // namespace

bool project_bare(LensModel model, const double* parameters, const double* p_in_camera, double* pixel, double* d_point,
                  double* d_parameters) {
  if (model.is_splined()) return detail::project_splined(model, parameters, p_in_camera, pixel, d_point, d_parameters);
  const double z = p_in_camera[2];
  if (!(z > 0.0)) return false;
  const double inverse_z = 1.0 / z;
  const double x = p_in_camera[0] * inverse_z;
  const double y = p_in_camera[1] * inverse_z;
  const Lens lens = detail::lens_of(model, parameters);

  double by_x[detail::kMaxDistortion];
  double by_y[detail::kMaxDistortion];
  const bool by_parameters = d_parameters != nullptr;
  const Distorted image =
      detail::distort(lens.distortion, x, y, by_parameters ? by_x : nullptr, by_parameters ? by_y : nullptr);
  pixel[0] = lens.fx * image.x + lens.cx;
  pixel[1] = lens.fy * image.y + lens.cy;

  if (d_point != nullptr) {
    d_point[0] = lens.fx * image.dx_dx * inverse_z;
    d_point[1] = lens.fx * image.dx_dy * inverse_z;
    d_point[2] = -(d_point[0] * x + d_point[1] * y);
    d_point[3] = lens.fy * image.dy_dx * inverse_z;
    d_point[4] = lens.fy * image.dy_dy * inverse_z;
    d_point[5] = -(d_point[3] * x + d_point[4] * y);
  }
  if (by_parameters) {
    double u[detail::kLensTerms] = {image.x, 0.0, 1.0, 0.0};
    double v[detail::kLensTerms] = {0.0, image.y, 0.0, 1.0};
    for (int i = 0; i < detail::kMaxDistortion; ++i) {
      u[4 + i] = lens.fx * by_x[i];
      v[4 + i] = lens.fy * by_y[i];
    }
    if (model == LensModel::kAicon) {
      detail::aicon_derivatives(parameters, u, v, d_parameters);
    } else {
      const int count = parameter_count(model);
      std::copy_n(u, count, d_parameters);
      std::copy_n(v, count, d_parameters + count);
    }
  }
  return true;
}

Result<Camera> Camera::make(LensModel model, int width_px, int height_px, Eigen::VectorXd parameters) {
  if (width_px <= 0 || height_px <= 0) {
    return fail(ErrorCode::kBadInput, fmt::format("a camera's image size of {} x {} px is not positive", width_px, height_px));
  }
  if (parameters.size() != parameter_count(model)) {
    return fail(ErrorCode::kBadInput, fmt::format("{} has {} parameters, {} were given", lens_model_name(model),
                                                  parameter_count(model), parameters.size()));
  }
  for (int i = 0; i < parameters.size(); ++i) {
    const std::string_view fault = fault_of(model, i, parameters[i]);
    if (fault.empty()) continue;
    return fail(ErrorCode::kBadInput, fmt::format("lens parameter {} = {} {}",
                                                  parameter_names(model)[static_cast<std::size_t>(i)], parameters[i], fault));
  }
  if (model == LensModel::kAicon && (parameters[13] != width_px || parameters[14] != height_px)) {
    return fail(ErrorCode::kBadInput, fmt::format("a sensor of {} x {} px does not belong to images of {} x {} px",
                                                  parameters[13], parameters[14], width_px, height_px));
  }
  Camera camera;
  camera.model_ = model;
  camera.width_px_ = width_px;
  camera.height_px_ = height_px;
  if (model.is_splined()) {
    camera.half_extent_ = detail::half_extent(model.grid());
    camera.valid_tangent_ = tangent_of_stereographic(camera.half_extent_.norm());
  } else {
    camera.valid_tangent_ = detail::first_fold(detail::lens_of(model, parameters.data()).distortion, kMaxTangent);
  }
  camera.parameters_ = std::move(parameters);
  return camera;
}

Result<Camera> Camera::nominal(LensModel model, int width_px, int height_px, double focal_px) {
  assert(model != LensModel::kAicon);
  Eigen::VectorXd parameters = Eigen::VectorXd::Zero(parameter_count(model));
  parameters.head<4>() << focal_px, focal_px, 0.5 * (width_px - 1), 0.5 * (height_px - 1);
  return make(model, width_px, height_px, std::move(parameters));
}

Eigen::Vector2d Camera::focal_px() const {
  const Lens lens = detail::lens_of(model_, parameters_.data());
  return {lens.fx, lens.fy};
}

Eigen::Vector2d Camera::principal_point_px() const {
  const Lens lens = detail::lens_of(model_, parameters_.data());
  return {lens.cx, lens.cy};
}

void Camera::set_covariance(Eigen::MatrixXd covariance) {
  assert(covariance.size() == 0 || (covariance.rows() == parameters_.size() && covariance.cols() == parameters_.size()));
  covariance_ = std::move(covariance);
}

bool Camera::calibrated_at(const Eigen::Vector2d& pixel) const {
  if (!(pixel.minCoeff() >= -0.5 && pixel.x() <= width_px_ - 0.5 && pixel.y() <= height_px_ - 0.5)) return false;
  if (!valid_region_px_) return true;
  // Even-odd rule: a ray to the right crosses the outline an odd number of times.
  const Region& region = *valid_region_px_;
  bool inside = false;
  for (std::size_t i = 0; i < region.size(); ++i) {
    const Eigen::Vector2d& a = region[i];
    const Eigen::Vector2d& b = region[(i + 1) % region.size()];
    if ((a.y() > pixel.y()) == (b.y() > pixel.y())) continue;
    if (pixel.x() < a.x() + (b.x() - a.x()) * (pixel.y() - a.y()) / (b.y() - a.y())) inside = !inside;
  }
  return inside;
}

bool Camera::in_domain(const Eigen::Vector2d& tangent) const {
  const double square = tangent.squaredNorm();
  if (!(square < valid_tangent_ * valid_tangent_)) return false;
  if (!model_.is_splined()) return true;
  const Eigen::Vector2d u = tangent * (2.0 / (1.0 + std::sqrt(1.0 + square)));
  return std::abs(u.x()) < half_extent_.x() && std::abs(u.y()) < half_extent_.y();
}

std::optional<Eigen::Vector2d> Camera::project(const Eigen::Vector3d& p_in_camera, Eigen::Matrix<double, 2, 3>* d_point,
                                               ProjectionParameterJacobian* d_parameters) const {
  const double z = p_in_camera.z();
  if (!(z > 0.0) || !in_domain(p_in_camera.head<2>() / z)) return std::nullopt;
  if (d_parameters != nullptr) d_parameters->resize(2, parameters_.size());
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  project_bare(model_, parameters_.data(), p_in_camera.data(), pixel.data(), by_point.data(),
               d_parameters != nullptr ? d_parameters->data() : nullptr);
  // Tangential and prism terms can fold the image, too.
  if (!pixel.allFinite() || !(by_point.leftCols<2>().determinant() > 0.0)) return std::nullopt;
  if (d_point != nullptr) *d_point = by_point;
  return pixel;
}

std::optional<Eigen::Vector3d> Camera::unproject(const Eigen::Vector2d& pixel) const {
  if (!pixel.allFinite()) return std::nullopt;
  const Lens lens = detail::lens_of(model_, parameters_.data());
  const Eigen::Array2d focal(lens.fx, lens.fy);
  const Eigen::Vector2d target = (pixel.array() - Eigen::Array2d(lens.cx, lens.cy)) / focal;
  const auto image_of = [&](const Eigen::Vector2d& p) { return distorted(model_, parameters_, lens, p); };

  // Start on the same azimuth at the radius that the radial terms alone, or the spline's stereographic part, give.
  Eigen::Vector2d p = target;
  if (model_.is_splined()) {
    p = p.cwiseMax(-0.999 * half_extent_).cwiseMin(0.999 * half_extent_);
    if (const double u = p.norm(); u > 0.0) p *= (1.0 - 1e-6) * tangent_of_stereographic(u) / u;
  } else if (const double radius = target.norm(); radius > 0.0) {
    p *= detail::undistorted_radius(lens.distortion, radius, (1.0 - 1e-6) * valid_tangent_) / radius;
  }
  Distorted image = image_of(p);
  Eigen::Vector2d residual = Eigen::Vector2d(image.x, image.y) - target;
  for (int iteration = 0; iteration < 100; ++iteration) {
    const double determinant = image.determinant();
    if (!(determinant > 0.0)) return std::nullopt;
    const Eigen::Vector2d step(-(image.dy_dy * residual.x() - image.dx_dy * residual.y()) / determinant,
                               -(image.dx_dx * residual.y() - image.dy_dx * residual.x()) / determinant);
    bool improved = false;
    for (double length = 1.0; length > 1e-6 && !improved; length *= 0.5) {
      const Eigen::Vector2d next = p + length * step;
      if (!in_domain(next)) continue;
      const Distorted next_image = image_of(next);
      const Eigen::Vector2d next_residual = Eigen::Vector2d(next_image.x, next_image.y) - target;
      if (next_image.determinant() > 0.0 && next_residual.norm() < residual.norm()) {
        p = next;
        image = next_image;
        residual = next_residual;
        improved = true;
      }
    }
    if (!improved) break;  // at rounding, or at the edge of the domain: the residual tells which
  }
  if (!((residual.array() * focal).matrix().norm() <= kUnprojectTolerancePx)) return std::nullopt;
  return Eigen::Vector3d(p.x(), p.y(), 1.0).normalized();
}

}  // namespace crosstie::base
