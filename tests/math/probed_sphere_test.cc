#include "math/probed_sphere.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "math/distributions.h"

namespace crosstie::math {
namespace {

using base::ErrorCode;
using Eigen::Vector3d;
using testing::HasSubstr;

constexpr double kPi = std::numbers::pi;
constexpr double kDegree = kPi / 180.0;
using Hits = std::vector<Vector3d>;

/// `count` directions on a circle of latitude.
void add_ring(Hits& directions, double from_pole_deg, int count) {
  const double theta = from_pole_deg * kDegree;
  for (int i = 0; i < count; ++i) {
    const double phi = 2.0 * kPi * i / count;
    directions.emplace_back(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
  }
}

Hits pole_and(std::initializer_list<std::pair<double, int>> rings) {
  Hits directions = {Vector3d::UnitZ()};
  for (const auto& [angle, count] : rings) add_ring(directions, angle, count);
  return directions;
}

/// Spread evenly over all that a probe from above reaches, to 20 degrees below the equator.
Hits even(int count) {
  Hits directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - 4.0 / 3.0 * (i + 0.5) / count;
    const double phi = i * kPi * (3.0 - std::sqrt(5.0));
    directions.emplace_back(std::sqrt(1.0 - z * z) * std::cos(phi), std::sqrt(1.0 - z * z) * std::sin(phi), z);
  }
  return directions;
}

constexpr double kStylus_mm = 5.0;
constexpr double kBall_mm = 38.1;
const Vector3d kCentre(812.0, -430.0, 95.0);

Hits tips(const Hits& directions) {
  Hits hits;
  for (const Vector3d& direction : directions) hits.push_back(kCentre + 0.5 * (kBall_mm + kStylus_mm) * direction);
  return hits;
}

SphereProbingOptions with_sigma(double sigma_mm) {
  SphereProbingOptions options;
  options.stylus_diameter_mm = kStylus_mm;
  options.probe_sigma_mm = sigma_mm;
  return options;
}

TEST(ProbedSphere, SigmasAreThoseOfThePlanningTable) {
  struct Row {
    Hits directions;
    bool known;
    Vector3d ratio;  ///< sd(x y z) over the probe's sigma, to the digits of the table
  };
  const Row rows[] = {
      {pole_and({{90.0, 4}}), false, {0.71, 0.71, 1.12}},
      {pole_and({{45.0, 4}, {90.0, 4}}), false, {0.58, 0.58, 0.85}},
      {even(25), false, {0.33, 0.33, 0.52}},
      {pole_and({{30.0, 4}}), false, {1.41, 1.41, 8.35}},
      {pole_and({{30.0, 4}}), true, {1.41, 1.41, 0.50}},
  };
  for (const Row& row : rows) {
    SCOPED_TRACE(row.ratio.transpose());
    SphereProbingOptions options = with_sigma(0.004);
    options.least_opening_rad = 0.0;
    if (row.known) options.diameter_mm = kBall_mm;
    const auto ball = fit_probed_sphere(tips(row.directions), options);
    ASSERT_TRUE(ball) << ball.error().message;
    const Vector3d ratio = ball->cov_mm2.diagonal().cwiseSqrt() / 0.004;
    EXPECT_LT((ratio - row.ratio).cwiseAbs().maxCoeff(), row.directions.size() == 25 ? 0.015 : 0.005) << ratio.transpose();
    EXPECT_LT((ball->centre_mm - kCentre).norm(), 1e-9);
    EXPECT_NEAR(ball->diameter_mm, kBall_mm, 1e-9);
    EXPECT_EQ(ball->diameter_sigma_mm == 0.0, row.known);
  }
}

TEST(ProbedSphere, CovarianceIsTrue) {
  // Diameter free, known, and known with a sigma that its error is drawn from.
  for (const int knowledge : {0, 1, 2}) {
    SCOPED_TRACE(knowledge);
    constexpr int kSeeds = 300;
    double sum = 0.0;
    for (int seed = 0; seed < kSeeds; ++seed) {
      std::mt19937_64 random(static_cast<unsigned>(seed));
      const auto normal = [&] { return normal_quantile((static_cast<double>(random() >> 11) + 0.5) / 9007199254740992.0); };
      Hits hits = tips(pole_and({{45.0, 4}, {90.0, 4}}));
      for (Vector3d& hit : hits) hit += 0.003 * Vector3d(normal(), normal(), normal());
      SphereProbingOptions options = with_sigma(0.003);
      if (knowledge > 0) options.diameter_mm = kBall_mm;
      if (knowledge == 2) {
        options.diameter_sigma_mm = 0.01;
        *options.diameter_mm += 0.01 * normal();
      }
      const auto ball = fit_probed_sphere(hits, options);
      ASSERT_TRUE(ball) << ball.error().message;
      const Vector3d error = ball->centre_mm - kCentre;
      sum += error.dot(ball->cov_mm2.inverse() * error);
    }
    EXPECT_GT(sum, chi_square_quantile(0.0005, 3.0 * kSeeds));
    EXPECT_LT(sum, chi_square_quantile(0.9995, 3.0 * kSeeds));
  }
}

TEST(ProbedSphere, ACapIsRefusedUnlessTheDiameterIsKnown) {
  const Hits hits = tips(pole_and({{40.0, 8}}));
  const auto refused = fit_probed_sphere(hits, with_sigma(0.003));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kNoUniqueSolution);
  EXPECT_THAT(refused.error().message, HasSubstr("cap of 80 degrees"));
  SphereProbingOptions options = with_sigma(0.003);
  options.diameter_mm = kBall_mm;
  const auto known = fit_probed_sphere(hits, options);
  ASSERT_TRUE(known) << known.error().message;
  EXPECT_NEAR(known->opening_rad, 80.0 * kDegree, 1e-3);
  EXPECT_TRUE(fit_probed_sphere(tips(pole_and({{46.0, 8}})), with_sigma(0.003)));
}

TEST(ProbedSphere, OpeningOfCapsOfEverySize) {
  for (const double half_deg : {1.0, 30.0, 90.0, 130.0, 150.0}) {
    Hits directions = {Vector3d::UnitZ()};
    for (int ring = 1; ring <= 10; ++ring) add_ring(directions, 0.1 * ring * half_deg, 40);
    const Eigen::Quaterniond turn = Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized();
    for (Vector3d& direction : directions) direction = turn * direction;
    EXPECT_NEAR(opening_of(directions), 2.0 * half_deg * kDegree, 0.03) << half_deg;
  }
  EXPECT_EQ(opening_of(Hits{}), 0.0);
  EXPECT_NEAR(opening_of(Hits{Vector3d::UnitX()}), 0.0, 1e-6);
}

TEST(ProbedSphere, FormErrorShows) {
  Hits hits = tips(pole_and({{45.0, 6}, {90.0, 6}}));
  hits[3] += 0.05 * (hits[3] - kCentre).normalized();
  const auto ball = fit_probed_sphere(hits, with_sigma(0.003));
  ASSERT_TRUE(ball);
  EXPECT_GT(ball->form_mm, 0.03);
  ASSERT_EQ(ball->warnings.size(), 1U);
  EXPECT_EQ(ball->warnings[0].code, "residuals_exceed_sigma");
  EXPECT_GT(ball->sigma0, 3.0);
  EXPECT_EQ(ball->hits, 13U);
  EXPECT_EQ(ball->redundancy, 9);
}

TEST(ProbedSphere, RefusesWhatIsNoBall) {
  const auto message = [](const Hits& hits, const SphereProbingOptions& options, ErrorCode code) {
    const auto ball = fit_probed_sphere(hits, options);
    if (ball) return std::string("was accepted");
    EXPECT_EQ(ball.error().code, code) << ball.error().message;
    return ball.error().message;
  };
  const Hits hits = tips(pole_and({{90.0, 4}}));
  EXPECT_THAT(message({hits[0], hits[1], hits[2]}, with_sigma(0.003), ErrorCode::kNoUniqueSolution), HasSubstr("3 points"));
  EXPECT_THAT(message({hits[1], hits[2], hits[3], hits[4]}, with_sigma(0.003), ErrorCode::kNoUniqueSolution),
              HasSubstr("in one plane"));
  Hits damaged = hits;
  damaged[2].z() = std::nan("");
  EXPECT_THAT(message(damaged, with_sigma(0.003), ErrorCode::kBadInput), HasSubstr("point 3"));
  EXPECT_THAT(message(hits, with_sigma(0.0), ErrorCode::kUsage), HasSubstr("sigma"));
  SphereProbingOptions options = with_sigma(0.003);
  options.stylus_diameter_mm = 50.0;
  EXPECT_THAT(message(hits, options, ErrorCode::kBadInput), HasSubstr("smaller than the stylus"));
  options = with_sigma(0.003);
  options.diameter_mm = -1.0;
  EXPECT_THAT(message(hits, options, ErrorCode::kUsage), HasSubstr("diameter"));
}

}  // namespace
}  // namespace crosstie::math
