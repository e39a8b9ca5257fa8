#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "scan/detail/step_kernel.h"

namespace crosstie::scan::detail {

/// The pixels near an edge: their distances from it and their grey levels in each of the edge images.
class ProfileSamples {
 public:
  void clear();
  void add(double across_px, const std::array<double, kMostEdgeImages>& levels) {
    if (size_ == across_px_.size()) grow();
    if (size_ == 0) origins_ = levels;  // keeps the sums of squares small
    across_px_[size_] = across_px;
    for (std::size_t image = 0; image < kMostEdgeImages; ++image) levels_[image][size_] = levels[image] - origins_[image];
    ++size_;
  }
  /// After the last pixel: the first `images` levels of each count. Fits and candidates take samples that are finished.
  void finish(std::size_t images);

  /// Divides the levels before the edge by 1 + slope * across, so that a side whose brightness changes steadily is even; finish() follows.
  void even_out(double slope_per_px);

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t images() const { return images_; }
  /// A level, from that of the first pixel.
  [[nodiscard]] double level(std::size_t image, std::size_t at) const { return levels_[image][at]; }
  [[nodiscard]] double across_px(std::size_t at) const { return across_px_[at]; }
  [[nodiscard]] double origin(std::size_t image) const { return origins_[image]; }
  [[nodiscard]] double sum(std::size_t image) const { return sums_[image]; }         ///< of level()
  [[nodiscard]] double squares(std::size_t image) const { return squares_[image]; }  ///< sum of level()^2
  [[nodiscard]] double low_px() const { return low_px_; }                            ///< the smallest distance
  [[nodiscard]] double high_px() const { return high_px_; }
  [[nodiscard]] StepSamples for_sums() const;

 private:
  void grow();

  std::vector<double> across_px_;  ///< room for more than `size_` samples
  std::array<std::vector<double>, kMostEdgeImages> levels_;
  std::array<double, kMostEdgeImages> origins_ = {}, sums_ = {}, squares_ = {};
  double low_px_ = 0.0, high_px_ = 0.0;
  std::size_t size_ = 0;
  std::size_t images_ = 0;
};

/// Levels that step at the same places in all edge images, seen through the camera's point spread.
struct StepProfile {
  int steps = 0;
  std::array<double, kMostSteps> at_px = {};                                    ///< ascending
  std::array<std::array<double, kMostSteps + 1>, kMostEdgeImages> levels = {};  ///< of each image: before, between, beyond
  Eigen::Matrix3d cov_px2 = Eigen::Matrix3d::Zero();        ///< of the places, as the residuals' scatter says
  Eigen::Matrix3d noise_cov_px2 = Eigen::Matrix3d::Zero();  ///< the same, as the camera's noise says
  double band_variance_px2 = 0.0;  ///< of the first place, where the band behind it is too narrow for its extent to be told
  std::array<double, kMostEdgeImages> rms = {};  ///< of the residuals
  double log_likelihood = 0.0;                   ///< - n / 2 sum over images of log(mean squared residual)
  /// Mean square of the images' own shifts of the first step from the common place, over what their residuals let expect; 1 with one image.
  double disagreement = 1.0;
  std::array<double, kMostEdgeImages> share = {};  ///< of each image in the first place
};

/// Least squares of
///     level_i(t) = L_i0 + sum_k (L_ik - L_i,k-1) Phi((t - x_k) / blur_px)
/// over the pixels themselves (nothing is resampled), the places x_k shared by all images, each image weighted by its residuals: grain of the
/// surface counts beside the camera's noise. The places are iterated (Gauss-Newton), the levels eliminated. Since the model integrates the
/// blur, the place is that of the step itself, whatever the levels at its sides: the maximum of the gradient is pulled to neighbouring steps.
/// `noise_sigma` are the camera's, of each image. Steps nearer to each other than the
/// blur resolves are held at a least distance: a line, whose extent is told no better than that. It ends with the first move of less than
/// `converged_px`; false where there is none.
bool fit_steps(const ProfileSamples& samples, const std::array<double, kMostEdgeImages>& noise_sigma, double blur_px,
               std::span<const double> start_px, double converged_px, StepProfile& profile);

/// Places where the levels change most, strongest first, at most `count`: extrema of the derivative of the averages over strips half a
/// pixel wide, in [from_px, to_px]. Each is told from the noise of these averages by `least_sigmas`.
struct StepCandidates {
  std::array<double, kMostSteps> at_px = {};
  std::size_t count = 0;
  double strongest = 0.0;  ///< the first one's change over its noise

  [[nodiscard]] std::span<const double> first(std::size_t steps) const { return std::span(at_px).first(steps); }
};
StepCandidates step_candidates(const ProfileSamples& samples, double from_px, double to_px, std::size_t count,
                               double least_sigmas);

}  // namespace crosstie::scan::detail
