// Rims with a form of their own: processes along the rim drawn here, and circles fitted by formulas of their own beside the code under test.
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "edge/nominal_fit.h"
#include "tests/edge/synthetic_rim.h"

namespace crosstie::edge {
namespace {

using base::EdgeCurve;
using std::numbers::pi;
using tests::measured_rim;
using tests::some_pose;
using tests::true_ellipse;

constexpr double kDiameter_mm = 62.0;
constexpr int kPoints = 40;  // over half of it: one in 2.5 mm

/// Correlation of the form of two points by their way along the rim [mm].
using Correlation = std::function<double(double)>;

struct FormCase {
  const char* name;
  double sigma_mm;
  Correlation correlation;
};

/// A share of a bore's rim: every fourth point has a sigma of 0.01 mm and the others 0.12; heights have 0.05. The form is drawn from a normal distribution with
/// the whole covariance.
EdgeCurve bore(const FormCase& form, double share, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  EdgeCurve edge = measured_rim(true_ellipse(kDiameter_mm, kDiameter_mm), some_pose(), kPoints, {}, random, 0.0, 0.0, share);
  Eigen::MatrixXd cov(kPoints, kPoints);
  for (int i = 0; i < kPoints; ++i) {
    for (int k = 0; k < kPoints; ++k) {
      const double way =
          std::abs(edge.points[static_cast<std::size_t>(i)].s_mm - edge.points[static_cast<std::size_t>(k)].s_mm);
      cov(i, k) = i == k ? 1.0 : form.correlation(way);
    }
  }
  cov.diagonal().array() += 1e-9;
  Eigen::VectorXd z(kPoints);
  for (double& value : z) value = normal(random);
  const Eigen::MatrixXd root = cov.llt().matrixL();
  const Eigen::VectorXd off = form.sigma_mm * root * z;
  for (int i = 0; i < kPoints; ++i) {
    base::EdgePoint& point = edge.points[static_cast<std::size_t>(i)];
    const Eigen::Vector3d across = point.normal.cross(point.tangent);
    const double sigma = i % 4 == 0 ? 0.01 : 0.12;
    point.cov_mm2 = sigma * sigma * across * across.transpose() + 0.05 * 0.05 * point.normal * point.normal.transpose() +
                    1e-8 * Eigen::Matrix3d::Identity();
    point.point_mm += (sigma * normal(random) + off(i)) * across + 0.05 * normal(random) * point.normal;
  }
  return edge;
}

/// Diameter of the circle in the hole's plane that fits with the points' own sigmas as weights.
double plain_diameter_mm(const EdgeCurve& edge) {
  Eigen::Vector3d circle(0.0, 0.0, 0.5 * kDiameter_mm);
  for (int round = 0; round < 20; ++round) {
    Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (const base::EdgePoint& point : edge.points) {
      const Eigen::Vector2d d = (some_pose().inverse() * point.point_mm).head<2>() - circle.head<2>();
      const Eigen::Vector3d across = point.normal.cross(point.tangent);
      const double weight = 1.0 / across.dot(point.cov_mm2 * across);
      const Eigen::Vector3d row(d.x() / d.norm(), d.y() / d.norm(), 1.0);
      matrix += weight * row * row.transpose();
      right += weight * (d.norm() - circle.z()) * row;
    }
    circle += matrix.ldlt().solve(right);
  }
  return 2.0 * circle.z();
}

struct Sampled {
  double normalised = 0.0, rms_mm = 0.0, plain_rms_mm = 0.0, found_share = 0.0, form_mm = 0.0, mean_mm = 0.0;
};

Sampled sampled(const FormCase& form, int seeds, double share = 0.5) {
  Sampled result;
  for (int seed = 0; seed < seeds; ++seed) {
    std::mt19937_64 random(static_cast<unsigned>(seed) + 4000U);
    const EdgeCurve edge = bore(form, share, random);
    const auto fit = fit_nominal(edge, {NominalKind::kCircle, {kDiameter_mm}},
                                 {.frame_from_hole = some_pose(), .leave_out_stretches = false});
    EXPECT_TRUE(fit.has_value());
    if (!fit) continue;
    const double error = fit->nominal.size_mm[0] - kDiameter_mm;
    const double plain = plain_diameter_mm(edge) - kDiameter_mm;
    result.normalised += std::pow(error / fit->size_sigma_mm(0), 2) / seeds;
    result.rms_mm += error * error / seeds;
    result.plain_rms_mm += plain * plain / seeds;
    result.found_share += (!fit->form.across.parts.empty() ? 1.0 : 0.0) / seeds;
    result.form_mm += fit->form.across.sigma_mm() / seeds;
    result.mean_mm += error / seeds;
  }
  result.rms_mm = std::sqrt(result.rms_mm);
  result.plain_rms_mm = std::sqrt(result.plain_rms_mm);
  return result;
}

constexpr int kSeeds = 150;

TEST(NominalForm, SigmasOfADiameterHoldTheForm) {
  const auto none = [](double) { return 0.0; };
  const auto falling = [](double length) { return [=](double way) { return std::exp(-way / length); }; };
  // Smoother than what the fit takes it for.
  const auto smooth = [](double length) { return [=](double way) { return std::exp(-0.5 * way * way / (length * length)); }; };
  const double scatter = 3.0 * std::sqrt(2.0 / kSeeds);  // of a mean of chi-squares
  for (const FormCase& form : {FormCase{"each point for itself", 0.06, none}, FormCase{"over 4 mm", 0.06, falling(4.0)},
                               FormCase{"over 10 mm", 0.06, falling(10.0)}, FormCase{"smooth over 4 mm", 0.06, smooth(4.0)},
                               FormCase{"0.3 mm", 0.3, falling(0.01)}}) {
    const Sampled s = sampled(form, kSeeds);
    std::printf("%s: normalised %.2f, rms %.4f, by the points' sigmas alone %.4f, form %.3f found in %.2f\n", form.name,
                s.normalised, s.rms_mm, s.plain_rms_mm, s.form_mm, s.found_share);
    // Half a rim does not tell over which length its form is correlated: sigmas may be too large by a half, never too small.
    EXPECT_LT(s.normalised, 1.0 + scatter) << form.name;
    EXPECT_GT(s.normalised, 0.44) << form.name;
    EXPECT_GT(s.found_share, 0.95) << form.name;
    EXPECT_NEAR(s.form_mm, form.sigma_mm, 0.5 * form.sigma_mm) << form.name;
  }
}

TEST(NominalForm, SigmasHoldTheWavesOfAHoleThatBent) {
  // What heat does to a hole: two or three waves round it. Half of a rim shows one of two waves, which looks like another size and place: no
  // estimate can tell, so that this is asked of three waves on half a rim and of both on a whole one, where they leave its size alone.
  const auto waves = [](int count) { return [=](double way) { return std::cos(2.0 * count * way / kDiameter_mm); }; };
  struct Case {
    FormCase form;
    double share;
  };
  const double scatter = 3.0 * std::sqrt(2.0 / kSeeds);
  for (const Case& one : {Case{{"three waves, half of them seen", 0.2, waves(3)}, 0.5}, Case{{"two waves", 0.2, waves(2)}, 1.0},
                          Case{{"three waves", 0.2, waves(3)}, 1.0}}) {
    const Sampled s = sampled(one.form, kSeeds, one.share);
    std::printf("%s: normalised %.2f, rms %.4f, form %.3f found in %.2f\n", one.form.name, s.normalised, s.rms_mm, s.form_mm,
                s.found_share);
    EXPECT_LT(s.normalised, 1.0 + scatter) << one.form.name;
    EXPECT_GT(s.normalised, 0.44) << one.form.name;
  }
}

TEST(NominalForm, PrecisePointsDoNotDecideACircleWhoseFormIsLarger) {
  const auto none = [](double) { return 0.0; };
  for (const double sigma_mm : {0.06, 0.3}) {
    const Sampled s = sampled({"each point for itself", sigma_mm, none}, kSeeds);
    EXPECT_LT(s.rms_mm, 0.9 * s.plain_rms_mm) << sigma_mm;
  }
}

TEST(NominalForm, WithoutAFormNothingChanges) {
  const Sampled s = sampled({"none", 0.0, [](double) { return 0.0; }}, kSeeds);
  EXPECT_LT(s.found_share, 0.05);
  EXPECT_NEAR(s.normalised, 1.0, 3.0 * std::sqrt(2.0 / kSeeds));
  EXPECT_LT(s.rms_mm, 1.02 * s.plain_rms_mm);
}

}  // namespace
}  // namespace crosstie::edge
