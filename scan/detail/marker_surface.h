#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "scan/cloud.h"

namespace crosstie::scan::detail {

/// A cloud's points by the pixel of the left image that they belong to.
class PixelIndex {
 public:
  PixelIndex(const ScanCloud& scan, int width_px);

  [[nodiscard]] std::optional<std::size_t> at(int column, int row) const;
  [[nodiscard]] const std::vector<double>& sigma_mm() const { return *sigma_mm_; }

 private:
  std::size_t width_;
  std::vector<std::int32_t> points_;  ///< -1: none
  const std::vector<double>* sigma_mm_;
};

struct SurfaceSample {
  Eigen::Vector3d p_in_rig_mm;
  double sigma_mm = 0.0;  ///< along the viewing ray
};

/// A surface near a point.
struct SurfaceBeneath {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< where the point's foot is, towards the camera
  double height_mm = 0.0;                            ///< of the point over the surface along the normal
  double variance_mm2 =
      0.0;  ///< of the surface there, if the samples' noise is independent; larger where they scatter more than that
};

/// The second-order surface through samples round a point, by weighted least squares; samples beyond 4 sigmas belong to something else.
/// Nothing where fewer than 30 are left, or all of them stand to one side of the point (in fewer than 5 of 8 sectors).
std::optional<SurfaceBeneath> surface_beneath(const std::vector<SurfaceSample>& samples, const Eigen::Vector3d& p_in_rig_mm);

}  // namespace crosstie::scan::detail
