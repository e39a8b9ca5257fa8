#include "registration/merge.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "registration/detail/station_shared.h"

namespace crosstie::registration {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using Eigen::Vector3d;

constexpr std::int64_t kOrigin = 1 << 20;  // so that cells count from 0 on both sides of the frame's origin
constexpr std::int64_t kMost = 1 << 21;
constexpr double kLeastNoise_mm = 1e-6;

/// What became of the points of one cube.
struct Cell {
  Vector3d sum = Vector3d::Zero();  ///< of weight * point
  double weight = 0.0;
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  Eigen::Matrix<float, 6, 1> noise = Eigen::Matrix<float, 6, 1>::Zero();   ///< sum of weight^2 * covariance: xx xy xz yy yz zz
  Eigen::Matrix<float, 6, 1> shared = Eigen::Matrix<float, 6, 1>::Zero();  ///< of the station that weighs most
  float most_weight = 0.0F;
  float difference = 0.0F;
  std::uint32_t points = 0;
  std::uint16_t stations = 0;
};

Eigen::Matrix<float, 6, 1> six(const Eigen::Matrix3d& m) {
  Eigen::Matrix<double, 6, 1> values;
  values << m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2);
  return values.cast<float>();
}

Eigen::Matrix3d nine(const Eigen::Matrix<float, 6, 1>& six_values) {
  const Eigen::Matrix<double, 6, 1> v = six_values.cast<double>();
  Eigen::Matrix3d m;
  m << v(0), v(1), v(2), v(1), v(3), v(4), v(2), v(4), v(5);
  return m;
}

/// Cells by their key: open addressing, in the order of their arrival.
class CellTable {
 public:
  Cell& at(std::uint64_t key) {
    if (2 * (cells_.size() + 1) > slots_.size()) grow();
    std::uint32_t& slot = find(key);
    if (slot == kEmpty) {
      slot = static_cast<std::uint32_t>(cells_.size());
      keys_.push_back(key);
      cells_.emplace_back();
    }
    return cells_[slot];
  }
  std::vector<Cell>& cells() { return cells_; }

 private:
  static constexpr std::uint32_t kEmpty = 0xffffffffU;

  std::uint32_t& find(std::uint64_t key) {
    const std::size_t mask = slots_.size() - 1;
    std::size_t at = static_cast<std::size_t>((key * 0x9e3779b97f4a7c15ULL) >> 32U) & mask;
    while (slots_[at] != kEmpty && keys_[slots_[at]] != key) at = (at + 1) & mask;
    return slots_[at];
  }
  void grow() {
    slots_.assign(std::max<std::size_t>(1U << 16U, 2 * slots_.size()), kEmpty);
    for (std::size_t i = 0; i < keys_.size(); ++i) find(keys_[i]) = static_cast<std::uint32_t>(i);
  }

  std::vector<std::uint32_t> slots_;
  std::vector<std::uint64_t> keys_;
  std::vector<Cell> cells_;
};

/// A symmetric 3x3 matrix's largest standard deviation.
double largest_sigma(const Eigen::Matrix3d& cov) {
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(cov, Eigen::EigenvaluesOnly).eigenvalues()(2)));
}

/// The points of one station in one cube.
struct Group {
  Vector3d sum = Vector3d::Zero();
  double weight = 0.0;
  Vector3d normal = Vector3d::Zero();
  Eigen::Matrix3d noise = Eigen::Matrix3d::Zero();
  std::uint32_t points = 0;
};

void fold(const Group& group, const Eigen::Matrix3d& shared, Cell& cell) {
  const Vector3d mean = group.sum / group.weight;
  const Vector3d direction = (cell.normal.cast<double>() + group.normal);
  if (cell.stations > 0 && direction.norm() > 0.0) {
    const Vector3d n = direction.normalized();
    const double before = n.dot(nine(cell.noise) * n) / (cell.weight * cell.weight);
    const double now = n.dot(group.noise * n) / (group.weight * group.weight);
    const double difference = n.dot(mean - cell.sum / cell.weight) / std::sqrt(std::max(1e-300, before + now));
    if (std::abs(difference) > std::abs(static_cast<double>(cell.difference))) cell.difference = static_cast<float>(difference);
  }
  cell.sum += group.sum;
  cell.weight += group.weight;
  cell.normal += group.normal.cast<float>();
  cell.noise += six(group.noise);
  cell.points += group.points;
  ++cell.stations;
  if (static_cast<float>(group.weight) > cell.most_weight) {
    cell.most_weight = static_cast<float>(group.weight);
    cell.shared = six(shared);
  }
}

const std::vector<double>* field(const base::Cloud& cloud, std::string_view name) {
  for (const base::CloudField& candidate : cloud.fields) {
    if (candidate.name == name) return &candidate.values;
  }
  return nullptr;
}

}  // namespace

struct CloudMerger::State {
  const base::Stitching& stitching;
  MergeOptions options;
  std::optional<base::Head> head;
  CellTable table = {};
  std::vector<bool> added = {};
};

Result<> MergeOptions::validate() const {
  if (!(cell_mm > 0.0) || !std::isfinite(cell_mm))
    return fail(ErrorCode::kUsage, fmt::format("cell_mm is {}, it must be positive", cell_mm));
  if (sigma_mm && !(*sigma_mm > 0.0))
    return fail(ErrorCode::kUsage, fmt::format("sigma_mm is {}, it must be positive", *sigma_mm));
  return {};
}

CloudMerger::CloudMerger(const base::Stitching& stitching, const MergeOptions& options, std::optional<base::Head> head)
    : state_(std::make_unique<State>(State{stitching, options, std::move(head)})) {
  state_->added.assign(stitching.stations.size(), false);
}
CloudMerger::CloudMerger(CloudMerger&&) noexcept = default;
CloudMerger::~CloudMerger() = default;

Result<> CloudMerger::add(int station, const base::Cloud& cloud) {
  if (auto ok = state_->options.validate(); !ok) return ok;
  const auto index = static_cast<std::size_t>(station);
  if (station < 0 || index >= state_->added.size() || state_->added[index]) {
    return fail(ErrorCode::kInternal, fmt::format("station {} does not exist or was merged before", station));
  }
  state_->added[index] = true;
  if (cloud.points.empty()) return {};
  const std::vector<double>* sigma = field(cloud, "sigma_mm");
  if (sigma == nullptr && !state_->options.sigma_mm) {
    return fail(ErrorCode::kBadInput, fmt::format("the cloud of station '{}' has no field sigma_mm; say a sigma for its points",
                                                  state_->stitching.stations[index].name));
  }
  const base::Stitching& stitching = state_->stitching;
  const base::Pose& machine_from_rig = stitching.stations[index].machine_from_rig;
  const detail::StationShared shared(stitching, station, state_->head, cloud);
  const double scatter = stitching.surface_factor * stitching.surface_factor / stitching.independent_share;

  std::vector<std::pair<std::uint64_t, std::uint32_t>> keyed(cloud.points.size());
  std::vector<Vector3d> places(cloud.points.size());
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    places[i] = machine_from_rig * (cloud.points[i] + shared.change(cloud.points[i]));
    std::uint64_t key = 0;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const double cell = std::floor(places[i](axis) / state_->options.cell_mm) + static_cast<double>(kOrigin);
      if (!(cell >= 0.0 && cell < static_cast<double>(kMost))) {
        return fail(ErrorCode::kBadInput,
                    fmt::format("point {} of station '{}' lies at {:.0f} mm: too far away for cells of {} mm", i,
                                stitching.stations[index].name, places[i](axis), state_->options.cell_mm));
      }
      key = (key << 21U) | static_cast<std::uint64_t>(cell);
    }
    keyed[i] = {key, static_cast<std::uint32_t>(i)};
  }
  std::sort(keyed.begin(), keyed.end());
  for (std::size_t begin = 0; begin < keyed.size();) {
    Group group;
    Vector3d in_rig = Vector3d::Zero();
    std::size_t end = begin;
    for (; end < keyed.size() && keyed[end].first == keyed[begin].first; ++end) {
      const std::size_t i = keyed[end].second;
      const double noise = std::max(kLeastNoise_mm, sigma != nullptr ? (*sigma)[i] : *state_->options.sigma_mm);
      const double weight = 1.0 / (noise * noise);
      const Vector3d ray = machine_from_rig.rotation * cloud.points[i].normalized();
      group.sum += weight * places[i];
      group.weight += weight;
      group.noise += (weight * scatter) * ray * ray.transpose();  // weight^2 * noise^2
      group.normal +=
          machine_from_rig.rotation * (cloud.normals.empty() ? Vector3d(-cloud.points[i].normalized()) : cloud.normals[i]);
      in_rig += cloud.points[i];
      ++group.points;
    }
    fold(group, shared.cov(in_rig / group.points), state_->table.at(keyed[begin].first));
    begin = end;
  }
  return {};
}

base::Cloud CloudMerger::finish() {
  std::vector<Cell>& cells = state_->table.cells();
  base::Cloud cloud;
  cloud.frame = state_->stitching.frame;
  const std::size_t count = cells.size();
  cloud.points.reserve(count);
  cloud.normals.reserve(count);
  cloud.cov_mm2.reserve(count);
  std::vector<double> noise(count), common(count), points(count), stations(count), difference(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Cell& cell = cells[i];
    const Vector3d sum = cell.normal.cast<double>();
    const Vector3d normal = sum.norm() > 0.0 ? Vector3d(sum.normalized()) : Vector3d(Vector3d::Zero());
    const Eigen::Matrix3d of_noise = nine(cell.noise) / (cell.weight * cell.weight);
    const Eigen::Matrix3d of_station = nine(cell.shared);
    cloud.points.emplace_back(cell.sum / cell.weight);
    cloud.normals.push_back(normal);
    cloud.cov_mm2.emplace_back(of_noise + of_station);
    noise[i] = std::sqrt(std::max(0.0, normal.dot(of_noise * normal)));
    common[i] = largest_sigma(of_station);
    points[i] = cell.points;
    stations[i] = cell.stations;
    difference[i] = static_cast<double>(cell.difference);
  }
  cloud.fields.push_back({"noise_mm", std::move(noise)});
  cloud.fields.push_back({"shared_mm", std::move(common)});
  cloud.fields.push_back({"points", std::move(points)});
  cloud.fields.push_back({"stations", std::move(stations)});
  cloud.fields.push_back({"difference", std::move(difference)});
  cells = {};
  return cloud;
}

}  // namespace crosstie::registration
