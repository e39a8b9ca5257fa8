#pragma once

#include <optional>
#include <span>
#include <string_view>

#include <Eigen/Core>

#include "base/result.h"

namespace crosstie::base {

/// Central lens models. The parameters are in mrcal's order: fx fy cx cy [px], then the distortion of OpenCV
/// (docs.opencv.org, calib3d): k1 k2 p1 p2 | k3 | k4 k5 k6 | s1 s2 s3 s4. With x = X/Z, y = Y/Z, r2 = x^2 + y^2:
///     radial = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
///     x' = x radial + 2 p1 x y + p2 (r2 + 2 x^2) + s1 r2 + s2 r2^2
///     y' = y radial + p1 (r2 + 2 y^2) + 2 p2 x y + s3 r2 + s4 r2^2
///     pixel = (fx x' + cx, fy y' + cy)
///
/// kAicon is the model of AICON 3D Studio's .ior files, balanced about r0, on the sensor in mm with y up:
///     xs = c X/Z, ys = -c Y/Z, r2 = xs^2 + ys^2
///     dr = A1 (r2 - r0^2) + A2 (r2^2 - r0^4) + A3 (r2^3 - r0^6)
///     x = xh + xs (1 + dr) + B1 (r2 + 2 xs^2) + 2 B2 xs ys + C1 xs + C2 ys
///     y = yh + ys (1 + dr) + B2 (r2 + 2 ys^2) + 2 B1 xs ys
///     pixel = ((columns - 1) / 2 + x columns / width, (rows - 1) / 2 - y rows / height)
/// with the parameters c xh yh [mm] A1 A2 A3 B1 B2 C1 C2, then the constants r0, width, height [mm], columns, rows [px].
enum class LensModel { kPinhole, kOpenCv4, kOpenCv5, kOpenCv8, kOpenCv12, kAicon };

inline constexpr int kMaxLensParameters = 16;

/// All parameters: for OpenCV's models 4 + the number of distortion parameters.
[[nodiscard]] int parameter_count(LensModel model);
/// The first of them that an adjustment may estimate; what follows are constants of the model (kAicon: r0 and the sensor).
[[nodiscard]] int adjustable_count(LensModel model);
/// mrcal's name: "LENSMODEL_PINHOLE", "LENSMODEL_OPENCV5", ...; "AICON" for kAicon, which mrcal does not have.
[[nodiscard]] std::string_view lens_model_name(LensModel model);
[[nodiscard]] std::optional<LensModel> lens_model_from_name(std::string_view name);
/// "fx", "fy", "cx", "cy", "k1", ... in the order of the parameters; for kAicon "c", "xh", "yh", "A1", ...
[[nodiscard]] std::span<const std::string_view> parameter_names(LensModel model);
/// "px", "mm", "1/mm^2", ... in the order of the parameters; "" for those without a unit.
[[nodiscard]] std::span<const std::string_view> parameter_units(LensModel model);

/// The bare projection, for the inner loops of adjustments: no domain beyond Z > 0 is checked.
/// `parameters` has parameter_count(model) values, `p_in_camera` three (mm), `pixel` receives two (px).
/// `d_point` (2x3) and `d_parameters` (2 x parameter_count) are row-major and may be null. Returns false where Z <= 0.
bool project_bare(LensModel model, const double* parameters, const double* p_in_camera, double* pixel, double* d_point,
                  double* d_parameters);

using ProjectionParameterJacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor, 2, kMaxLensParameters>;

/// The interior orientation of one camera: lens model, image size and parameters, with their covariance where it is known.
///
/// Pixels: (0, 0) is the centre of the first pixel. Camera frame: x right, y down, z forward, mm.
/// Valid domain: the rays around the optical axis up to the first radius at which the radial distortion stops growing (there
/// the model folds and is no longer invertible), or 89 degrees. Outside of it project and unproject refuse.
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

  LensModel model_ = LensModel::kPinhole;
  int width_px_ = 0;
  int height_px_ = 0;
  double valid_tangent_ = 0.0;
  Eigen::VectorXd parameters_;
  Eigen::MatrixXd covariance_;
};

}  // namespace crosstie::base
