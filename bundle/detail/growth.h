#pragma once

#include <optional>
#include <vector>

#include "base/progress.h"
#include "bundle/adjust.h"
#include "bundle/detail/network_model.h"
#include "bundle/detail/state.h"

namespace crosstie::bundle::detail {

inline constexpr int kLeastStartPoints = 6;  ///< that a starting pair must have in common
inline constexpr double kLensTolerance_rad =
    0.02;  ///< what an unknown lens may bend a direction by, and what a guess of f leaves

/// One attempt at building a network up from a pair of images: resection, triangulation, a robust bundle in between; lens
/// parameters are freed step by step as images of their camera come in.
class Growth {
 public:
  /// The references must outlive the object.
  Growth(const Survey& survey, const AdjustOptions& options, const std::vector<std::vector<int>>& free_lens,
         const base::Progress& progress);

  /// False where the pair gives too few points to go on.
  bool begin(int image_a, int image_b, const base::Pose& a_from_b);
  /// Takes over a network that was found otherwise.
  void adopt(const State& state) { state_ = state; }
  /// Orients all images that can be; false where it was cancelled or fell apart.
  bool run();

  [[nodiscard]] const State& state() const { return state_; }
  /// Sum of squares of all residuals, each cut off, by which outcomes are compared.
  [[nodiscard]] double truncated_sum() const;
  /// Whether nearly everything is explained.
  [[nodiscard]] bool good() const;

 private:
  enum class Which { kUnknown, kAll };

  [[nodiscard]] int oriented() const;
  [[nodiscard]] int known_points() const;
  /// -1 where none sees enough.
  [[nodiscard]] int most_seeing_image(const std::vector<char>& failed) const;
  void triangulate(Which which);
  /// Whether an image got into a wrong pose: half of its rays miss their points.
  [[nodiscard]] bool disagrees(int image) const;
  /// Lens parameters by what the images of a camera can carry, about their start values.
  [[nodiscard]] ModelPlan lens_plan() const;
  /// A robust bundle over the rays that agree, then a tolerance to match.
  bool settle();

  const Survey& survey_;
  const AdjustOptions& options_;
  const std::vector<std::vector<int>>& free_lens_;
  const base::Progress& progress_;
  State state_;
  std::vector<std::optional<Eigen::Vector3d>> directions_;
  double widest_px_ = 0.0;
  double tolerance_px_ = 0.0;
};

}  // namespace crosstie::bundle::detail
