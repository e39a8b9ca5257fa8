#include "base/detail/spline.h"

#include <cmath>
#include <cstdint>
#include <numbers>

extern "C" {
#include <mrcal/mrcal.h>
}

namespace crosstie::base::detail {

// What libmrcal was compiled with, as C; empty structures are one byte longer in C++.
static_assert(sizeof(mrcal_lensmodel_t) == 16 && sizeof(mrcal_point3_t) == 24 && sizeof(mrcal_point2_t) == 16);

bool project_splined(LensModel model, const double* parameters, const double* p_in_camera, double* pixel, double* d_point,
                     double* d_parameters) {
  if (!(p_in_camera[2] > 0.0)) return false;
  const SplineGrid grid = model.grid();
  mrcal_lensmodel_t lens{};
  lens.type = MRCAL_LENSMODEL_SPLINED_STEREOGRAPHIC;
  lens.LENSMODEL_SPLINED_STEREOGRAPHIC__config = {
      static_cast<std::uint16_t>(grid.order), static_cast<std::uint16_t>(grid.columns), static_cast<std::uint16_t>(grid.rows),
      static_cast<std::uint16_t>(grid.fov_x_degrees)};
  mrcal_point3_t p{};
  mrcal_point2_t q{};
  mrcal_point3_t dq_dp[2] = {};
  for (int i = 0; i < 3; ++i) p.xyz[i] = p_in_camera[i];
  const bool with_gradients = d_point != nullptr || d_parameters != nullptr;
  if (!mrcal_project(&q, with_gradients ? dq_dp : nullptr, d_parameters, &p, 1, &lens, parameters)) return false;
  pixel[0] = q.x;
  pixel[1] = q.y;
  if (d_point != nullptr) {
    for (int i = 0; i < 6; ++i) d_point[i] = dq_dp[i / 3].xyz[i % 3];
  }
  return true;
}

Eigen::Vector2d half_extent(const SplineGrid& grid) {
  const int beyond = grid.order;  // knots that are not at the corner of a covered cell: half an interval at either end, or one
  const double half_width = 2.0 * std::tan(grid.fov_x_degrees * std::numbers::pi / 720.0);
  return {half_width, half_width * (grid.rows - beyond) / (grid.columns - beyond)};
}

}  // namespace crosstie::base::detail
