#include "edge/detail/nominal_problem.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace crosstie::edge::detail {
namespace {

constexpr int kMaxIterations = 200;
constexpr double kSizeStep_mm = 1e-3;  // of the difference quotients of the outline

}  // namespace

/// A point of the rim beside its nearest place.
struct NominalProblem::Place {
  Eigen::Vector3d q = Eigen::Vector3d::Zero();  ///< the point, less what it shares, in the hole's frame
  Eigen::Matrix<double, 3, 2> across = Eigen::Matrix<double, 3, 2>::Zero();  ///< u and v there
  Eigen::Matrix<double, 2, 3> across_in_frame = Eigen::Matrix<double, 2, 3>::Zero();
  Foot foot;
  bool beyond = false;  ///< past the end of an open curve

  [[nodiscard]] Eigen::Vector2d off_mm() const { return across.transpose() * (q - foot.jet.point); }
};

NominalProblem::Place NominalProblem::place_of(std::size_t i, const Curve& curve, const NominalState& state) const {
  const base::Pose back = state.frame_from_hole.inverse();
  Eigen::Vector3d p = edge_.points[i].point_mm;
  if (shared_count_ > 0) p -= edge_.shared_mm.middleRows<3>(static_cast<Eigen::Index>(3 * i)) * state.shared;
  Place place;
  place.q = back * p;
  place.foot = curve.nearest(place.q);
  const Jet& jet = place.foot.jet;
  const Eigen::Vector3d tangent = jet.derivative.normalized();
  const Eigen::Vector3d normal = (jet.normal - jet.normal.dot(tangent) * tangent).normalized();
  place.across.col(0) = normal.cross(tangent);
  place.across.col(1) = normal;
  place.across_in_frame = place.across.transpose() * back.rotation.toRotationMatrix();
  constexpr double kAlong = 1e-3;  // as share of the distance: past an end
  place.beyond = !curve.closed() && std::abs((place.q - jet.point).dot(tangent)) > kAlong * place.foot.distance_mm + 1e-6;
  return place;
}

Eigen::Matrix<double, 2, Eigen::Dynamic> NominalProblem::jacobian(std::size_t i, const Place& place,
                                                                  const NominalState& state) const {
  const auto fixed = static_cast<Eigen::Index>(free_.size());
  Eigen::Matrix<double, 2, Eigen::Dynamic> jacobian(2, fixed + shared_count_);
  const Eigen::Matrix<double, 2, 3> by_turn = place.across.transpose() * base::skew(place.q);
  for (Eigen::Index k = 0; k < fixed; ++k) {
    const int unknown = free_[static_cast<std::size_t>(k)];
    if (unknown < 3) {
      jacobian.col(k) = by_turn.col(unknown);
    } else if (unknown < 6) {
      jacobian.col(k) = -place.across.row(unknown - 3).transpose();
    } else {
      const auto s = static_cast<std::size_t>(unknown - 6);
      std::vector<double> more = state.size_mm;
      std::vector<double> less = state.size_mm;
      more[s] += kSizeStep_mm;
      less[s] -= kSizeStep_mm;
      const double t = place.foot.t;
      const Eigen::Vector3d change =
          (outline_jet(nominal_, more, t).point - outline_jet(nominal_, less, t).point) / (2.0 * kSizeStep_mm);
      jacobian.col(k) = -place.across.transpose() * change;
    }
  }
  if (shared_count_ > 0)
    jacobian.rightCols(shared_count_) =
        -place.across_in_frame * edge_.shared_mm.middleRows<3>(static_cast<Eigen::Index>(3 * i));
  return jacobian;
}

NominalProblem::NominalProblem(const base::EdgeCurve& edge, const Nominal& nominal, bool fit_size, bool hold_turn)
    : edge_(edge), nominal_(nominal), shared_count_(edge.shared_mm.cols()) {
  for (int i = 0; i < 6; ++i) {
    if (i != 2 || !hold_turn) free_.push_back(i);
  }
  if (fit_size) {
    for (int i = 0; i < static_cast<int>(size_names(nominal.kind).size()); ++i) free_.push_back(6 + i);
  }
}

std::string NominalProblem::name_of_unknown(int unknown) const {
  switch (unknown) {
    case 0:
    case 1:
      return "the tilt";
    case 2:
      return "the turn about the normal";
    case 3:
    case 4:
      return "the place in the surface";
    case 5:
      return "the place along the normal";
    default:
      return "the " + size_names(nominal_.kind)[static_cast<std::size_t>(unknown - 6)];
  }
}

std::optional<NominalProblem::Normals> NominalProblem::normals(const NominalState& state, bool with_matrix, Roots held) const {
  Nominal nominal = nominal_;
  nominal.size_mm = state.size_mm;
  const auto curve = Curve::make(nominal, false);
  if (!curve) return std::nullopt;
  const auto fixed = static_cast<Eigen::Index>(free_.size());
  const Eigen::Index all = fixed + shared_count_;
  Normals result;
  result.square_sum = state.shared.squaredNorm();
  result.roots = std::move(held);
  result.roots.resize(edge_.points.size());
  if (with_matrix) {
    result.matrix = Eigen::MatrixXd::Zero(all, all);
    result.right = Eigen::VectorXd::Zero(all);
    result.matrix.diagonal().tail(shared_count_).setOnes();
    result.right.tail(shared_count_) = -state.shared;
  }
  for (std::size_t i = 0; i < edge_.points.size(); ++i) {
    const Place place = place_of(i, *curve, state);
    if (place.beyond) continue;
    auto& root = result.roots[i];
    if (!root) root.emplace(place.across_in_frame * edge_.points[i].cov_mm2 * place.across_in_frame.transpose());
    if (root->info() != Eigen::Success) return std::nullopt;
    const Eigen::Vector2d residual = root->matrixL().solve(place.off_mm());
    result.square_sum += residual.squaredNorm();
    result.rows += 2;
    if (!with_matrix) continue;
    auto jacobian = this->jacobian(i, place, state);
    root->matrixL().solveInPlace(jacobian);
    result.matrix.selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
    result.right -= jacobian.transpose() * residual;
  }
  if (with_matrix) result.matrix.triangularView<Eigen::StrictlyUpper>() = result.matrix.transpose();
  return result;
}

std::optional<NominalProblem::Linear> NominalProblem::linear(const NominalState& state) const {
  Nominal nominal = nominal_;
  nominal.size_mm = state.size_mm;
  const auto curve = Curve::make(nominal, false);
  if (!curve) return std::nullopt;
  const auto all = static_cast<Eigen::Index>(2 * edge_.points.size());
  Linear linear;
  linear.off_mm.resize(all);
  linear.jacobian.resize(all, static_cast<Eigen::Index>(free_.size()) + shared_count_);
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < edge_.points.size(); ++i) {
    const Place place = place_of(i, *curve, state);
    if (place.beyond) continue;
    linear.points.push_back(i);
    linear.off_mm.segment<2>(row) = place.off_mm();
    linear.jacobian.middleRows<2>(row) = jacobian(i, place, state);
    linear.cov_mm2.emplace_back(place.across_in_frame * edge_.points[i].cov_mm2 * place.across_in_frame.transpose());
    row += 2;
  }
  linear.off_mm.conservativeResize(row);
  linear.jacobian.conservativeResize(row, Eigen::NoChange);
  return linear;
}

NominalState NominalProblem::changed(const NominalState& state, const Eigen::VectorXd& step) const {
  NominalState next = state;
  base::Vector6d delta = base::Vector6d::Zero();
  for (std::size_t k = 0; k < free_.size(); ++k) {
    const double value = step(static_cast<Eigen::Index>(k));
    if (free_[k] < 6) {
      delta(free_[k]) = value;
    } else {
      next.size_mm[static_cast<std::size_t>(free_[k] - 6)] += value;
    }
  }
  if (nominal_.kind == NominalKind::kOval && next.size_mm[0] < next.size_mm[1]) {
    next.size_mm[0] = next.size_mm[1] = 0.5 * (next.size_mm[0] + next.size_mm[1]);
  }
  next.frame_from_hole = state.frame_from_hole * base::perturbed(base::Pose{}, delta);
  next.shared += step.tail(shared_count_);
  return next;
}

bool NominalProblem::solve(NominalState& state, Normals& normals, int& iterations) const {
  auto at = this->normals(state, true);
  if (!at) return false;
  double damping = 1e-3;
  for (iterations = 0; iterations < kMaxIterations && damping < 1e12; ++iterations) {
    const Eigen::VectorXd scale = at->matrix.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd scaled = scale.asDiagonal() * at->matrix * scale.asDiagonal();
    scaled.diagonal().array() += damping;
    const Eigen::VectorXd right = scale.cwiseProduct(at->right);
    const Eigen::VectorXd scaled_step = scaled.ldlt().solve(right);
    const NominalState next = changed(state, scale.cwiseProduct(scaled_step));
    const double rest = scaled_step.dot(right);  // what the step takes off v'Pv, about
    const auto there = this->normals(next, false, at->roots);
    if (there && std::isfinite(there->square_sum) && there->square_sum <= at->square_sum * (1.0 + 1e-12)) {
      const double gained = at->square_sum - there->square_sum;
      state = next;
      at = this->normals(state, true);
      if (!at) return false;
      if (damping < 1e-6 && rest < 1e-10 && gained < 1e-8 * (1.0 + at->square_sum)) {
        normals = *std::move(at);
        return true;
      }
      damping = damping < 1e-9 ? 0.0 : damping * 0.1;
    } else {
      if (rest < 1e-12 * (1.0 + at->square_sum)) {  // no step leads down any more: rounding
        normals = *std::move(at);
        return true;
      }
      damping = std::max(1e-6, damping * 10.0);
    }
  }
  return false;
}

}  // namespace crosstie::edge::detail
