#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/pattern_sequence.h"
#include "base/plane.h"
#include "base/result.h"

namespace crosstie::base {

/// What became of a pixel of a phase map.
enum class PhaseStatus : std::uint8_t {
  kValid,
  kDark,       ///< the fringes' modulation does not stand out of the noise
  kSaturated,  ///< too few samples are left that are not cut off
  kUndecided,  ///< nothing tells which fringe it is
  kDisturbed,  ///< the samples are no shifted cosine: movement, changed light, two surfaces in one pixel
};
inline constexpr std::size_t kPhaseStatusCount = 5;

/// Noise of a grey level: variance = read + shot * level [grey levels^2] (photon transfer: read noise and quantisation, shot
/// noise). Levels of all images of a capture, before any correction.
struct GreyNoise {
  double read = 0.0;
  double shot = 0.0;

  [[nodiscard]] double variance(double level) const { return read + shot * level; }
};

/// A coordinate of the projector over a camera's image, row by row, in periods of the finest fringes.
struct PhasePlane {
  ProjectorAxis axis = ProjectorAxis::kX;
  double fringes = 0.0;               ///< periods over the projector's extent
  Plane<float> turns;                 ///< not a number where there is none
  Plane<float> sigma_turns;           ///< of the camera's noise
  Plane<float> modulation;            ///< B of the finest fringes [grey levels]
  std::optional<double> word_offset;  ///< of the Gray code's words against the fringes, as found [words]
  double word_agreement = 1.0;        ///< resultant length of the places where the code changes, 1: all at one phase
  double ripple_turns = 0.0;  ///< amplitude of the error that the light's waveform left in the phases and that was taken out
  std::int64_t repaired = 0;  ///< pixels whose fringe their neighbours told
};

/// Whether all stood still during a capture, and the light with it.
struct Stillness {
  bool compared = false;    ///< patterns were shown at the beginning and once more at the end
  bool shift_told = false;  ///< and what they show is sharp enough to tell a shift
  double shift_px = 0.0;    ///< of the image as a whole from the first to the last time
  double shift_sigma_px = 0.0;
  double part_shift_px = 0.0;  ///< largest of the parts of the image that are beyond 5 sigmas
  double part_sigma_px = 0.0;
  double moved_share = 0.0;                   ///< of the parts: beyond the limit by more than 5 sigmas
  double changed_share = 0.0;                 ///< of the parts: look different from the first to the last time
  std::optional<double> light_change = {};    ///< of the projector's light, relative; nothing without white and black twice
  std::optional<double> ambient_change = {};  ///< of all other light, relative to the projector's
  bool drift_told = false;                    ///< sets of four images or more were there; see drift_px
  /// Largest shift of an image of a set of fringes against the others that is beyond 5 sigmas, from the residuals: movement within
  /// the set, or a projector whose steps are not even.
  double drift_px = 0.0;
  double drift_sigma_px = 0.0;
};

/// One camera's view of the projector.
struct PhaseMap {
  int width = 0;
  int height = 0;
  std::optional<PhasePlane> x;
  std::optional<PhasePlane> y;
  Plane<float> light;                                       ///< mean level of the fringe images of the shortest exposure
  std::vector<PhaseStatus> status;                          ///< of each pixel, over all axes
  std::array<std::int64_t, kPhaseStatusCount> counts = {};  ///< by status
  GreyNoise noise;                                          ///< as found, or as given
  bool noise_given = false;
  /// Root mean square of the fringe images' residuals over their predicted sigma: near 1 where light is a cosine and all stood still.
  double residual_ratio = 0.0;
  double disturbed_fraction = 0.0;  ///< of the pixels with modulation
  Stillness stillness;

  [[nodiscard]] std::size_t at(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) + static_cast<std::size_t>(column);
  }
  [[nodiscard]] const PhasePlane* plane(ProjectorAxis axis) const {
    const auto& wanted = axis == ProjectorAxis::kX ? x : y;
    return wanted ? &*wanted : nullptr;
  }
};

}  // namespace crosstie::base
