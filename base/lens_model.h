#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"

namespace crosstie::base {

/// The grid of control points of a splined lens model, in mrcal's terms.
struct SplineGrid {
  int order = 3;    ///< of the polynomials: 2 or 3
  int columns = 0;  ///< Nx
  int rows = 0;     ///< Ny
  int fov_x_degrees =
      0;  ///< horizontal field of view that the grid covers; the vertical one follows, since the knots are square

  friend constexpr bool operator==(const SplineGrid&, const SplineGrid&) = default;
};

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
///
/// Splined stereographic models are mrcal's (mrcal.secretsauce.net, "Splined stereographic lens model"), computed by libmrcal:
///     u = 2 (X, Y) / (|p| + Z),   pixel = (fx (u_x + d_x(u)) + cx, fy (u_y + d_y(u)) + cy)
/// with d a B-spline over u of the grid's order. Its control points follow fx fy cx cy in pairs, row by row of the grid.
///
/// A value of 12 bytes. It converts to its Kind, so that `switch (model)` reads as with an enumeration.
class LensModel {
 public:
  enum class Kind : std::uint8_t { kPinhole, kOpenCv4, kOpenCv5, kOpenCv8, kOpenCv12, kAicon, kSplined };

  static const LensModel kPinhole;
  static const LensModel kOpenCv4;
  static const LensModel kOpenCv5;
  static const LensModel kOpenCv8;
  static const LensModel kOpenCv12;
  static const LensModel kAicon;
  /// Errors (kBadInput): an order other than 2 or 3, fewer than order + 1 or more than kMaxControlPoints control points, a field of
  /// view outside of 1..350 degrees.
  static Result<LensModel> splined(const SplineGrid& grid);
  static constexpr int kMaxControlPoints = 4096;

  constexpr LensModel() = default;
  constexpr operator Kind() const { return kind_; }  // NOLINT(google-explicit-constructor): for switch
  [[nodiscard]] constexpr bool is_splined() const { return kind_ == Kind::kSplined; }
  /// Of a splined model; zeros otherwise.
  [[nodiscard]] constexpr SplineGrid grid() const { return {order_, columns_, rows_, fov_x_degrees_}; }

  friend constexpr bool operator==(const LensModel&, const LensModel&) = default;

 private:
  constexpr explicit LensModel(Kind kind) : kind_(kind) {}

  Kind kind_ = Kind::kPinhole;
  std::uint8_t order_ = 0;
  std::uint16_t columns_ = 0;
  std::uint16_t rows_ = 0;
  std::uint16_t fov_x_degrees_ = 0;
};

inline constexpr LensModel LensModel::kPinhole{Kind::kPinhole};
inline constexpr LensModel LensModel::kOpenCv4{Kind::kOpenCv4};
inline constexpr LensModel LensModel::kOpenCv5{Kind::kOpenCv5};
inline constexpr LensModel LensModel::kOpenCv8{Kind::kOpenCv8};
inline constexpr LensModel LensModel::kOpenCv12{Kind::kOpenCv12};
inline constexpr LensModel LensModel::kAicon{Kind::kAicon};

/// All parameters: for OpenCV's models 4 + the number of distortion parameters, for splined ones 4 + two for each control point.
[[nodiscard]] int parameter_count(LensModel model);
/// The first of them that an adjustment may estimate; what follows are constants of the model (kAicon: r0 and the sensor).
[[nodiscard]] int adjustable_count(LensModel model);
/// mrcal's name: "LENSMODEL_PINHOLE", "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=30_Ny=20_fov_x_deg=70", ...; "AICON" for kAicon,
/// which mrcal does not have.
[[nodiscard]] std::string lens_model_name(LensModel model);
[[nodiscard]] std::optional<LensModel> lens_model_from_name(std::string_view name);
/// "fx", "fy", "cx", "cy", "k1", ... in the order of the parameters; for kAicon "c", "xh", "yh", "A1", ...; for splined models
/// "u0", "v0", "u1", ... after the first four: the control points counted row by row.
[[nodiscard]] std::span<const std::string_view> parameter_names(LensModel model);
/// "px", "mm", "1/mm^2", ... in the order of the parameters; "" for those without a unit.
[[nodiscard]] std::span<const std::string_view> parameter_units(LensModel model);

}  // namespace crosstie::base
