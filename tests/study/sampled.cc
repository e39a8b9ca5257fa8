#include "tests/study/sampled.h"

#include <array>
#include <vector>

#include <fmt/format.h>

#include "bundle/commission.h"
#include "fixtures/varied.h"
#include "math/head_point.h"
#include "tests/study/statistics.h"
#include "tests/support/normalised_square.h"
#include "tests/support/twin_commissioning.h"

namespace crosstie::study {
namespace {

/// Poses of the head at these readings, from a frame, against the truth.
Square square_of(const fixtures::Scene& scene, const base::MachineFrame& frame, const std::vector<double>& readings_mm) {
  const auto rows = static_cast<Eigen::Index>(6 * readings_mm.size());
  Eigen::VectorXd error(rows);
  Eigen::MatrixXd by(rows, frame.cov.rows());
  for (std::size_t i = 0; i < readings_mm.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(6 * i);
    error.segment<6>(at) = base::difference(fixtures::machine_from_rig(*scene.machine, readings_mm[i]),
                                            frame.at(readings_mm[i])->machine_from_rig);
    by.middleRows<6>(at) = frame.jacobian(readings_mm[i]);
  }
  return {tests::normalised_square(error, by * frame.cov * by.transpose()), static_cast<double>(rows)};
}

}  // namespace

int sampled_frames(std::uint64_t first, std::uint64_t last) {
  constexpr std::array<const char*, 4> kNames = {"middle", "beginning, middle, end", "lenses and rig", "without small motions"};
  std::array<std::vector<Square>, 4> squares;
  for (std::uint64_t seed = first; seed <= last; ++seed) {
    const fixtures::Scene scene = fixtures::drawn(fixtures::varied(*fixtures::make_scene("study"), seed), seed);
    const auto input = tests::twin_commission_input(scene, {.corner_px = 0.004, .marker_px = 0.0035}, seed);
    if (!input) continue;
    const auto found = bundle::commission(*input);
    const auto plain = bundle::commission(*input, {.small_motions = false});
    if (!found || !plain) continue;
    const base::LinearAxis& axis = found->frame.axis;
    const std::vector<double> all = {axis.from_mm, axis.middle_mm(), axis.to_mm};
    squares[0].push_back(square_of(scene, found->frame, {axis.middle_mm()}));
    squares[1].push_back(square_of(scene, found->frame, all));
    base::Head truth = found->head;
    truth.left = *scene.cameras[0].camera;
    truth.right = *scene.cameras[1].camera;
    truth.right_from_left = scene.head->right_from_left;
    squares[2].push_back({tests::normalised_square(math::head_change(truth, found->head), found->head.cov), 24.0});
    squares[3].push_back(square_of(scene, plain->frame, {axis.middle_mm()}));
  }
  for (std::size_t i = 0; i < squares.size(); ++i) {
    const MeanSquare mean = mean_square(squares[i], 0.99);
    fmt::print("{:24} {} seeds: {:.2f} ({:.2f} to {:.2f})\n", kNames[i], squares[i].size(), mean.mean, mean.expected.low,
               mean.expected.high);
  }
  return 0;
}

}  // namespace crosstie::study
