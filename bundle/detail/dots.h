#pragma once

#include <algorithm>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "base/network.h"
#include "bundle/detail/survey.h"
#include "bundle/detail/views.h"
#include "bundle/detail/weights.h"

namespace crosstie::bundle::detail {

/// A dot in an oriented image: one that may be the image of an uncoded target, or one with an id, which bars others from its
/// place.
struct Dot {
  int image = 0;
  bool has_id = false;  ///< a coded marker, read or refused
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d detector_cov_px2 = Eigen::Matrix2d::Zero();  ///< made usable
  /// Of the distance of the centre from the prediction of a known point: the detector's, the model's part, that of the
  /// orientation, and the eccentricity, whose amount the ellipse tells (see collect_dots) and whose sign it does not.
  Eigen::Matrix2d cov_px2 = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d shape_px2 = Eigen::Matrix2d::Zero();  ///< as Ray::shape_px2
  double size_px = 0.0;                                 ///< semi-major axis, 0 where unknown
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< of its ray in network, unit length
};

/// All dots of the oriented images, by image, then y, x: uncoded ones and rings that could not be read (their dots are as good as
/// any) may be matched; coded and refused ones have an id.
///
/// A circle of semi-major axis a and semi-minor axis b px in an image of focal length f px is tilted by t with cos t = b / a,
/// and its centre lies a^2 / f sin t cos t from the ellipse's, along the minor axis, to first order.
std::vector<Dot> collect_dots(const base::Network& network, const Survey& survey, const Weights& weights,
                              const std::vector<std::optional<View>>& views);

/// The dots of one image by their place.
class DotGrid {
 public:
  /// `dots` are all of the network; those of `image` are taken.
  DotGrid(const std::vector<Dot>& dots, int image, int width_px, int height_px);

  /// Calls visit(index into dots) for all dots whose cells meet the box, and maybe some beside it.
  template <typename Visit>
  void in_box(const Eigen::Vector2d& low, const Eigen::Vector2d& high, Visit visit) const {
    if (columns_ == 0 || high.x() < 0.0 || high.y() < 0.0) return;
    const int first_column = column(low.x());
    const int last_column = column(high.x());
    const int last_row = row(high.y());
    for (int r = row(low.y()); r <= last_row; ++r) {
      const auto begin = static_cast<std::size_t>(r * columns_ + first_column);
      const auto end = static_cast<std::size_t>(r * columns_ + last_column) + 1;
      for (int k = starts_[begin]; k < starts_[end]; ++k) visit(members_[static_cast<std::size_t>(k)]);
    }
  }

  /// The largest sigma of its dots [px].
  [[nodiscard]] double largest_sigma_px() const { return largest_sigma_px_; }
  /// The largest semi-major axis of its dots [px].
  [[nodiscard]] double largest_size_px() const { return largest_size_px_; }

 private:
  [[nodiscard]] int column(double x) const { return std::clamp(static_cast<int>(x / cell_px_), 0, columns_ - 1); }
  [[nodiscard]] int row(double y) const { return std::clamp(static_cast<int>(y / cell_px_), 0, rows_ - 1); }

  double cell_px_ = 1.0;
  int columns_ = 0;
  int rows_ = 0;
  double largest_sigma_px_ = 0.0;
  double largest_size_px_ = 0.0;
  std::vector<int> starts_;   ///< of each cell in members_, and the end
  std::vector<int> members_;  ///< by cell
};

}  // namespace crosstie::bundle::detail
