#include "math/rigid_alignment.h"

#include <cmath>
#include <string>

#include <Eigen/Cholesky>
#include <Eigen/SVD>

namespace crosstie::math {
namespace {

using base::ErrorCode;
using base::fail;
using base::Pose;
using base::Result;
using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Vector7d = Eigen::Matrix<double, 7, 1>;

constexpr double kLineTolerance = 1e-7;   // second over first singular value: below, rounding decides the rotation
constexpr double kLineSigmas = 3.0;       // extent across the line that must be seen above the points' own sigma
constexpr double kMirrorAdvantage = 3.0;  // a mirrored fit this many times better is no accident of flat points
constexpr int kMaxSteps = 50;

struct Centred {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix3Xd points;
};

Centred centred(std::span<const AlignmentPair> pairs, Eigen::Vector3d AlignmentPair::*side) {
  Centred set;
  set.points.resize(3, static_cast<Eigen::Index>(pairs.size()));
  for (std::size_t i = 0; i < pairs.size(); ++i) set.points.col(static_cast<Eigen::Index>(i)) = pairs[i].*side;
  set.centre = set.points.rowwise().mean();
  set.points.colwise() -= set.centre;
  return set;
}

double mean_sigma(std::span<const AlignmentPair> pairs) {
  double sum = 0.0;
  for (const AlignmentPair& pair : pairs) sum += (pair.cov_a_mm2 + pair.cov_b_mm2).trace() / 3.0;
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

Result<> check_extent(const Centred& set, double sigma_mm, const char* name) {
  const Eigen::Vector3d extent = set.points.jacobiSvd().singularValues() / std::sqrt(static_cast<double>(set.points.cols()));
  if (extent(1) > kLineTolerance * extent(0) && extent(1) > kLineSigmas * sigma_mm && extent(0) > 0.0) return {};
  return fail(ErrorCode::kNoUniqueSolution, std::string("best fit: the points of set ") + name +
                                                " lie on one line or in one place, so a rotation is not determined; add points "
                                                "beside the line");
}

struct Similarity {
  Eigen::Matrix3d rotation;
  double scale = 1.0;
  Eigen::Vector3d translation;
};

double square_sum(const Centred& a, const Centred& b, const Eigen::Matrix3d& rotation, double scale) {
  return (a.points - scale * rotation * b.points).squaredNorm();
}

Result<Similarity> closed_solution(const Centred& a, const Centred& b, bool with_scale) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(a.points * b.points.transpose(), Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d sigma = svd.singularValues();
  Eigen::Vector3d sign(1.0, 1.0, (svd.matrixU() * svd.matrixV()).determinant() < 0.0 ? -1.0 : 1.0);
  const double spread = b.points.squaredNorm();
  Similarity best;
  best.rotation = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  best.scale = with_scale ? sigma.dot(sign) / spread : 1.0;
  best.translation = a.centre - best.scale * best.rotation * b.centre;
  if (sign(2) < 0.0) {
    const Eigen::Matrix3d mirror = svd.matrixU() * svd.matrixV().transpose();
    const double mirrored = square_sum(a, b, mirror, with_scale ? sigma.sum() / spread : 1.0);
    if (square_sum(a, b, best.rotation, best.scale) > kMirrorAdvantage * kMirrorAdvantage * mirrored) {
      return fail(ErrorCode::kBadInput,
                  "best fit: the two sets of points are mirror images of each other; one of the frames is left-handed "
                  "(an axis swapped or negated), correct it in its file");
    }
  }
  return best;
}

Result<std::vector<Eigen::Matrix3d>> weights(std::span<const AlignmentPair> pairs, const Eigen::Matrix3d& rotation,
                                             double scale, bool weighted) {
  std::vector<Eigen::Matrix3d> result(pairs.size(), Eigen::Matrix3d::Identity());
  if (!weighted) return result;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Matrix3d cov = pairs[i].cov_a_mm2 + scale * scale * rotation * pairs[i].cov_b_mm2 * rotation.transpose();
    const Eigen::LLT<Eigen::Matrix3d> llt(cov);
    if (llt.info() != Eigen::Success || !(llt.matrixLLT().diagonal().minCoeff() > 0.0)) {
      return fail(ErrorCode::kBadInput, "best fit: the covariance of pair " + std::to_string(i + 1) +
                                            " is not positive definite; give it sigmas, or fit with equal weights");
    }
    result[i] = llt.solve(Eigen::Matrix3d::Identity());
  }
  return result;
}

/// Normal equations of [w, u, ds] with a = exp(w) (scale + ds) R (b - centre_b) + m + u, m = the centre's image.
struct Normals {
  Matrix7d matrix = Matrix7d::Zero();
  Vector7d right = Vector7d::Zero();
  double square_sum = 0.0;
};

Normals normals(std::span<const AlignmentPair> pairs, const std::vector<Eigen::Matrix3d>& weight, const Similarity& at,
                const Eigen::Vector3d& centre_b) {
  Normals sum;
  const Eigen::Vector3d image = at.scale * at.rotation * centre_b + at.translation;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d turned = at.rotation * (pairs[i].b_mm - centre_b);
    const Eigen::Vector3d residual = pairs[i].a_mm - image - at.scale * turned;
    Eigen::Matrix<double, 3, 7> jacobian;
    jacobian << -base::skew(at.scale * turned), Eigen::Matrix3d::Identity(), turned;
    sum.matrix += jacobian.transpose() * weight[i] * jacobian;
    sum.right += jacobian.transpose() * weight[i] * residual;
    sum.square_sum += residual.dot(weight[i] * residual);
  }
  return sum;
}

Matrix7d inverse_of_estimated(const Matrix7d& normal, int estimated) {
  Matrix7d inverse = Matrix7d::Zero();
  inverse.topLeftCorner(estimated, estimated) =
      normal.topLeftCorner(estimated, estimated).ldlt().solve(Eigen::MatrixXd::Identity(estimated, estimated));
  return inverse;
}

}  // namespace

Result<Alignment> align(std::span<const AlignmentPair> pairs, const AlignmentOptions& options) {
  if (pairs.size() < 3) {
    return fail(ErrorCode::kNoUniqueSolution,
                "best fit: " + std::to_string(pairs.size()) + " common points, at least 3 that are not on one line are needed");
  }
  bool any_covariance = false;
  for (const AlignmentPair& pair : pairs) {
    const double sum = pair.a_mm.sum() + pair.b_mm.sum() + pair.cov_a_mm2.sum() + pair.cov_b_mm2.sum();
    if (!std::isfinite(sum)) return fail(ErrorCode::kBadInput, "best fit: a coordinate or covariance is not a finite number");
    any_covariance = any_covariance || !pair.cov_a_mm2.isZero(0.0) || !pair.cov_b_mm2.isZero(0.0);
  }
  const bool weighted = options.weighted && any_covariance;
  const Centred a = centred(pairs, &AlignmentPair::a_mm);
  const Centred b = centred(pairs, &AlignmentPair::b_mm);
  const double sigma_mm = mean_sigma(pairs);
  if (auto ok = check_extent(a, sigma_mm, "a"); !ok) return fail(std::move(ok));
  if (auto ok = check_extent(b, sigma_mm, "b"); !ok) return fail(std::move(ok));

  auto start = closed_solution(a, b, options.with_scale);
  if (!start) return fail(std::move(start));
  Similarity at = *start;
  const int estimated = options.with_scale ? 7 : 6;
  Normals sum;
  for (int step = 0;; ++step) {
    auto weight = weights(pairs, at.rotation, at.scale, weighted);
    if (!weight) return fail(std::move(weight));
    sum = normals(pairs, *weight, at, b.centre);
    const Vector7d delta = inverse_of_estimated(sum.matrix, estimated) * sum.right;
    if (delta.norm() < 1e-14 * (1.0 + b.points.norm()) || step == kMaxSteps) break;
    const Eigen::Vector3d image = at.scale * at.rotation * b.centre + at.translation + delta.segment<3>(3);
    at.rotation = (base::rotation_exp(delta.head<3>()) * Eigen::Quaterniond(at.rotation)).normalized().toRotationMatrix();
    at.scale += delta(6);
    at.translation = image - at.scale * at.rotation * b.centre;
  }

  Alignment result;
  result.a_from_b = {Eigen::Quaterniond(at.rotation).normalized(), at.translation};
  result.scale = at.scale;
  result.weighted = weighted;
  result.redundancy = 3 * static_cast<int>(pairs.size()) - estimated;
  if (result.redundancy > 0) result.sigma0 = std::sqrt(sum.square_sum / result.redundancy);
  for (const AlignmentPair& pair : pairs) {
    result.residuals_mm.push_back(pair.a_mm - at.scale * at.rotation * pair.b_mm - at.translation);
  }
  // From the centre's image m to the origin: t + dt = m + u - exp(w) (scale + ds) R centre_b, so v = u + m x w - ds R centre_b.
  Matrix7d to_origin = Matrix7d::Identity();
  to_origin.block<3, 3>(3, 0) = base::skew(at.scale * at.rotation * b.centre + at.translation);
  to_origin.block<3, 1>(3, 6) = -at.rotation * b.centre;
  result.covariance = to_origin * inverse_of_estimated(sum.matrix, estimated) * to_origin.transpose();
  if (!weighted) result.covariance *= result.sigma0 * result.sigma0;
  return result;
}

}  // namespace crosstie::math
