#pragma once

#include <memory>
#include <optional>

#include "base/image.h"
#include "base/pattern_sequence.h"
#include "base/phase_map.h"
#include "base/progress.h"
#include "base/result.h"

namespace crosstie::scan {

struct DecodeOptions {
  /// Largest sigma of a phase [rad]: a fifth of a radian is a modulation of 3.5 sigmas of a grey level with four steps, of 2.5 with
  /// eight; beyond, phases are not Gaussian any more.
  double max_phase_sigma_rad = 0.2;
  double min_modulation = 1.0;  ///< [grey levels]; below, whole numbers decide the phase
  /// Noise of the camera; nothing: estimated from the residuals of sets with four steps or more.
  std::optional<base::GreyNoise> noise;
  /// Residuals of a pixel's samples, rms over sigma, from which on it counts as disturbed; 0: never. Default: 1 in 10^5 of Gaussian
  /// residuals for five degrees of freedom would exceed it.
  double max_residual_ratio = 2.5;
  /// Least share of the places where the Gray code changes that must agree in phase (resultant length, 0..1).
  double min_word_agreement = 0.9;
  /// Largest shift [px] of the image from the first to the last time that a pattern was shown, and of an image of fringes against the
  /// others of its set; 0: any. Default: what a tenth of a pixel does to depths is seen in the points' scatter.
  double max_movement_px = 0.1;
  /// Largest change of the projector's and of other light from the first to the last image, of the projector's light; 0: any. Default:
  /// a change by a tenth over some 40 images is below a hundredth within a set of fringes, less than noise does to a phase.
  double max_light_change = 0.1;
  /// Take out the shift of phases by the camera's blur where brightness changes (detail/blur_shift.h).
  bool correct_blur = true;
  bool correct_ripple = true;  ///< take out the error that a waveform which is no cosine leaves in the phases
  int threads = 0;             ///< 0: as many as the machine has; no effect on the outcome

  [[nodiscard]] base::Result<> validate() const;
};

/// Images of one camera, one after the other -> phases of the projector with their sigmas.
///
/// Model: level = A + B cos(2 pi (t - shift)) + noise; A, B and the phase by least squares over the samples that are not cut off,
/// in raw pixels. sigma = sqrt(g var(A)) / (2 pi B) turns, g = 2 / N for N even steps, var() the camera's noise. The fringe is
/// told by the Gray code, or by the sets of fringes together. An image is let go as soon as its part is done: at any time the
/// images of one set are held, those of the Gray code where nothing before told their threshold, and the first image of each pattern
/// that is shown once more at the end.
class Decoder {
 public:
  /// Images will be `width` x `height`. Errors: those of the options' validate() and the sequence's.
  static base::Result<Decoder> make(const base::PatternSequence& sequence, int width, int height, const DecodeOptions& options);
  Decoder(Decoder&&) noexcept;
  Decoder& operator=(Decoder&&) noexcept;
  ~Decoder();

  /// The image of pattern `index`, each once, in any order. kBadInput for another size.
  base::Result<> add(int index, base::Image image);

  /// Errors kBadInput: images missing; nothing lit by fringes; a Gray code that does not agree with the fringes (another order of the
  /// images, another sequence), with what was found; movement and changed light.
  base::Result<base::PhaseMap> finish(const base::Progress& progress = {});

 private:
  struct Parts;
  explicit Decoder(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace crosstie::scan
