// Calibration and commissioning of the twin's machine by sampled observations (no photographs are rendered): are the head's place and the
// error motions of its axis what the twin did, over many seeds?

#include <cmath>
#include <set>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "math/distributions.h"
#include "tests/bundle/seeds.h"
#include "tests/support/normalised_square.h"
#include "tests/support/twin_commissioning.h"

namespace crosstie {
namespace {

/// The scene with fewer poses of the board, which is all that takes time here.
fixtures::Scene machine_of_few_boards() {
  fixtures::Scene scene = fixtures::make_scene("machine").value();
  scene.board->rig_from_board.resize(12);
  return scene;
}

/// As the detector measures the twin's photographs, and ten times worse.
class TwinAxis : public testing::TestWithParam<double> {};

TEST_P(TwinAxis, IsFoundAsItIsAndNothingElse) {
  const fixtures::Scene described = machine_of_few_boards();
  const int seeds = tests::seeds(20);
  double square = 0.0;
  int tested = 0;
  int accused = 0;
  std::string wrong;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto number = static_cast<std::uint64_t>(seed);
    const fixtures::Scene scene = fixtures::drawn(described, number);
    const auto input = tests::twin_commission_input(scene, {.corner_px = 0.03, .marker_px = GetParam()}, number);
    ASSERT_TRUE(input) << input.error().message;
    const auto result = bundle::commission(*input);
    ASSERT_TRUE(result) << result.error().message;
    const base::LinearAxis& axis = result->frame.axis;
    // The twin pitches and is not straight in Y. About a point of the working volume, 1.2 m from its pivot, its pitch is also a shift in Z.
    const std::set<std::string> there = {"EYX2", "EBX1", "EBX2", "EZX2", "EZX3"};
    for (const base::ErrorMotion& term : axis.terms) {
      const std::string name = term.name + std::to_string(term.order);
      if (there.contains(name)) continue;
      ++tested;
      accused += term.significant ? 1 : 0;
      if (term.significant) wrong += " " + name;
    }
    const double reading_mm = axis.from_mm + 0.37 * (axis.to_mm - axis.from_mm);
    const auto pose = result->frame.at(reading_mm);
    ASSERT_TRUE(pose);
    square +=
        tests::normalised_square(pose->machine_from_rig, fixtures::machine_from_rig(*scene.machine, reading_mm), pose->cov);
  }
  std::printf(
      "marker noise %g px, %d seeds: normalised square of machine_from_rig %.2f of 6; %d of %d error motions that are not "
      "there:%s\n",
      GetParam(), seeds, square / seeds, accused, tested, wrong.c_str());
  EXPECT_GT(square, math::chi_square_quantile(0.0005, 6.0 * seeds));
  EXPECT_LT(square, math::chi_square_quantile(0.9995, 6.0 * seeds));
  EXPECT_LE(accused, 0.001 * tested + 3.1 * std::sqrt(0.001 * tested) + 1.0);
}

INSTANTIATE_TEST_SUITE_P(Noise, TwinAxis, testing::Values(0.0025, 0.03));

}  // namespace
}  // namespace crosstie
