#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/lens_model.h"
#include "base/result.h"

namespace crosstie::base {

/// The bare projection, for the inner loops of adjustments: no domain beyond Z > 0 is checked.
/// `parameters` has parameter_count(model) values, `p_in_camera` three (mm), `pixel` receives two (px).
/// `d_point` (2x3) and `d_parameters` (2 x parameter_count) are row-major and may be null. Returns false where Z <= 0.
/// Splined models: all but 4 + 2 (order + 1)^2 columns of `d_parameters` are zero.
bool project_bare(LensModel model, const double* parameters, const double* p_in_camera, double* pixel, double* d_point,
                  double* d_parameters);

using ProjectionParameterJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor>;

/// The interior orientation of one camera: lens model, image size and parameters, with their covariance where it is known.
///
/// Pixels: (0, 0) is the centre of the first pixel. Camera frame: x right, y down, z forward, mm.
/// Valid domain: the rays around the optical axis up to the first radius at which the radial distortion stops growing (there
/// the model folds and is no longer invertible), or 89 degrees; of a splined model what its grid covers of them. Outside of it
/// project and unproject refuse.
///
/// Where the domain was calibrated is another matter: calibrated_at() tells it.
class Camera {
 public:
  /// An Error where counts differ, a value is not finite, a focal length is not positive or the size is not positive.
  static Result<Camera> make(LensModel model, int width_px, int height_px, Eigen::VectorXd parameters);
  /// A lens of OpenCV's models without distortion, of the given focal length and with its principal point in the image's centre.
  static Result<Camera> nominal(LensModel model, int width_px, int height_px, double focal_px);

  [[nodiscard]] LensModel model() const { return model_; }
  [[nodiscard]] int width_px() const { return width_px_; }
  [[nodiscard]] int height_px() const { return height_px_; }
  [[nodiscard]] const Eigen::VectorXd& parameters() const { return parameters_; }

  /// Focal lengths fx, fy and principal point [px], whatever the model calls them.
  [[nodiscard]] Eigen::Vector2d focal_px() const;
  [[nodiscard]] Eigen::Vector2d principal_point_px() const;

  /// Covariance of the parameters in their units squared; empty where unknown.
  [[nodiscard]] const Eigen::MatrixXd& covariance() const { return covariance_; }
  /// `covariance` is empty or square of parameter_count(model()); asserted.
  void set_covariance(Eigen::MatrixXd covariance);

  /// The polygon [px] inside of which observations stand behind the model (mrcal's valid_intrinsics_region); nothing where
  /// unknown, no corner where there is no such place. The last corner is joined to the first.
  using Region = std::vector<Eigen::Vector2d>;
  [[nodiscard]] const std::optional<Region>& valid_region_px() const { return valid_region_px_; }
  void set_valid_region(std::optional<Region> region_px) { valid_region_px_ = std::move(region_px); }
  /// Whether the pixel lies in the image and inside of the valid region, where that is known: elsewhere the model extrapolates.
  [[nodiscard]] bool calibrated_at(const Eigen::Vector2d& pixel) const;

  /// Largest tangent of the angle to the optical axis inside the valid domain.
  [[nodiscard]] double valid_tangent() const { return valid_tangent_; }

  /// The pixel of a point in mm; nothing where the point is not in front of the camera or outside the valid domain.
  /// The derivatives by the point (px/mm) and by the parameters (2 x parameter_count) are filled where asked for.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& p_in_camera,
                                                       Eigen::Matrix<double, 2, 3>* d_point = nullptr,
                                                       ProjectionParameterJacobian* d_parameters = nullptr) const;

  /// The direction, of unit length, that projects to `pixel`: Newton's method on the distortion with the residual checked to
  /// 1e-9 px. Nothing where no such ray lies inside the valid domain. The pixel may lie outside of the image.
  [[nodiscard]] std::optional<Eigen::Vector3d> unproject(const Eigen::Vector2d& pixel) const;

 private:
  Camera() = default;
  /// Whether a direction (X/Z, Y/Z) lies in the valid domain.
  [[nodiscard]] bool in_domain(const Eigen::Vector2d& tangent) const;

  LensModel model_;
  int width_px_ = 0;
  int height_px_ = 0;
  double valid_tangent_ = 0.0;
  Eigen::Vector2d half_extent_ = Eigen::Vector2d::Zero();  ///< of a splined model's grid, see detail/spline.h
  Eigen::VectorXd parameters_;
  Eigen::MatrixXd covariance_;
  std::optional<Region> valid_region_px_;
};

}  // namespace crosstie::base
