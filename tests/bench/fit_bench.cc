// Fits of shapes against what a user would write with Ceres: the same orthogonal distances, autodiff, start values near the truth (ours finds its own),
// and the covariance of the same parameters. Both must find the same shape.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include <ceres/ceres.h>
#include <fmt/format.h>
#include <Eigen/Geometry>

#include "math/shape_fit.h"
#include "tests/bench/table.h"

namespace crosstie::bench {
namespace {

constexpr int kRuns = 5;

struct SphereDistance {
  Eigen::Vector3d point;
  template <typename T>
  bool operator()(const T* const p, T* residual) const {
    const T x = point.x() - p[0], y = point.y() - p[1], z = point.z() - p[2];
    residual[0] = ceres::sqrt(x * x + y * y + z * z) - p[3];
    return true;
  }
};

/// Axis near z: through (p0, p1, 0) along (p2, p3, 1).
struct CylinderDistance {
  Eigen::Vector3d point;
  template <typename T>
  bool operator()(const T* const p, T* residual) const {
    const Eigen::Matrix<T, 3, 1> d(p[2], p[3], T(1.0));
    const Eigen::Matrix<T, 3, 1> v(point.x() - p[0], point.y() - p[1], T(point.z()));
    residual[0] = v.cross(d).norm() / d.norm() - p[4];
    return true;
  }
};

/// Milliseconds of a plain least-squares problem with its covariance; its last parameter, the radius.
template <typename Cost, int kParameters>
double plain(const std::vector<Eigen::Vector3d>& points, std::vector<double>& p) {
  return millis_of([&] {
    ceres::Problem problem;
    for (const Eigen::Vector3d& point : points)
      problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Cost, 1, kParameters>(new Cost{point}), nullptr, p.data());
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.num_threads = 1;
    options.function_tolerance = options.parameter_tolerance = 1e-14;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    ceres::Covariance::Options with;
    with.num_threads = 1;
    ceres::Covariance covariance(with);
    const std::vector<std::pair<const double*, const double*>> blocks = {{p.data(), p.data()}};
    if (!covariance.Compute(blocks, &problem)) std::printf("no covariance\n");
  });
}

void compare(int count) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, 0.02);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  std::vector<Eigen::Vector3d> sphere, cylinder;
  for (int i = 0; i < count; ++i) {
    const double z = 0.8 * uniform(random), phi = 2.0 * uniform(random);
    const double r = std::sqrt(1.0 - z * z);
    sphere.emplace_back((50.0 + normal(random)) * Eigen::Vector3d(r * std::cos(phi), r * std::sin(phi), z) +
                        Eigen::Vector3d(10, 20, 30));
    cylinder.emplace_back(
        Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()) *
        Eigen::Vector3d((150.0 + normal(random)) * std::cos(phi), (150.0 + normal(random)) * std::sin(phi), 300.0 * z));
  }
  std::vector<double> ours, theirs;
  double difference = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    double radius = 0.0;
    ours.push_back(millis_of([&] { radius = math::fit_sphere(sphere)->shape.radius_mm; }));
    std::vector<double> p = {10.5, 19.5, 30.5, 49.0};
    theirs.push_back(plain<SphereDistance, 4>(sphere, p));
    difference = std::abs(radius - p[3]);
  }
  print_row(fmt::format("sphere, {} points [ms]; radii {:.0e} mm apart", count, difference).c_str(), median_of(ours),
            median_of(theirs));
  ours.clear();
  theirs.clear();
  for (int run = 0; run < kRuns; ++run) {
    double radius = 0.0;
    ours.push_back(millis_of([&] { radius = math::fit_cylinder(cylinder)->shape.radius_mm; }));
    std::vector<double> p = {0.5, -0.5, 0.01, -0.09, 149.0};
    theirs.push_back(plain<CylinderDistance, 5>(cylinder, p));
    difference = std::abs(radius - p[4]);
  }
  print_row(fmt::format("cylinder, {} points [ms]; radii {:.0e} mm apart", count, difference).c_str(), median_of(ours),
            median_of(theirs));
}

}  // namespace
}  // namespace crosstie::bench

int main() {
  using namespace crosstie::bench;
  print_heading("plain Ceres: autodiff, a good start, covariance; one thread");
  for (const int count : {100, 10000, 100000}) compare(count);
  return 0;
}
