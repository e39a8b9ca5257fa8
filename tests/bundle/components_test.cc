// Variance components of a network whose stated sigmas are wrong: the truth is that of the drawing.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "bundle/adjust.h"
#include "math/distributions.h"
#include "math/rigid_alignment.h"
#include "tests/bundle/normalised_square.h"
#include "tests/bundle/seeds.h"
#include "tests/bundle/synthetic_network.h"

namespace crosstie::bundle {
namespace {

struct Truth {
  double noise_px[2] = {0.02, 0.02};  ///< of the two cameras
  double bar_sigma_mm = 0.04;         ///< the images tell their lengths far better
  double stated_px = 0.02;
  double stated_bar_mm = 0.04;
};

/// Two cameras, eight bars between opposite points of the plate; noise as `truth` has it.
tests::SyntheticNetwork drawn(const Truth& truth, std::uint64_t seed) {
  tests::SyntheticNetwork made = tests::make_synthetic({.cameras = 2,
                                                        .images = 12,
                                                        .columns = 5,
                                                        .rows = 3,
                                                        .depth_mm = 250.0,
                                                        .noise_px = 0.0,
                                                        .stated_sigma_px = truth.stated_px,
                                                        .bars = false,
                                                        .seed = seed});
  tests::Random random(5000 + seed);
  for (auto& image : made.network.images) {
    const double noise = truth.noise_px[image.camera == "c0" ? 0 : 1];
    for (auto& observation : image.observations)
      observation.centre_px += noise * Eigen::Vector2d(random.normal(), random.normal());
  }
  const std::pair<int, int> pairs[] = {{10, 24}, {14, 20}, {11, 23}, {13, 21}, {10, 14}, {20, 24}, {15, 19}, {12, 20}};
  for (const auto& [a, b] : pairs) {
    made.network.scale_bars.push_back({a, b, made.distance(a, b) + truth.bar_sigma_mm * random.normal(), truth.stated_bar_mm,
                                       20.0, 0.0, base::ScaleBarRole::kUsed, ""});
  }
  return made;
}

AdjustOptions options(VarianceComponents what) {
  return {.model_sigma_px = 0.0, .reject_outliers = false, .uncoded = false, .variance_components = what};
}

const base::VarianceComponent& of(const base::AdjustedNetwork& network, const std::string& group) {
  const auto found = std::find_if(network.variance_components.begin(), network.variance_components.end(),
                                  [&](const auto& component) { return component.group == group; });
  if (found == network.variance_components.end()) std::abort();
  return *found;
}

// The images of one camera are ten times worse than stated, the bars three times better.
constexpr Truth kWrong{.noise_px = {0.02, 0.2}, .bar_sigma_mm = 0.04, .stated_px = 0.02, .stated_bar_mm = 0.12};

TEST(Components, AreFoundWithinTheirOwnSigmas) {
  const int seeds = tests::seeds(20);
  double square[3] = {};
  double mean[3] = {};
  const char* groups[] = {"image points c0", "image points c1", "scale bars"};
  const double ratios[] = {1.0, 10.0, 1.0 / 3.0};
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto result = adjust(drawn(kWrong, static_cast<std::uint64_t>(seed)).network, options(VarianceComponents::kTell));
    ASSERT_TRUE(result) << result.error().message;
    ASSERT_EQ(result->variance_components.size(), 3U);
    EXPECT_FALSE(result->variance_components_applied);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto& component = of(*result, groups[i]);
      EXPECT_TRUE(component.estimated);
      mean[i] += component.sigma_ratio / ratios[i] / seeds;
      square[i] += std::pow(std::log(component.sigma_ratio / ratios[i]) * component.sigma_ratio / component.sigma, 2);
    }
    EXPECT_LT(of(*result, groups[1]).p, 1e-6);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(mean[i], 1.0, i == 2 ? 0.2 : 0.02) << groups[i];
    // 0.1 % of chi-square with 20 degrees of freedom; the logarithm of a chi-square variable with 7 degrees of freedom, which the bars
    // have, varies 1.16 times as much as its expansion says.
    EXPECT_LT(square[i] / seeds, i == 2 ? 1.16 * 2.27 : 2.27) << groups[i];
    EXPECT_GT(square[i] / seeds, 0.35) << groups[i];
  }
}

TEST(Components, TrueSigmasPassTheirTest) {
  int refused = 0;
  const int seeds = tests::seeds(12);
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto result = adjust(drawn({}, static_cast<std::uint64_t>(seed)).network, options(VarianceComponents::kTell));
    ASSERT_TRUE(result) << result.error().message;
    for (const auto& component : result->variance_components) {
      refused += component.p < 0.05 ? 1 : 0;
      EXPECT_LT(component.low, component.high);
    }
    EXPECT_TRUE(std::none_of(result->warnings.begin(), result->warnings.end(),
                             [](const auto& warning) { return warning.code == "sigma_ratio"; }));
  }
  EXPECT_LE(refused, 7);  // of 36; 1.8 expected, 7 at 0.3 %
}

/// Means over the seeds of e' Q^+ e of the points over its degrees of freedom, and of the square of the scale's error over its variance.
struct Normalised {
  double points = 0.0;
  double scale = 0.0;
};

Normalised normalised(const Truth& truth, VarianceComponents what, int seeds) {
  Normalised mean;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto made = drawn(truth, static_cast<std::uint64_t>(seed));
    const auto result = adjust(made.network, options(what));
    if (!result) {
      ADD_FAILURE() << result.error().message;
      return {};
    }
    std::vector<math::AlignmentPair> pairs;
    for (const auto& point : result->points) {
      math::AlignmentPair& pair = pairs.emplace_back();
      pair.a_mm = point.xyz_mm;
      pair.b_mm = made.point(point.id);
    }
    const auto fit = math::align(pairs, {.with_scale = false, .weighted = false});
    const auto count = static_cast<Eigen::Index>(3 * pairs.size());
    Eigen::VectorXd error(count);
    Eigen::VectorXd place(count);  // from the centroid, in which the datum has its origin
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      error.segment<3>(3 * static_cast<Eigen::Index>(i)) = fit->residuals_mm[i];
      place.segment<3>(3 * static_cast<Eigen::Index>(i)) = pairs[i].a_mm;
    }
    const Eigen::MatrixXd covariance = result->covariance.bottomRightCorner(count, count);
    mean.points += tests::normalised_square(error, covariance, 6) / (static_cast<double>(count) - 6.0) / seeds;
    mean.scale += std::pow(place.dot(error), 2) / place.dot(covariance * place) / seeds;
  }
  return mean;
}

TEST(Components, CovarianceIsTrueOnceTheyAreApplied) {
  const int seeds = tests::seeds(20);
  const double dof = seeds * 39.0;
  const Normalised applied = normalised(kWrong, VarianceComponents::kApply, seeds);
  EXPECT_GT(applied.points, math::chi_square_quantile(0.0005, dof) / dof);
  EXPECT_LT(applied.points, math::chi_square_quantile(0.9995, dof) / dof);
  // The scale comes from eight bars whose sigma they tell themselves: its square is F with 1 and 7 degrees of freedom, of mean 1.4 and
  // variance 9.1.
  EXPECT_GT(applied.scale, math::chi_square_quantile(0.0005, seeds) / seeds);
  EXPECT_LT(applied.scale, 1.4 + 3.3 * std::sqrt(9.1 / seeds));
  // As stated, one sigma0 for all, the scale's sigma is many times too large: the test can fail.
  EXPECT_LT(normalised(kWrong, VarianceComponents::kNone, 10).scale, 0.1);
}

TEST(Components, AppliedOnesMakeSigma0OneAndAreTold) {
  const auto result = adjust(drawn(kWrong, 7).network, options(VarianceComponents::kApply));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(result->variance_components_applied);
  EXPECT_NEAR(result->sigma0, 1.0, 0.01);
  EXPECT_NEAR(of(*result, "image points c1").sigma_ratio, 10.0, 1.5);
  EXPECT_TRUE(std::any_of(result->warnings.begin(), result->warnings.end(), [](const auto& warning) {
    return warning.code == "sigma_ratio" && warning.subject == "image points c1";
  }));
}

TEST(Components, OneBarTellsNothingOfItsSigma) {
  auto made = drawn({}, 3);
  made.network.scale_bars.resize(1);
  const auto result = adjust(made.network, options(VarianceComponents::kTell));
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(of(*result, "scale bars").estimated);
  EXPECT_EQ(of(*result, "scale bars").sigma_ratio, 1.0);
}

TEST(Components, ControlPointsAreAGroup) {
  auto made = drawn({}, 5);
  made.network.scale_bars.clear();
  tests::Random random(17);
  base::ControlGroup group;
  std::vector<double> xyz;
  for (std::size_t i = 0; i < 8; ++i) {
    group.ids.push_back(made.ids[i]);
    for (int axis = 0; axis < 3; ++axis) xyz.push_back(made.points[i](axis) + 0.05 * random.normal());
  }
  group.xyz_mm = Eigen::Map<Eigen::VectorXd>(xyz.data(), static_cast<Eigen::Index>(xyz.size()));
  group.cov_mm2 = 0.005 * 0.005 * Eigen::MatrixXd::Identity(24, 24);  // ten times too sure
  made.network.control.push_back(std::move(group));
  const auto result = adjust(made.network, options(VarianceComponents::kApply));
  ASSERT_TRUE(result) << result.error().message;
  const auto& control = of(*result, "control points");
  EXPECT_GT(control.redundancy, 15.0);
  EXPECT_NEAR(control.sigma_ratio, 10.0, 3.3 * control.sigma);
  EXPECT_LT(control.low, 10.0);
  EXPECT_GT(control.high, 10.0);
}

}  // namespace
}  // namespace crosstie::bundle
