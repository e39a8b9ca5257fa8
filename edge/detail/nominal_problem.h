#pragma once

#include <optional>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "base/edge_curve.h"
#include "base/pose.h"
#include "edge/detail/curve.h"

namespace crosstie::edge::detail {

/// The state of a fit: where the hole lies, its sizes, and the causes that the points share, in their sigmas.
struct NominalState {
  base::Pose frame_from_hole;
  std::vector<double> size_mm;
  Eigen::VectorXd shared;
};

/// Least squares of a nominal hole's place and sizes. Unknowns: turn about x, y, z and shift along x, y, z of the hole (the pose
/// perturbed on the right), sizes, shared causes.
class NominalProblem {
 public:
  NominalProblem(const base::EdgeCurve& edge, const Nominal& nominal, bool fit_size, bool hold_turn);

  /// Square roots of the covariances of u and v of the points, where they have been needed.
  using Roots = std::vector<std::optional<Eigen::LLT<Eigen::Matrix2d>>>;

  struct Normals {
    Eigen::MatrixXd matrix;  ///< over the free unknowns, shared causes last
    Eigen::VectorXd right;
    double square_sum = 0.0;
    long rows = 0;
    Roots roots;
  };
  /// Nothing where the sizes make no curve. `with_matrix` false: the sum of squares alone. Which way u and v lie, and so how a point weighs, follows the
  /// curve; `held` are the roots of another state, with which the two sums of squares compare.
  [[nodiscard]] std::optional<Normals> normals(const NominalState& state, bool with_matrix, Roots held = {}) const;

  /// Distances of the points from the nominal and their derivatives by the free unknowns and the shared causes, in mm and not weighted.
  struct Linear {
    std::vector<std::size_t> points;  ///< of the rim: those that are not beyond an open nominal's end
    Eigen::VectorXd off_mm;           ///< u, v of each
    Eigen::MatrixXd jacobian;         ///< of off_mm
    std::vector<Eigen::Matrix2d> cov_mm2;
  };
  [[nodiscard]] std::optional<Linear> linear(const NominalState& state) const;
  [[nodiscard]] NominalState changed(const NominalState& state, const Eigen::VectorXd& step) const;

  /// Levenberg-Marquardt with weights that each step holds and that follow the curve after it, since its derivatives do not know how they change;
  /// false where it does not come to rest. `state` and `normals` are those of its end.
  bool solve(NominalState& state, Normals& normals, int& iterations) const;

  [[nodiscard]] int free_count() const { return static_cast<int>(free_.size()); }  ///< without shared causes
  [[nodiscard]] const std::vector<int>& free() const { return free_; }             ///< 0-5 pose, 6 on sizes
  [[nodiscard]] std::string name_of_unknown(int unknown) const;

 private:
  struct Place;
  [[nodiscard]] Place place_of(std::size_t i, const Curve& curve, const NominalState& state) const;
  /// Of u and v.
  [[nodiscard]] Eigen::Matrix<double, 2, Eigen::Dynamic> jacobian(std::size_t i, const Place& place,
                                                                  const NominalState& state) const;

  const base::EdgeCurve& edge_;
  Nominal nominal_;
  std::vector<int> free_;
  Eigen::Index shared_count_ = 0;
};

}  // namespace crosstie::edge::detail
