#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/camera.h"
#include "base/machine.h"

namespace crosstie::edge::detail {

/// One camera's depths by pixel, with the rays of its pixels.
class CameraView {
 public:
  CameraView(const base::Camera& camera, std::vector<float> depth_mm, std::vector<float> sigma_mm);

  [[nodiscard]] int width() const { return camera_->width_px(); }
  [[nodiscard]] int height() const { return camera_->height_px(); }
  [[nodiscard]] const base::Camera& camera() const { return *camera_; }
  [[nodiscard]] std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width()) + static_cast<std::size_t>(x);
  }
  [[nodiscard]] float depth(std::size_t at) const { return depth_mm_[at]; }
  [[nodiscard]] float sigma(std::size_t at) const { return sigma_mm_[at]; }
  /// X/Z, Y/Z of a pixel's ray; computed once. Not a number outside of the lens model's domain.
  [[nodiscard]] Eigen::Vector2f tangent(int x, int y);
  /// Of points that lie beside the rays of their pixels.
  void set_tangents(std::vector<Eigen::Vector2f> tangents);

 private:
  const base::Camera* camera_;
  std::vector<float> depth_mm_;
  std::vector<float> sigma_mm_;
  std::vector<Eigen::Vector2f> tangents_;
  std::vector<char> known_;
};

/// The right camera's view of the left one's depths: of each pixel the nearest point that falls there. Only left pixels in
/// [u0, u1] x [v0, v1] are carried over.
CameraView right_view(const base::Head& head, const std::vector<float>& depth_mm, const std::vector<float>& sigma_mm,
                      const std::array<double, 4>& roi_px);

/// A surface near an edge in a camera's frame, as inverse depth over the image: 1/z = a + b X/Z + c Y/Z + d q^2 + e q s + f s^2, exact for a
/// plane; q and s are the distances across and along the edge [px]. The curvatures are always estimated: left out where noise hides them, they would
/// move the surface at the edge by more than its sigma.
struct LocalSurface {
  Eigen::Vector3d plane = Eigen::Vector3d::Zero();  ///< b, c, a: 1 = plane . (X, Y, Z), across the normal
  Eigen::Matrix3d plane_cov = Eigen::Matrix3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();                         ///< unit, towards the camera
  double inverse_depth = 0.0;                                               ///< at the edge [1/mm]
  double sigma = 0.0;                                                       ///< of it
  double rms_mm = 0.0;                                                      ///< of the depths about the surface
  Eigen::Matrix<double, 6, 1> terms = Eigen::Matrix<double, 6, 1>::Zero();  ///< a, b, c, d, e, f
  Eigen::Matrix<double, 6, 6> terms_cov = Eigen::Matrix<double, 6, 6>::Zero();
  int count = 0;
  double piece_px = 0.0;   ///< along the edge: heights of edges as far from each other hardly share depths
  double extent_px = 0.0;  ///< of the depths, along the edge
};

/// The slopes of a surface at an edge: of its height over a plane through it, a full quadric in the plane's coordinates. Over a wide strip a curved
/// wall is that, and its inverse depth over the image is not.
struct LocalSlope {
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();  ///< along the plane's two axes
  Eigen::Matrix2d cov = Eigen::Matrix2d::Zero();
  double extent_px = 0.0;  ///< of the depths, along the edge
};

/// Whether a surface goes on beyond its edge: most of the pixels in a strip there, from `beyond_px` on, have depths that continue it. Behind paint it does;
/// where a face ends, depths are missing or lie on what follows: a chamfer, a wall, the background.
bool goes_on(CameraView& view, const LocalSurface& surface, const Eigen::Vector2d& at_px, const Eigen::Vector2d& out,
             double beyond_px);

/// The surface on the material side (against `out`) of an edge at `at_px`; nothing where too few depths lie there. Robust: Tukey's weights.
std::optional<LocalSurface> surface_before(CameraView& view, const Eigen::Vector2d& at_px, const Eigen::Vector2d& out,
                                           double guard_px, double reach_px);

/// The same depths over the plane of the first two columns of `axes` through `origin_mm`, the third being its normal, in the camera's frame.
std::optional<LocalSlope> slope_before(CameraView& view, const Eigen::Vector2d& at_px, const Eigen::Vector2d& out,
                                       double guard_px, double reach_px, const Eigen::Vector3d& origin_mm,
                                       const Eigen::Matrix3d& axes);

}  // namespace crosstie::edge::detail
