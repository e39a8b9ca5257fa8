#include "scan/detail/marker_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "math/median.h"

namespace crosstie::scan::detail {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kGate = 4.0;  // sigmas
constexpr std::size_t kLeastSamples = 30;
constexpr int kSectors = 8;
constexpr int kLeastSectors = 5;
constexpr std::ptrdiff_t kLeastPerSector = 3;

/// z = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2 in a frame about the point whose z axis is `normal`; x and y in units of `reach`.
struct LocalFit {
  Vector6 c = Vector6::Zero();
  Matrix6 cofactor = Matrix6::Zero();
  double scatter = 1.0;  ///< rms of residuals over sigmas
  std::vector<char> used;
};

struct Local {
  Eigen::Vector3d p;
  double sigma;
};

Vector6 row_of(const Eigen::Vector3d& p, int order) {
  Vector6 row;
  row << 1.0, p.x(), p.y(), p.x() * p.x(), p.x() * p.y(), p.y() * p.y();
  if (order == 1) row.tail<3>().setZero();
  return row;
}

/// Weighted least squares of this order with weights w; coefficients that are not of the order stay 0.
std::optional<LocalFit> solve(const std::vector<Local>& samples, const std::vector<double>& weights, int order) {
  Matrix6 normal = Matrix6::Zero();
  Vector6 right = Vector6::Zero();
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (weights[i] == 0.0) continue;
    const Vector6 row = row_of(samples[i].p, order);
    normal += weights[i] * row * row.transpose();
    right += weights[i] * samples[i].p.z() * row;
  }
  if (order == 1) normal.diagonal().tail<3>().setOnes();
  const Eigen::LDLT<Matrix6> ldlt(normal);
  if (!(ldlt.vectorD().minCoeff() > 1e-9 * ldlt.vectorD().maxCoeff())) return {};
  LocalFit fit;
  fit.c = ldlt.solve(right);
  fit.cofactor = ldlt.solve(Matrix6::Identity());
  return fit;
}

/// Without what lies on other surfaces: least absolute residuals first, then those within the gate.
std::optional<LocalFit> robust_fit(const std::vector<Local>& samples, int order) {
  constexpr int kRounds = 8;
  std::vector<double> weights(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) weights[i] = 1.0 / (samples[i].sigma * samples[i].sigma);
  auto fit = solve(samples, weights, order);
  std::vector<double> ratios(samples.size());
  for (int round = 0; fit && round < 2 * kRounds; ++round) {
    for (std::size_t i = 0; i < samples.size(); ++i)
      ratios[i] = std::abs(samples[i].p.z() - row_of(samples[i].p, order).dot(fit->c)) / samples[i].sigma;
    std::vector<double> ordered = ratios;
    const double spread = std::max(1.0, 1.4826 * math::median(ordered));
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double own = 1.0 / (samples[i].sigma * samples[i].sigma);
      weights[i] = round < kRounds ? own / std::max(1.0, ratios[i] / spread) : (ratios[i] < kGate * spread ? own : 0.0);
    }
    fit = solve(samples, weights, order);
  }
  if (!fit) return {};
  double squares = 0.0;
  double count = 0.0;
  fit->used.resize(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    fit->used[i] = weights[i] > 0.0;
    if (!fit->used[i]) continue;
    squares += weights[i] * std::pow(samples[i].p.z() - row_of(samples[i].p, order).dot(fit->c), 2);
    count += 1.0;
  }
  if (count < static_cast<double>(kLeastSamples)) return {};
  fit->scatter = std::sqrt(squares / (count - (order == 1 ? 3.0 : 6.0)));
  return fit;
}

bool all_round(const std::vector<Local>& samples, const std::vector<char>& used) {
  std::array<std::ptrdiff_t, kSectors> counts = {};
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!used[i]) continue;
    const double turns = std::atan2(samples[i].p.y(), samples[i].p.x()) / (2.0 * std::numbers::pi) + 0.5;
    ++counts[std::min<std::size_t>(kSectors - 1, static_cast<std::size_t>(turns * kSectors))];
  }
  return std::count_if(counts.begin(), counts.end(), [](std::ptrdiff_t n) { return n >= kLeastPerSector; }) >= kLeastSectors;
}

}  // namespace

PixelIndex::PixelIndex(const ScanCloud& scan, int width_px)
    : width_(static_cast<std::size_t>(width_px)), points_(scan.depth_mm.size(), -1), sigma_mm_(nullptr) {
  const std::vector<double>* column = nullptr;
  const std::vector<double>* row = nullptr;
  for (const base::CloudField& field : scan.cloud.fields) {
    if (field.name == "column") column = &field.values;
    if (field.name == "row") row = &field.values;
    if (field.name == "sigma_mm") sigma_mm_ = &field.values;
  }
  for (std::size_t i = 0; i < scan.cloud.points.size(); ++i)
    points_[static_cast<std::size_t>((*row)[i]) * width_ + static_cast<std::size_t>((*column)[i])] =
        static_cast<std::int32_t>(i);
}

std::optional<std::size_t> PixelIndex::at(int column, int row) const {
  const std::int32_t point = points_[static_cast<std::size_t>(row) * width_ + static_cast<std::size_t>(column)];
  if (point < 0) return {};
  return static_cast<std::size_t>(point);
}

std::optional<SurfaceBeneath> surface_beneath(const std::vector<SurfaceSample>& samples, const Eigen::Vector3d& p_in_rig_mm) {
  constexpr int kTurns = 4;  // of the frame towards the surface's normal
  if (samples.size() < kLeastSamples) return {};
  double reach = 0.0;
  for (const SurfaceSample& sample : samples) reach += (sample.p_in_rig_mm - p_in_rig_mm).norm();
  reach = std::max(1e-9, reach / static_cast<double>(samples.size()));
  Eigen::Vector3d normal = -p_in_rig_mm.normalized();
  std::vector<Local> local(samples.size());
  std::optional<LocalFit> fit;
  for (int turn = 0; turn < kTurns; ++turn) {
    const Eigen::Vector3d x = normal.unitOrthogonal();
    const Eigen::Vector3d y = normal.cross(x);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const Eigen::Vector3d d = samples[i].p_in_rig_mm - p_in_rig_mm;
      const double across = std::abs(samples[i].p_in_rig_mm.normalized().dot(normal));
      local[i] = {{d.dot(x) / reach, d.dot(y) / reach, d.dot(normal)}, std::max(1e-9, samples[i].sigma_mm * across)};
    }
    fit = robust_fit(local, turn == 0 ? 1 : 2);
    if (!fit) return {};
    if (turn + 1 < kTurns) normal = (normal - fit->c(1) / reach * x - fit->c(2) / reach * y).normalized();
  }
  if (!all_round(local, fit->used)) return {};
  return SurfaceBeneath{normal, -fit->c(0), fit->cofactor(0, 0) * std::pow(std::max(1.0, fit->scatter), 2)};
}

}  // namespace crosstie::scan::detail
