#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "base/phase_map.h"
#include "scan/detail/match_kernel.h"
#include "scan/match.h"

namespace crosstie::scan::detail {

/// Two coordinates of each right pixel by which left pixels find it: a phase, and the other phase or the epipolar curve.
struct MatchTarget {
  int width = 0;
  int height = 0;
  const base::PhasePlane* first = nullptr;
  const base::PhasePlane* second = nullptr;  ///< null: the curve
  std::vector<float> x_px;                   ///< of each pixel, rectified, times the focal length
  std::vector<float> y_px;
  std::vector<char> good;  ///< where a match may lie
  double slope = 0.0;      ///< median change of the first phase over a pixel along the curves, with its sign
  /// The phases with less noise, not a number where no match may lie: they tell where to look and how phases change there, while the raw
  /// ones tell where the place is.
  std::vector<float> first_smooth;
  std::vector<float> second_smooth;
};

/// Median change of the first phase along the epipolar curves, with the sign of most.
double slope_along_curves(const MatchTarget& target);

/// Fills the smooth planes: means over so many pixels that their slope is known to a tenth.
void smooth_phases(MatchTarget& target, int threads);

/// A left pixel with both coordinates, their sigmas, and its epipolar curve.
struct LeftPixel {
  int column = 0;
  float a = 0.0F, sigma_a = 0.0F;
  float b = 0.0F, sigma_b = 0.0F;
  float curve_px = 0.0F;  ///< y in the rectified frame, times the focal length
};

enum class MatchOutcome : std::uint8_t { kMatched, kNone, kOffCurve };

struct Match {
  MatchOutcome outcome = MatchOutcome::kNone;
  Eigen::Vector2d place_px = Eigen::Vector2d::Zero();  ///< in the right image
  double x_px = 0.0;                                   ///< rectified
  double sigma_px = 0.0;                               ///< of x_px
  double off_px = 0.0;                                 ///< rectified y minus the curve's
  double off_sigma_px = 0.0;
};

/// Finds left pixels' places in the right image.
class Matcher {
 public:
  /// `target` outlives it.
  Matcher(const MatchTarget& target, const MatchOptions& options);
  Matcher(const Matcher&) = delete;
  Matcher& operator=(const Matcher&) = delete;
  ~Matcher();

  /// The places with the coordinates of a row's pixels, which are in the order of their columns, and what these say. In batches: where the
  /// next ones lie the last ones tell; where they do not, or wrongly, a table does.
  void find_row(std::span<const LeftPixel> pixels, std::span<Match> matches) const;

 private:
  class Table;
  /// Of those that are not found yet, from where `start(pixel)` says; whether all are found then.
  template <typename Start>
  bool find_from(std::span<const LeftPixel> pixels, std::span<Match> matches, const Start& start) const;

  const MatchTarget& target_;
  MatchOptions options_;
  MatchPlanes planes_;
  std::unique_ptr<const Table> table_;
};

}  // namespace crosstie::scan::detail
