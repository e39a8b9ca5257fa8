#include "calib/detail/board_model.h"

#include <memory>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "calib/detail/spline_lens.h"
#include "math/image_point.h"
#include "math/prior.h"

namespace crosstie::calib::detail {
namespace {

/// What is known of a point of the board: blocks point, modes.
///     residual = (X - N - sum of a_m F_m) / sigma
class BoardPoint final : public math::Measurement {
 public:
  /// `fields` has the displacement of this point by each mode as columns.
  BoardPoint(std::vector<int> blocks, const Eigen::Vector3d& nominal, Eigen::Matrix3Xd fields, double sigma_mm)
      : Measurement(std::move(blocks)), nominal_(nominal), fields_(std::move(fields)), weight_(1.0 / sigma_mm) {}

  [[nodiscard]] int rows() const override { return 3; }
  bool evaluate(const double* const* values, double* residual, double* const* jacobians) const override {
    Eigen::Vector3d difference = Eigen::Map<const Eigen::Vector3d>(values[0]) - nominal_;
    if (fields_.cols() > 0) difference -= fields_ * Eigen::Map<const Eigen::VectorXd>(values[1], fields_.cols());
    Eigen::Map<Eigen::Vector3d>(residual, 3) = weight_ * difference;
    if (jacobians == nullptr) return true;
    if (jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(jacobians[0], 3, 3) = weight_ * Eigen::Matrix3d::Identity();
    }
    if (fields_.cols() > 0 && jacobians[1] != nullptr) {
      using RowMajor = Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor>(jacobians[1], 3, fields_.cols()) = -weight_ * fields_;
    }
    return true;
  }

 private:
  Eigen::Vector3d nominal_;
  Eigen::Matrix3Xd fields_;
  double weight_;
};

std::vector<int> all_of(int count) {
  std::vector<int> indices(static_cast<std::size_t>(count));
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

math::Block camera_block(const std::string& name, base::LensModel lens, const Eigen::VectorXd& values, bool hold) {
  math::Block block;
  block.name = "camera " + name;
  block.values.assign(values.data(), values.data() + values.size());
  const auto names = base::parameter_names(lens);
  const auto units = base::parameter_units(lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    block.components.push_back(units[i].empty() ? std::string(names[i]) : fmt::format("{} [{}]", names[i], units[i]));
  }
  if (!hold) block.free = all_of(base::adjustable_count(lens));
  return block;
}

/// The denominator of a rational lens is hardly told from its numerator: k1 and k4 take each other's part up without end. What is
/// known of its terms beforehand is that they are some tenths.
void add_denominator(base::LensModel lens, int camera, BoardModel& network) {
  constexpr double kSigma = 0.3;
  const auto names = base::parameter_names(lens);
  std::vector<Eigen::Index> terms;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] == "k4" || names[i] == "k5" || names[i] == "k6") terms.push_back(static_cast<Eigen::Index>(i));
  }
  if (terms.empty()) return;
  const auto count = static_cast<Eigen::Index>(names.size());
  Eigen::MatrixXd whitening = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(terms.size()), count);
  for (std::size_t i = 0; i < terms.size(); ++i) whitening(static_cast<Eigen::Index>(i), terms[i]) = 1.0 / kSigma;
  network.model.measurements.push_back(std::make_unique<math::Prior>(
      std::vector<int>{camera}, std::vector<int>{static_cast<int>(count)}, Eigen::VectorXd::Zero(count), whitening));
  network.corner_of_measurement.push_back(-1);
}

/// What is known of a splined lens beforehand: that its control points do not leave those of an OpenCV lens far behind.
void add_control_points(const Eigen::VectorXd& mean, int camera, BoardModel& network) {
  const Eigen::Index count = mean.size();
  Eigen::MatrixXd whitening = Eigen::MatrixXd::Zero(count - 4, count);
  whitening.rightCols(count - 4).diagonal().setConstant(mean(0) / kSplineSigma_px);
  network.model.measurements.push_back(std::make_unique<math::Prior>(
      std::vector<int>{camera}, std::vector<int>{static_cast<int>(count)}, mean, std::move(whitening)));
  network.corner_of_measurement.push_back(-1);
}

void add_board(const Problem& problem, const State& state, bool hold, BoardModel& network) {
  const bool modes = !hold && !problem.modes.empty();
  if (modes) {
    const auto count = static_cast<Eigen::Index>(problem.modes.size());
    math::Block block;
    block.name = "board";
    block.values.assign(state.modes.data(), state.modes.data() + state.modes.size());
    Eigen::VectorXd weights(count);
    for (Eigen::Index m = 0; m < count; ++m) {
      const base::BoardMode& mode = problem.modes[static_cast<std::size_t>(m)];
      block.components.push_back(fmt::format("{} [{}]", mode.name, mode.unit));
      weights(m) = 1.0 / mode.sigma;
    }
    block.free = all_of(static_cast<int>(count));
    network.mode_block = network.model.add(std::move(block));
    network.model.measurements.push_back(std::make_unique<math::Prior>(std::vector<int>{network.mode_block},
                                                                       std::vector<int>{static_cast<int>(count)},
                                                                       Eigen::VectorXd::Zero(count), weights.asDiagonal()));
    network.corner_of_measurement.push_back(-1);
  }
}

void add_points(const Problem& problem, const State& state, bool hold, BoardModel& network) {
  for (Eigen::Index i = 0; i < state.points.cols(); ++i) {
    math::Block block = math::point_block(fmt::format("corner {}", i), state.points.col(i));
    if (hold) block.free.clear();
    const int index = network.model.add(std::move(block));
    network.point_block.push_back(index);
    if (hold) continue;
    std::vector<int> blocks{index};
    Eigen::Matrix3Xd fields(3, network.mode_block >= 0 ? static_cast<Eigen::Index>(problem.modes.size()) : 0);
    for (Eigen::Index m = 0; m < fields.cols(); ++m) {
      fields.col(m) = problem.modes[static_cast<std::size_t>(m)].displacement.col(i);
    }
    if (fields.cols() > 0) blocks.push_back(network.mode_block);
    network.model.measurements.push_back(std::make_unique<BoardPoint>(std::move(blocks), problem.nominal.col(i),
                                                                      std::move(fields), problem.board.prior.sigma_mm));
    network.corner_of_measurement.push_back(-1);
  }
}

}  // namespace

BoardModel build_model(const Problem& problem, const State& state, const ModelPlan& plan) {
  BoardModel network;
  const bool hold_board = plan.hold_board || !problem.board.free;
  const auto chosen = [&](std::size_t s) { return plan.stations.empty() || plan.stations[s] != 0; };
  for (std::size_t c = 0; c < problem.cameras.size(); ++c) {
    network.camera_block.push_back(
        network.model.add(camera_block(problem.cameras[c], state.lens_model, state.lenses[c], plan.hold_lenses)));
    if (plan.hold_lenses) continue;
    add_denominator(state.lens_model, network.camera_block.back(), network);
    if (state.lens_model.is_splined()) add_control_points(state.lens_means[c], network.camera_block.back(), network);
  }
  bool joint = false;
  for (std::size_t s = 0; s < problem.stations.size(); ++s)
    joint = joint || (chosen(s) && is_joint(state, problem.stations[s]));
  if (joint) {
    math::Block mount = math::pose_block("rig", *state.left_from_right);
    mount.kind = math::Block::Kind::kMount;
    network.mount_block = network.model.add(std::move(mount));
  }
  add_board(problem, state, hold_board, network);

  network.view_block.assign(problem.views.size(), -1);
  std::vector<char> mounted(problem.views.size(), 0);
  for (std::size_t s = 0; s < problem.stations.size(); ++s) {
    if (!chosen(s)) continue;
    const Station& station = problem.stations[s];
    if (is_joint(state, station)) {
      const auto left = static_cast<std::size_t>(station.view[0]);
      const auto right = static_cast<std::size_t>(station.view[1]);
      network.view_block[left] = network.view_block[right] =
          network.model.add(math::pose_block("station " + station.name, *state.board_from_camera[left]));
      mounted[right] = 1;
      continue;
    }
    for (const int v : station.view) {
      if (v < 0 || !state.takes_part(v)) continue;
      const auto view = static_cast<std::size_t>(v);
      network.view_block[view] =
          network.model.add(math::pose_block("image " + problem.views[view].image, *state.board_from_camera[view]));
    }
  }
  add_points(problem, state, hold_board, network);

  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (network.view_block[v] < 0) continue;
    const View& view = problem.views[v];
    for (const int c : view.corners) {
      if (!state.active[static_cast<std::size_t>(c)]) continue;
      const Corner& corner = problem.corners[static_cast<std::size_t>(c)];
      const math::ImagePoint::Blocks blocks{network.camera_block[static_cast<std::size_t>(view.camera)], network.view_block[v],
                                            network.point_block[static_cast<std::size_t>(corner.point)],
                                            mounted[v] ? network.mount_block : -1};
      const double weight = 1.0 / (state.sigma_px * corner.relative_sigma);
      network.model.measurements.push_back(
          std::make_unique<math::ImagePoint>(blocks, state.lens_model, corner.px, weight * Eigen::Matrix2d::Identity()));
      network.corner_of_measurement.push_back(c);
    }
  }
  return network;
}

void read_back(const Problem& problem, const BoardModel& network, State& state) {
  const auto values = [&](int block) { return network.model.blocks[static_cast<std::size_t>(block)].values.data(); };
  for (std::size_t c = 0; c < network.camera_block.size(); ++c) {
    state.lenses[c] = Eigen::Map<const Eigen::VectorXd>(values(network.camera_block[c]), state.lenses[c].size());
  }
  if (network.mount_block >= 0) state.left_from_right = math::pose_from_values(values(network.mount_block));
  if (network.mode_block >= 0) {
    state.modes = Eigen::Map<const Eigen::VectorXd>(values(network.mode_block), state.modes.size());
  }
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (network.view_block[v] < 0) continue;
    const Station& station = problem.stations[static_cast<std::size_t>(problem.views[v].station)];
    const base::Pose pose = math::pose_from_values(values(network.view_block[v]));
    const bool by_mount = problem.views[v].camera == 1 && network.mount_block >= 0 && station.paired() &&
                          network.view_block[static_cast<std::size_t>(station.view[0])] == network.view_block[v];
    state.board_from_camera[v] = by_mount ? pose * *state.left_from_right : pose;
  }
  for (std::size_t p = 0; p < network.point_block.size(); ++p) {
    state.points.col(static_cast<Eigen::Index>(p)) = Eigen::Map<const Eigen::Vector3d>(values(network.point_block[p]));
  }
}

}  // namespace crosstie::calib::detail
