#pragma once

#include <vector>

#include <Eigen/Core>

namespace crosstie::scan::detail {

/// How far each image of a set of fringes lies off where its shift says, from the residuals of its solution.
///
/// level_n = (A + B cos 2 pi (t + e_n - shift_n)) (1 + g_n) + o_n: what moved meanwhile shows as e_n, changed light as g_n and o_n. Of these
/// the solution of A, B and t takes up a part, which is the same for every pixel that has the same e, g, o; the rest stays in the residuals
/// as a function of the phase (for a steady drift with the period of half a fringe), from which all three are estimated by least
/// squares over the pixels. Light that goes with the cosine of the shifts cannot be told from movement that goes with their sine: g_n is
/// taken to be within half a per cent, which is part of the sigmas. An e_n that all images share is no movement and is not seen; with four steps, only the differences of
/// images half a period apart are.
class ImageDrift {
 public:
  explicit ImageDrift(const std::vector<double>& shifts);

  /// A pixel: its phase [turns], modulation, mean and residuals.
  void add(double turns, double modulation, double mean, const std::vector<double>& residuals);

  struct Estimate {
    Eigen::VectorXd turns;        ///< e of each image, of zero mean; 0 where it is not seen
    Eigen::VectorXd sigma_turns;  ///< from the scatter of the residuals
    int pixels = 0;
  };
  /// Empty without pixels.
  [[nodiscard]] Estimate estimate() const;

 private:
  Eigen::Index steps_;
  Eigen::MatrixX3d design_;   ///< of the solution: 1, cosine and sine of each shift
  Eigen::MatrixXd products_;  ///< of the levels' changes, summed; the lower triangle
  Eigen::VectorXd right_;
  Eigen::VectorXd change_;  ///< of one pixel
  double squares_ = 0.0;
  double modulation_ = 0.0;
  int pixels_ = 0;
};

}  // namespace crosstie::scan::detail
