#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/pose.h"
#include "math/parameters.h"
#include "math/whitened_rows.h"

namespace crosstie::math {

/// A block of unknowns with its present values. A vector's tangent is the vector itself; a pose is stored as qx qy qz qw tx ty
/// tz and its tangent is the left perturbation [w rad, v mm] of base::Pose. A mount is the pose of a camera on its rig, which does
/// not move with the network's frame.
struct Block {
  enum class Kind { kVector, kPoint, kPose, kMount };

  std::string name;
  Kind kind = Kind::kVector;
  std::vector<double> values;
  std::vector<std::string> components;  ///< one name for each tangent direction
  std::vector<int> free;                ///< tangent directions that are estimated, ascending; empty: the block is held
  BlockRole role = BlockRole::kKept;

  [[nodiscard]] int tangent_size() const { return static_cast<int>(components.size()); }
  [[nodiscard]] bool is_pose() const { return kind == Kind::kPose || kind == Kind::kMount; }
};

[[nodiscard]] Block pose_block(std::string name, const base::Pose& pose);
[[nodiscard]] Block point_block(std::string name, const Eigen::Vector3d& point);
[[nodiscard]] base::Pose pose_from_values(const double* values);
void pose_to_values(const base::Pose& pose, double* values);

/// One kind of observation is one class derived from this, in a file of its own; the solver, the covariance and the tests know
/// no more of it than this.
class Measurement {
 public:
  explicit Measurement(std::vector<int> blocks) : blocks_(std::move(blocks)) {}
  virtual ~Measurement() = default;
  Measurement(const Measurement&) = delete;
  Measurement& operator=(const Measurement&) = delete;

  /// The blocks that it depends on, each once.
  [[nodiscard]] const std::vector<int>& blocks() const { return blocks_; }
  [[nodiscard]] virtual int rows() const = 0;

  /// Whitened residual (predicted minus measured) at `values[i]`, the values of block i of blocks(). `jacobians` may be null,
  /// as may each of its entries; entry i is rows x tangent_size, row-major, by all tangent directions. False where the
  /// prediction does not exist (a point behind the camera).
  virtual bool evaluate(const double* const* values, double* residual, double* const* jacobians) const = 0;

  /// A robust loss applies to image points only; a certified length or a prior is taken as stated.
  [[nodiscard]] virtual bool may_be_wrong() const { return false; }

 private:
  std::vector<int> blocks_;
};

/// Unknowns and observations of one adjustment.
struct Model {
  std::vector<Block> blocks;
  std::vector<std::unique_ptr<Measurement>> measurements;

  int add(Block block);

  /// The unknowns as math sees them: block i there is block i here, with its free directions only.
  [[nodiscard]] Parameters parameters() const;
  /// All measurements at the present values, one group each in their order; false where one cannot be evaluated.
  [[nodiscard]] bool linearise(WhitenedRows& rows) const;
  /// Appends one measurement of these blocks as a group.
  [[nodiscard]] bool linearise(const Measurement& measurement, WhitenedRows& rows) const;
  /// v'Pv at the present values; infinite where a measurement cannot be evaluated.
  [[nodiscard]] double square_sum() const;
  /// Moves the free directions by a step over the full vector of `parameters()`.
  void move(const Eigen::VectorXd& step);
};

}  // namespace crosstie::math
