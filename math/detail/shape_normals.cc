#include "math/detail/shape_normals.h"

#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace crosstie::math::detail {
namespace {

constexpr double kTiny = 1e-300;

/// Residuals of a point, their derivatives by the kind's parameters and by the point, all in the frame of the shape.
template <int Rows, int Unknowns>
struct PointRows {
  Eigen::Matrix<double, Rows, 1> residual;
  Eigen::Matrix<double, Rows, Unknowns> jacobian;
  Eigen::Matrix<double, Rows, 3> normal;
};

struct LineModel {
  static constexpr std::array kColumns = {kU, kV, kA, kB};
  using Rows = PointRows<2, 4>;
  explicit LineModel(const ShapeState&) {}
  void operator()(const Eigen::Vector3d& q, Rows& rows) const {
    rows.residual << q.x(), q.y();
    rows.jacobian << -1.0, 0.0, -q.z(), 0.0, 0.0, -1.0, 0.0, -q.z();
    rows.normal << 1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  }
};

struct PlaneModel {
  static constexpr std::array kColumns = {kW, kA, kB};
  using Rows = PointRows<1, 3>;
  explicit PlaneModel(const ShapeState&) {}
  void operator()(const Eigen::Vector3d& q, Rows& rows) const {
    rows.residual << q.z();
    rows.jacobian << -1.0, q.x(), q.y();
    rows.normal << 0.0, 0.0, 1.0;
  }
};

struct CircleModel {
  static constexpr std::array kColumns = {kU, kV, kW, kA, kB, kSize};
  using Rows = PointRows<2, 6>;
  explicit CircleModel(const ShapeState& state) : radius(state.size) {}
  void operator()(const Eigen::Vector3d& q, Rows& rows) const {
    const double rho = std::sqrt(q.x() * q.x() + q.y() * q.y() + kTiny);
    const double c = q.x() / rho;
    const double s = q.y() / rho;
    rows.residual << rho - radius, q.z();
    rows.jacobian << -c, -s, 0.0, -c * q.z(), -s * q.z(), -1.0, 0.0, 0.0, -1.0, q.x(), q.y(), 0.0;
    rows.normal << c, s, 0.0, 0.0, 0.0, 1.0;
  }
  double radius;
};

struct SphereModel {
  static constexpr std::array kColumns = {kU, kV, kW, kSize};
  using Rows = PointRows<1, 4>;
  explicit SphereModel(const ShapeState& state) : radius(state.size) {}
  void operator()(const Eigen::Vector3d& q, Rows& rows) const {
    const double length = std::sqrt(q.squaredNorm() + kTiny);
    const Eigen::Vector3d n = q / length;
    rows.residual << length - radius;
    rows.jacobian << -n.x(), -n.y(), -n.z(), -1.0;
    rows.normal << n.x(), n.y(), n.z();
  }
  double radius;
};

struct CylinderModel {
  static constexpr std::array kColumns = {kU, kV, kA, kB, kSize};
  using Rows = PointRows<1, 5>;
  explicit CylinderModel(const ShapeState& state) : radius(state.size) {}
  void operator()(const Eigen::Vector3d& q, Rows& rows) const {
    const double rho = std::sqrt(q.x() * q.x() + q.y() * q.y() + kTiny);
    const double c = q.x() / rho;
    const double s = q.y() / rho;
    rows.residual << rho - radius;
    rows.jacobian << -c, -s, -c * q.z(), -s * q.z(), -1.0;
    rows.normal << c, s, 0.0;
  }
  double radius;
};

struct ConeModel {
  static constexpr std::array kColumns = {kU, kV, kA, kB, kSize, kAngle};
  using Rows = PointRows<1, 6>;
  explicit ConeModel(const ShapeState& state)
      : distance(state.size), cosine(std::cos(state.angle)), sine(std::sin(state.angle)) {}
  void operator()(const Eigen::Vector3d& q, Rows& rows) const {
    const double rho = std::sqrt(q.x() * q.x() + q.y() * q.y() + kTiny);
    const double c = q.x() / rho;
    const double s = q.y() / rho;
    const double tilt = cosine * q.z() + sine * rho;
    rows.residual << rho * cosine - q.z() * sine - distance;
    rows.jacobian << -cosine * c, -cosine * s, -c * tilt, -s * tilt, -1.0, -rho * sine - q.z() * cosine;
    rows.normal << cosine * c, cosine * s, -sine;
  }
  double distance;
  double cosine;
  double sine;
};

/// Calls `work` with the model of the kind.
template <typename Work>
auto with_model(ShapeKind kind, const ShapeState& state, Work&& work) {
  switch (kind) {
    case ShapeKind::kLine:
      return work(LineModel(state));
    case ShapeKind::kPlane:
      return work(PlaneModel(state));
    case ShapeKind::kCircle:
      return work(CircleModel(state));
    case ShapeKind::kSphere:
      return work(SphereModel(state));
    case ShapeKind::kCylinder:
      return work(CylinderModel(state));
    case ShapeKind::kCone:
      break;
  }
  return work(ConeModel(state));
}

/// Covariance of a point's residuals.
template <typename Normal>
auto residual_covariance(const Normal& normal, const ShapeState& state, const PointSet& points, Eigen::Index i) {
  constexpr int kRows = Normal::RowsAtCompileTime;
  Eigen::Matrix<double, kRows, kRows> cov = Eigen::Matrix<double, kRows, kRows>::Identity() * (points.sigma * points.sigma);
  if (!points.cov.empty()) {
    const Normal in_frame = normal * state.axes.transpose();
    cov = in_frame * points.cov[static_cast<std::size_t>(i)] * in_frame.transpose();
  }
  return cov;
}

template <typename Model>
ShapeNormals accumulate(const Model& model, const ShapeState& state, const PointSet& points) {
  using Rows = typename Model::Rows;
  constexpr int kUnknowns = static_cast<int>(Model::kColumns.size());
  constexpr int kRows = decltype(Rows::residual)::RowsAtCompileTime;
  constexpr Eigen::Index kChunk = 1024;  // sums of sums: rounding grows with the root of the points only
  Eigen::Matrix<double, kUnknowns, kUnknowns> matrix = Eigen::Matrix<double, kUnknowns, kUnknowns>::Zero();
  Eigen::Matrix<double, kUnknowns, 1> right = Eigen::Matrix<double, kUnknowns, 1>::Zero();
  ShapeNormals normals;
  Rows rows;
  const double weight = 1.0 / (points.sigma * points.sigma);
  for (Eigen::Index begin = 0; begin < points.xyz.cols(); begin += kChunk) {
    Eigen::Matrix<double, kUnknowns, kUnknowns> chunk_matrix = Eigen::Matrix<double, kUnknowns, kUnknowns>::Zero();
    Eigen::Matrix<double, kUnknowns, 1> chunk_right = Eigen::Matrix<double, kUnknowns, 1>::Zero();
    double chunk_sum = 0.0;
    const Eigen::Index end = std::min(begin + kChunk, points.xyz.cols());
    for (Eigen::Index i = begin; i < end; ++i) {
      if (!points.takes_part(i)) continue;
      model(state.axes.transpose() * (points.xyz.col(i) - state.origin), rows);
      if (points.cov.empty()) {
        rows.jacobian *= std::sqrt(weight);
        rows.residual *= std::sqrt(weight);
      } else {
        const Eigen::LLT<Eigen::Matrix<double, kRows, kRows>> root(residual_covariance(rows.normal, state, points, i));
        if (root.info() != Eigen::Success || !(root.matrixLLT().diagonal().minCoeff() > 0.0)) {
          normals.weights_are_good = false;
          return normals;
        }
        root.matrixL().solveInPlace(rows.jacobian);
        root.matrixL().solveInPlace(rows.residual);
      }
      chunk_matrix.noalias() += rows.jacobian.transpose().lazyProduct(rows.jacobian);
      chunk_right.noalias() -= rows.jacobian.transpose().lazyProduct(rows.residual);
      chunk_sum += rows.residual.squaredNorm();
    }
    matrix += chunk_matrix;
    right += chunk_right;
    normals.square_sum += chunk_sum;
  }
  for (int a = 0; a < kUnknowns; ++a) {
    const int row = Model::kColumns[static_cast<std::size_t>(a)];
    normals.right(row) = right(a);
    for (int b = 0; b < kUnknowns; ++b) normals.matrix(row, Model::kColumns[static_cast<std::size_t>(b)]) = matrix(a, b);
  }
  return normals;
}

}  // namespace

ShapeNormals shape_normals(ShapeKind kind, const ShapeState& state, const PointSet& points) {
  return with_model(kind, state, [&](const auto& model) { return accumulate(model, state, points); });
}

double shape_residual(ShapeKind kind, const ShapeState& state, const Eigen::Vector3d& point) {
  return with_model(kind, state, [&](const auto& model) {
    typename std::decay_t<decltype(model)>::Rows rows;
    model(state.axes.transpose() * (point - state.origin), rows);
    return rows.residual.size() == 1 ? rows.residual(0) : rows.residual.norm();
  });
}

double standardised_square(ShapeKind kind, const ShapeState& state, const PointSet& points, Eigen::Index i,
                           const Matrix7d& cofactor, bool took_part) {
  return with_model(kind, state, [&](const auto& model) {
    using Model = std::decay_t<decltype(model)>;
    typename Model::Rows rows;
    constexpr int kRows = decltype(rows.residual)::RowsAtCompileTime;
    model(state.axes.transpose() * (points.xyz.col(i) - state.origin), rows);
    Eigen::Matrix<double, kRows, 7> jacobian = Eigen::Matrix<double, kRows, 7>::Zero();
    for (std::size_t a = 0; a < Model::kColumns.size(); ++a) {
      jacobian.col(Model::kColumns[a]) = rows.jacobian.col(static_cast<Eigen::Index>(a));
    }
    const auto own = residual_covariance(rows.normal, state, points, i);
    const Eigen::Matrix<double, kRows, kRows> carried = jacobian * cofactor * jacobian.transpose();
    const Eigen::Matrix<double, kRows, kRows> q = own + (took_part ? -1.0 : 1.0) * carried;
    // What the adjustment follows wholly shows nothing.
    if (!(q.determinant() > 1e-12 * own.determinant())) return 0.0;
    return static_cast<double>(rows.residual.dot(q.inverse() * rows.residual));
  });
}

}  // namespace crosstie::math::detail
