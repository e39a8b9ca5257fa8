#pragma once

#include <vector>

#include <Eigen/Core>

#include "base/edge_curve.h"
#include "edge/nominal_fit.h"

namespace crosstie::edge::detail {

/// The correction at a place of the nominal.
struct Smoothed {
  Eigen::Vector2d uv_mm = Eigen::Vector2d::Zero();
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();  ///< its change per mm of arc
  Eigen::Vector2d variance_mm2 = Eigen::Vector2d::Zero();
  Eigen::Vector2d tilt_rad =
      Eigen::Vector2d::Zero();  ///< of the measured normal from the nominal one, towards u and the tangent
  Eigen::Vector2d tilt_variance_rad2 = Eigen::Vector2d::Zero();
};

/// A stretch between neighbouring measured points, along the nominal; of a closed one `to` may lie beyond its length.
struct Unmeasured {
  double from_mm = 0.0;
  double to_mm = 0.0;
  std::string reason;
};

/// Local parabolas through a rim's deviations, see edge/tool_path.h.
class RimFilter {
 public:
  /// `tilt_cutoff_mm` is that of the normals.
  RimFilter(const base::EdgeCurve& edge, const EdgeDeviations& off, double length_mm, bool closed, double cutoff_mm,
            double tilt_cutoff_mm);

  [[nodiscard]] Smoothed at(double s_mm) const;
  [[nodiscard]] double cutoff_mm() const { return cutoff_mm_; }  ///< that is used
  [[nodiscard]] double usual_spacing_mm() const { return spacing_mm_; }
  [[nodiscard]] std::vector<Unmeasured> gaps() const;
  [[nodiscard]] Eigen::Vector2d mean_square_mm2() const;  ///< of the deviations
  [[nodiscard]] Eigen::Vector2d mean_square_tilt_rad2() const;

 private:
  /// What a local parabola makes of the points' values: value * d at the place, slope * d its change per mm.
  struct Weights {
    std::vector<std::size_t> near;  ///< into off
    Eigen::RowVectorXd value, slope;
  };
  [[nodiscard]] std::vector<std::size_t> near(double s_mm, double reach_mm) const;
  [[nodiscard]] Weights weights(double s_mm, std::vector<std::size_t> near, const Eigen::VectorXd& variances,
                                double cutoff_mm) const;
  void add_tilt(double s_mm, Smoothed& smoothed) const;
  /// Way from s to the point, the short one round a closed curve.
  [[nodiscard]] double way(double from_mm, double to_mm) const;

  const base::EdgeCurve& edge_;
  const EdgeDeviations& off_;
  double length_mm_;
  bool closed_;
  double cutoff_mm_;
  double tilt_cutoff_mm_;
  double spacing_mm_ = 0.0;
  std::vector<std::size_t> order_;  ///< indices into off, by arc length
  std::vector<double> s_mm_;        ///< in that order
};

}  // namespace crosstie::edge::detail
