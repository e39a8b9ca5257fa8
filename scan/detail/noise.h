#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "base/phase_map.h"

namespace crosstie::scan::detail {

/// A sample of the residuals of solved fringe images, from which the camera's noise and the light's waveform are told.
///
/// level_n = A + B cos(phi - d_n) + B h(phi - d_n) + noise: h, what the waveform has beside the cosine, is the same curve for all
/// pixels and steps, as far as least squares leaves it in the residuals. var(noise) = read + shot level.
class ResidualStatistics {
 public:
  /// A pixel: its phase and shifts [turns], modulation, mean and residuals, with `dof` = residuals - 3 > 0.
  void add(double turns, double modulation, double mean, const std::vector<double>& shifts,
           const std::vector<double>& residuals);

  [[nodiscard]] std::size_t size() const { return pixels_.size(); }
  /// Read and shot noise from trimmed means of the squared residuals, by the pixels' mean level, less the waveform's part. All 0 where
  /// there is no sample.
  [[nodiscard]] base::GreyNoise noise();
  /// Mean square of h over a period: what squares over degrees of freedom exceed the noise by, per B^2.
  [[nodiscard]] double waveform_square() const;

 private:
  static constexpr int kBins = 64;  // of a period
  struct Pixel {
    float mean;
    float modulation;
    float square;  // of the residuals over dof
    int dof;
  };

  struct Level {
    double mean = 0.0;
    double variance = 0.0;
  };
  [[nodiscard]] base::GreyNoise estimate() const;
  static Level level_of(std::span<const Pixel> pixels, double waveform);

  std::vector<Pixel> pixels_;
  std::optional<base::GreyNoise> noise_;                            // of these pixels, where it was asked for
  std::vector<double> products_ = std::vector<double>(kBins, 0.0);  // sum of residual * B
  std::vector<double> scatters_ = std::vector<double>(kBins, 0.0);  // sum of its squares
  std::vector<double> weights_ = std::vector<double>(kBins, 0.0);   // sum of B^2
};

}  // namespace crosstie::scan::detail
