#include "calib/detail/spline_lens.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>

namespace crosstie::calib::detail {
namespace {

constexpr int kOrder = 3;
constexpr int kColumns = 10;
constexpr double kMargin = 1.02;

/// u = 2 (X, Y) / (|p| + Z) of a unit vector, and back.
Eigen::Vector2d stereographic(const Eigen::Vector3d& direction) { return 2.0 / (1.0 + direction.z()) * direction.head<2>(); }

Eigen::Vector3d direction_of(const Eigen::Vector2d& u) {
  const double s = u.squaredNorm();
  return Eigen::Vector3d(4.0 * u.x(), 4.0 * u.y(), 4.0 - s) / (4.0 + s);
}

}  // namespace

std::optional<base::LensModel> spline_for(const Problem& problem, const State& state) {
  Eigen::Vector2d half = Eigen::Vector2d::Zero();
  for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
    const Eigen::Vector2i size = problem.size_px[c];
    const auto camera = base::Camera::make(state.lens_model, size.x(), size.y(), state.lenses[c]);
    if (!camera) return {};
    const Eigen::Vector2d middle = camera->principal_point_px();
    for (const double x : {-0.5, 0.5 * size.x(), size.x() - 0.5}) {
      for (const double y : {-0.5, 0.5 * size.y(), size.y() - 0.5}) {
        // A lens that was seen in the middle only may fold before the corners: then as far as it reaches, and in proportion.
        constexpr double kStep = 0.05;
        double share = 1.0;
        auto ray = camera->unproject({x, y});
        while (!ray && share > 0.5) {
          share -= kStep;
          ray = camera->unproject(middle + share * (Eigen::Vector2d(x, y) - middle));
        }
        if (!ray) return {};
        half = half.cwiseMax(kMargin / share * stereographic(*ray).cwiseAbs());
      }
    }
  }
  const double fov = std::ceil(4.0 * std::atan(0.5 * half.x()) * 180.0 / std::numbers::pi);
  const double width = 4.0 * std::tan(fov * std::numbers::pi / 720.0);  // of what the grid covers
  const double interval = width / (kColumns - kOrder);
  const int rows = kOrder + std::max(1, static_cast<int>(std::ceil(2.0 * half.y() / interval)));
  const auto model =
      base::LensModel::splined({.order = kOrder, .columns = kColumns, .rows = rows, .fov_x_degrees = static_cast<int>(fov)});
  return model ? std::optional(*model) : std::nullopt;
}

Eigen::VectorXd as_spline(const Eigen::VectorXd& lens, base::LensModel from, base::LensModel spline) {
  constexpr int kSamples = 3;      // per interval
  constexpr double kRidge = 1e-6;  // of the samples' weight, for control points that no sample reaches
  const int count = base::parameter_count(spline);
  const auto grid = spline.grid();
  const double half_width = 2.0 * std::tan(grid.fov_x_degrees * std::numbers::pi / 720.0);
  const double interval = 2.0 * half_width / (grid.columns - grid.order);
  const double half_height = 0.5 * interval * (grid.rows - grid.order);
  Eigen::VectorXd result = Eigen::VectorXd::Zero(count);
  result.head<4>() = lens.head<4>();
  const Eigen::Index free = count - 4;
  Eigen::MatrixXd normal = kRidge * lens(0) * lens(0) * Eigen::MatrixXd::Identity(free, free);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(free);
  Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> rows(2, count);
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_point;
  const auto steps = [&](double half) { return static_cast<int>(std::lround(2.0 * half / interval * kSamples)); };
  // Only lenses that can be inverted there are followed.
  const auto camera = base::Camera::make(from, 2, 2, lens);
  const double reach = camera ? camera->valid_tangent() : 0.0;
  for (int i = 0; i <= steps(half_width); ++i) {
    for (int j = 0; j <= steps(half_height); ++j) {
      const Eigen::Vector3d p = direction_of({-half_width + interval / kSamples * i, -half_height + interval / kSamples * j});
      if (!(p.z() > 0.0) || p.head<2>().norm() > 0.98 * reach * p.z()) continue;
      Eigen::Vector2d wanted;
      Eigen::Vector2d without;
      if (!base::project_bare(from, lens.data(), p.data(), wanted.data(), nullptr, nullptr) ||
          !base::project_bare(spline, result.data(), p.data(), without.data(), d_point.data(), rows.data())) {
        continue;
      }
      normal.noalias() += rows.rightCols(free).transpose() * rows.rightCols(free);
      right.noalias() += rows.rightCols(free).transpose() * (wanted - without);
    }
  }
  result.tail(free) = normal.ldlt().solve(right);
  return result;
}

}  // namespace crosstie::calib::detail
