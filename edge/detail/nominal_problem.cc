#include "edge/detail/nominal_problem.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

namespace crosstie::edge::detail {
namespace {

constexpr int kMaxIterations = 200;
constexpr double kSizeStep_mm = 1e-3;  // of the difference quotients of the outline

/// A point of the rim beside its nearest place.
struct Beside {
  Eigen::Vector3d q = Eigen::Vector3d::Zero();  ///< the point, less what it shares, in the hole's frame
  Eigen::Matrix<double, 3, 2> across = Eigen::Matrix<double, 3, 2>::Zero();  ///< u and v there
  Foot foot;
  bool beyond = false;  ///< past the end of an open curve
};

Beside beside(const Curve& curve, const Eigen::Vector3d& q) {
  Beside b;
  b.q = q;
  b.foot = curve.nearest(q);
  const Eigen::Vector3d tangent = b.foot.jet.derivative.normalized();
  const Eigen::Vector3d normal = (b.foot.jet.normal - b.foot.jet.normal.dot(tangent) * tangent).normalized();
  b.across.col(0) = normal.cross(tangent);
  b.across.col(1) = normal;
  constexpr double kAlong = 1e-3;  // as share of the distance: past an end
  b.beyond = !curve.closed() && std::abs((q - b.foot.jet.point).dot(tangent)) > kAlong * b.foot.distance_mm + 1e-6;
  return b;
}

}  // namespace

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
  const base::Pose back = state.frame_from_hole.inverse();
  const Eigen::Matrix3d turn = back.rotation.toRotationMatrix();
  for (std::size_t i = 0; i < edge_.points.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(3 * i);
    Eigen::Vector3d p = edge_.points[i].point_mm;
    if (shared_count_ > 0) p -= edge_.shared_mm.middleRows<3>(row) * state.shared;
    const Beside b = beside(*curve, back * p);
    if (b.beyond) continue;
    const Eigen::Matrix<double, 2, 3> e_turn = b.across.transpose() * turn;
    auto& root = result.roots[i];
    if (!root) root.emplace(e_turn * edge_.points[i].cov_mm2 * e_turn.transpose());
    if (root->info() != Eigen::Success) return std::nullopt;
    const Eigen::Vector2d residual = root->matrixL().solve(Eigen::Vector2d(b.across.transpose() * (b.q - b.foot.jet.point)));
    result.square_sum += residual.squaredNorm();
    result.rows += 2;
    if (!with_matrix) continue;
    Eigen::Matrix<double, 2, Eigen::Dynamic> jacobian(2, all);
    const Eigen::Matrix<double, 2, 3> by_turn = b.across.transpose() * base::skew(b.q);
    for (Eigen::Index k = 0; k < fixed; ++k) {
      const int unknown = free_[static_cast<std::size_t>(k)];
      if (unknown < 3) {
        jacobian.col(k) = by_turn.col(unknown);
      } else if (unknown < 6) {
        jacobian.col(k) = -b.across.row(unknown - 3).transpose();
      } else {
        const auto s = static_cast<std::size_t>(unknown - 6);
        std::vector<double> more = state.size_mm;
        std::vector<double> less = state.size_mm;
        more[s] += kSizeStep_mm;
        less[s] -= kSizeStep_mm;
        const Eigen::Vector3d change =
            (outline_jet(nominal, more, b.foot.t).point - outline_jet(nominal, less, b.foot.t).point) / (2.0 * kSizeStep_mm);
        jacobian.col(k) = -b.across.transpose() * change;
      }
    }
    if (shared_count_ > 0) jacobian.rightCols(shared_count_) = -e_turn * edge_.shared_mm.middleRows<3>(row);
    root->matrixL().solveInPlace(jacobian);
    result.matrix.selfadjointView<Eigen::Lower>().rankUpdate(jacobian.transpose());
    result.right -= jacobian.transpose() * residual;
  }
  if (with_matrix) result.matrix.triangularView<Eigen::StrictlyUpper>() = result.matrix.transpose();
  return result;
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
