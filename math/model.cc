#include "math/model.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace crosstie::math {
namespace {

std::vector<int> all_of(int count) {
  std::vector<int> indices(static_cast<std::size_t>(count));
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

/// Room for one measurement's evaluation.
struct Scratch {
  std::vector<const double*> values;
  std::vector<std::vector<double>> jacobians;
  std::vector<double*> jacobian_pointers;
  std::vector<int> free_blocks;
  std::vector<int> sizes;

  void prepare(const Model& model, const Measurement& measurement) {
    values.clear();
    jacobian_pointers.clear();
    if (jacobians.size() < measurement.blocks().size()) jacobians.resize(measurement.blocks().size());
    for (std::size_t i = 0; i < measurement.blocks().size(); ++i) {
      const Block& block = model.blocks[static_cast<std::size_t>(measurement.blocks()[i])];
      values.push_back(block.values.data());
      jacobians[i].resize(static_cast<std::size_t>(measurement.rows() * block.tangent_size()));
      jacobian_pointers.push_back(block.free.empty() ? nullptr : jacobians[i].data());
    }
  }
};

}  // namespace

Block pose_block(std::string name, const base::Pose& pose) {
  Block block{std::move(name),
              Block::Kind::kPose,
              std::vector<double>(7),
              {"rx [rad]", "ry [rad]", "rz [rad]", "tx [mm]", "ty [mm]", "tz [mm]"},
              all_of(6),
              BlockRole::kKept};
  pose_to_values(pose, block.values.data());
  return block;
}

Block point_block(std::string name, const Eigen::Vector3d& point) {
  return {std::move(name), Block::Kind::kPoint,   {point.x(), point.y(), point.z()}, {"x [mm]", "y [mm]", "z [mm]"},
          all_of(3),       BlockRole::kEliminated};
}

base::Pose pose_from_values(const double* values) {
  return {Eigen::Quaterniond(values[3], values[0], values[1], values[2]), Eigen::Vector3d(values[4], values[5], values[6])};
}

void pose_to_values(const base::Pose& pose, double* values) {
  Eigen::Map<Eigen::Vector4d>(values, 4) = pose.rotation.coeffs();
  Eigen::Map<Eigen::Vector3d>(values + 4, 3) = pose.translation_mm;
}

int Model::add(Block block) {
  blocks.push_back(std::move(block));
  return static_cast<int>(blocks.size()) - 1;
}

Parameters Model::parameters() const {
  Parameters parameters;
  for (const Block& block : blocks) {
    std::vector<std::string> names;
    for (const int i : block.free) names.push_back(block.components[static_cast<std::size_t>(i)]);
    parameters.add(block.name, std::move(names), block.role);
  }
  return parameters;
}

bool Model::linearise(WhitenedRows& rows) const {
  return std::all_of(measurements.begin(), measurements.end(),
                     [&](const auto& measurement) { return linearise(*measurement, rows); });
}

bool Model::linearise(const Measurement& measurement, WhitenedRows& rows) const {
  thread_local Scratch scratch;
  scratch.prepare(*this, measurement);
  scratch.free_blocks.clear();
  scratch.sizes.clear();
  for (const int b : measurement.blocks()) {
    const Block& block = blocks[static_cast<std::size_t>(b)];
    if (block.free.empty()) continue;
    scratch.free_blocks.push_back(b);
    scratch.sizes.push_back(static_cast<int>(block.free.size()));
  }
  const int group = rows.add(measurement.rows(), scratch.free_blocks, scratch.sizes);
  if (!measurement.evaluate(scratch.values.data(), rows.residual(group).data(), scratch.jacobian_pointers.data())) return false;
  std::size_t term = 0;
  for (std::size_t i = 0; i < measurement.blocks().size(); ++i) {
    const Block& block = blocks[static_cast<std::size_t>(measurement.blocks()[i])];
    if (block.free.empty()) continue;
    const Eigen::Map<const WhitenedRows::Matrix> all(scratch.jacobians[i].data(), measurement.rows(), block.tangent_size());
    auto part = rows.jacobian(group, term++);
    for (std::size_t k = 0; k < block.free.size(); ++k) part.col(static_cast<Eigen::Index>(k)) = all.col(block.free[k]);
  }
  return true;
}

double Model::square_sum() const {
  Scratch scratch;
  double sum = 0.0;
  for (const auto& measurement : measurements) {
    scratch.prepare(*this, *measurement);
    Eigen::VectorXd residual(measurement->rows());
    if (!measurement->evaluate(scratch.values.data(), residual.data(), nullptr)) return std::numeric_limits<double>::infinity();
    sum += residual.squaredNorm();
  }
  return sum;
}

void Model::move(const Eigen::VectorXd& step) {
  Eigen::Index offset = 0;
  for (Block& block : blocks) {
    Eigen::VectorXd tangent = Eigen::VectorXd::Zero(block.tangent_size());
    for (const int i : block.free) tangent(i) = step(offset++);
    if (block.free.empty()) continue;
    if (block.is_pose()) {
      pose_to_values(base::perturbed(pose_from_values(block.values.data()), tangent), block.values.data());
    } else {
      Eigen::Map<Eigen::VectorXd>(block.values.data(), block.tangent_size()) += tangent;
    }
  }
}

}  // namespace crosstie::math
