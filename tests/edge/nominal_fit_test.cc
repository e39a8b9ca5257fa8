#include "edge/nominal_fit.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "tests/edge/synthetic_rim.h"

namespace crosstie::edge {
namespace {

using base::EdgeCurve;
using base::ErrorCode;
using std::numbers::pi;
using ::testing::HasSubstr;
using tests::measured_rim;
using tests::on_cylinder;
using tests::RimErrors;
using tests::some_pose;
using tests::true_ellipse;
using tests::true_oval;
using tests::TruePoint;
using tests::TrueRim;

bool has_warning(const NominalFit& fit, const std::string& code) {
  for (const auto& warning : fit.warnings) {
    if (warning.code == code) return true;
  }
  return false;
}

/// A list that is its own mirror image nowhere.
Nominal lopsided(bool with_normals) {
  Nominal nominal{NominalKind::kPoints};
  for (int i = 0; i < 80; ++i) {
    const double phi = 2.0 * pi * i / 80;
    const double r = 250.0 + 60.0 * std::cos(2.0 * phi) + 25.0 * std::sin(3.0 * phi) + 15.0 * std::cos(phi + 0.4);
    nominal.points_mm.emplace_back(r * std::cos(phi), r * std::sin(phi), 0.0);
    if (with_normals) nominal.normals.emplace_back(Eigen::Vector3d::UnitZ());
  }
  return nominal;
}

TrueRim rim_of(const Nominal& nominal) {
  const NominalCurve curve = *NominalCurve::make(nominal);
  return [curve](double u) {
    const CurvePoint p = curve.at(u * curve.length_mm());
    return TruePoint{p.point_mm, p.normal};
  };
}

/// The turn of an outline is known up to half a turn.
double distance(const base::Pose& a, const base::Pose& b) {
  const Eigen::Vector3d w = base::rotation_log(a.rotation * b.rotation.conjugate());
  return (a.translation_mm - b.translation_mm).norm() + 1000.0 * std::min(w.norm(), pi - w.norm());
}

TEST(NominalFit, PerfectPointsGiveTheTruthBack) {
  struct Case {
    Nominal nominal;
    TrueRim rim;
    std::vector<double> sizes;
  };
  const std::vector<Case> cases = {
      {{NominalKind::kEllipse, {}}, true_ellipse(900.0, 500.0), {900.0, 500.0}},
      {{NominalKind::kOval, {}}, true_oval(2000.0, 800.0), {2000.0, 800.0}},
      {{NominalKind::kOval, {1990.0, 805.0}}, true_oval(2000.0, 800.0), {2000.0, 800.0}},
      {{NominalKind::kOval, {1990.0, 805.0}, 2.5, Saddle{2150.0}},
       on_cylinder(true_oval(2000.0, 800.0), 2150.0),
       {2000.0, 800.0}},
      {{NominalKind::kOval, {}, 2.5, Saddle{2150.0, 0.0, 0.4}},
       on_cylinder(true_oval(1200.0, 800.0), 2150.0, 0.4),
       {1200.0, 800.0}},
      {{NominalKind::kCircle, {}, 2.5, Saddle{900.0}}, on_cylinder(true_ellipse(600.0, 600.0), 900.0), {600.0}},
      {lopsided(true), rim_of(lopsided(true)), {}},
      {lopsided(false), rim_of(lopsided(false)), {}},
  };
  std::mt19937_64 random(1);
  for (const Case& one : cases) {
    const EdgeCurve edge = measured_rim(one.rim, some_pose(), 200, {}, random, 0.0);
    const auto fit = fit_nominal(edge, one.nominal);
    ASSERT_TRUE(fit.has_value()) << name_of(one.nominal.kind) << ": " << fit.error().message;
    EXPECT_LT(distance(fit->frame_from_hole, some_pose()), 1e-5) << name_of(one.nominal.kind);
    for (std::size_t i = 0; i < one.sizes.size(); ++i) EXPECT_NEAR(fit->nominal.size_mm[i], one.sizes[i], 1e-5);
    EXPECT_LT(fit->rms_mm, 1e-6);
    EXPECT_TRUE(fit->warnings.empty()) << fit->warnings[0].message;
  }
}

TEST(NominalFit, ACirclesCentreAndDiameterHaveTheSigmasOfTheBooks) {
  std::mt19937_64 random(2);
  const EdgeCurve edge = measured_rim(true_ellipse(500.0, 500.0), {}, 400, {.across_mm = 0.02, .normal_mm = 0.05}, random);
  const auto fit = fit_nominal(edge, {NominalKind::kCircle, {}});
  ASSERT_TRUE(fit.has_value()) << fit.error().message;
  EXPECT_TRUE(fit->turn_is_held);
  EXPECT_TRUE(has_warning(*fit, "turn_held"));
  // n points evenly round: sigma of the centre in the plane s sqrt(2 / n), of the radius s / sqrt(n), along the normal s_v / sqrt(n),
  // of the tilts s_v sqrt(2 / n) / r.
  const double n = 400.0;
  EXPECT_NEAR(std::sqrt(fit->covariance(3, 3)), 0.02 * std::sqrt(2.0 / n), 1e-6);
  EXPECT_NEAR(std::sqrt(fit->covariance(5, 5)), 0.05 / std::sqrt(n), 1e-6);
  EXPECT_NEAR(std::sqrt(fit->covariance(0, 0)), 0.05 * std::sqrt(2.0 / n) / 250.0, 1e-9);
  EXPECT_NEAR(fit->size_sigma_mm(0), 2.0 * 0.02 / std::sqrt(n), 1e-6);
  EXPECT_NEAR(fit->covariance(2, 2), 0.0, 1e-15);
}

/// Normalised squares of the errors of place and sizes over seeds; their mean must be the number of unknowns.
void expect_honest(const Nominal& nominal, const TrueRim& rim, const std::vector<double>& sizes, const RimErrors& errors,
                   double from, double to, bool turn_is_known = true) {
  constexpr int kSeeds = 120;
  const Eigen::Index unknowns = 6 + static_cast<Eigen::Index>(sizes.size());
  const Eigen::Index rank = unknowns - (turn_is_known ? 0 : 1);
  double sum = 0.0;
  double sum_sigma0 = 0.0;
  double redundancy = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<unsigned>(seed) + 100U);
    const EdgeCurve edge = measured_rim(rim, some_pose(), 60, errors, random, 1.0, from, to);
    const auto fit = fit_nominal(edge, nominal, {.frame_from_hole = some_pose()});
    ASSERT_TRUE(fit.has_value()) << fit.error().message;
    Eigen::VectorXd error(unknowns);
    error.head<6>() = base::difference(fit->frame_from_hole, some_pose());
    for (std::size_t i = 0; i < sizes.size(); ++i) error(6 + static_cast<Eigen::Index>(i)) = sizes[i] - fit->nominal.size_mm[i];
    // Into the hole's own axes, where a turn that is held can be left out.
    Eigen::MatrixXd back = Eigen::MatrixXd::Identity(unknowns, unknowns);
    back.topLeftCorner<6, 6>() = some_pose().inverse().adjoint();
    std::vector<Eigen::Index> known;
    for (Eigen::Index i = 0; i < unknowns; ++i) {
      if (i != 2 || turn_is_known) known.push_back(i);
    }
    const Eigen::VectorXd own = (back * error)(known);
    const Eigen::MatrixXd covariance = (back * fit->covariance * back.transpose())(known, known);
    sum += own.dot(covariance.ldlt().solve(own));
    sum_sigma0 += fit->sigma0 * fit->sigma0;
    redundancy = static_cast<double>(fit->redundancy);
  }
  // 4 sigma of the mean of chi-square variables.
  EXPECT_NEAR(sum / kSeeds, static_cast<double>(rank), 4.0 * std::sqrt(2.0 * static_cast<double>(rank) / kSeeds))
      << name_of(nominal.kind);
  EXPECT_NEAR(sum_sigma0 / kSeeds, 1.0, 4.0 * std::sqrt(2.0 / redundancy / kSeeds)) << name_of(nominal.kind);
}

RimErrors shared_errors() {
  RimErrors errors;
  base::Vector6d station;
  station << 2e-5, 3e-5, 1e-5, 0.03, 0.02, 0.04;
  errors.station_sigmas = {station, station, 0.5 * station};
  errors.scale = 2e-5;
  return errors;
}

TEST(NominalFit, SigmasAreTrueOfIndependentPoints) {
  expect_honest({NominalKind::kEllipse, {900.0, 500.0}}, true_ellipse(900.0, 500.0), {900.0, 500.0}, {}, 0.0, 1.0);
  expect_honest({NominalKind::kCircle, {500.0}}, true_ellipse(500.0, 500.0), {500.0}, {}, 0.1, 0.6, false);
  expect_honest(lopsided(true), rim_of(lopsided(true)), {}, {}, 0.0, 1.0);
}

TEST(NominalFit, SigmasAreTrueOfPointsThatShareErrors) {
  expect_honest({NominalKind::kOval, {1600.0, 700.0}, 2.5, Saddle{2150.0}}, on_cylinder(true_oval(1600.0, 700.0), 2150.0),
                {1600.0, 700.0}, shared_errors(), 0.0, 1.0);
  expect_honest({NominalKind::kEllipse, {900.0, 500.0}}, true_ellipse(900.0, 500.0), {900.0, 500.0}, shared_errors(), 0.05,
                0.9);
  expect_honest({NominalKind::kCircle, {500.0}}, true_ellipse(500.0, 500.0), {500.0}, shared_errors(), 0.0, 1.0, false);
}

TEST(NominalFit, SharedErrorsDoNotAverageDown) {
  std::mt19937_64 random(3);
  const EdgeCurve few = measured_rim(true_ellipse(900.0, 500.0), some_pose(), 50, shared_errors(), random);
  const EdgeCurve many = measured_rim(true_ellipse(900.0, 500.0), some_pose(), 800, shared_errors(), random);
  const auto a = fit_nominal(few, {NominalKind::kEllipse, {900.0, 500.0}});
  const auto b = fit_nominal(many, {NominalKind::kEllipse, {900.0, 500.0}});
  ASSERT_TRUE(a && b);
  EXPECT_GT(std::sqrt(base::position_covariance(b->frame_from_hole, b->covariance.topLeftCorner<6, 6>()).trace()), 0.015);
  EXPECT_LT(b->covariance.trace(), a->covariance.trace());
}

TEST(NominalFit, DeviationsAlongTheArcAreThoseThatWerePutIn) {
  std::mt19937_64 random(4);
  const TrueRim flat = true_ellipse(900.0, 500.0);
  const TrueRim dented = [&](double u) {
    TruePoint p = flat(u);
    const Eigen::Vector3d tangent = (flat(u + 1e-6).point - flat(u - 1e-6).point).normalized();
    p.point += 0.8 * std::sin(6.0 * pi * u) * p.normal.cross(tangent) + 0.5 * std::cos(4.0 * pi * u) * p.normal;
    return p;
  };
  const EdgeCurve edge = measured_rim(dented, some_pose(), 300, {}, random, 0.0);
  const NominalCurve curve = *NominalCurve::make({NominalKind::kEllipse, {900.0, 500.0}});
  const EdgeDeviations off = deviations(edge, curve, some_pose());
  ASSERT_EQ(off.points.size(), 300U);
  for (std::size_t i = 0; i < 300; ++i) {
    const double u = static_cast<double>(i) / 300.0;
    EXPECT_NEAR(off.uv_mm(0, static_cast<Eigen::Index>(i)), 0.8 * std::sin(6.0 * pi * u), 1e-6);
    EXPECT_NEAR(off.uv_mm(1, static_cast<Eigen::Index>(i)), 0.5 * std::cos(4.0 * pi * u), 1e-6);
    EXPECT_NEAR(off.sigma_mm(i, 0), 0.02, 1e-6);
    EXPECT_NEAR(off.sigma_mm(i, 1), 0.03, 1e-6);
  }
  const auto fit = fit_nominal(edge, {NominalKind::kEllipse, {900.0, 500.0}});
  ASSERT_TRUE(fit.has_value());
  EXPECT_TRUE(has_warning(*fit, "form")) << "half a millimetre of form is not noise";
}

/// A circle's points over an arc, moved by `off_mm(u)` away from its middle, u in [0, 1) once round.
EdgeCurve bent_circle(double diameter_mm, int count, double from, double to, const std::function<double(double)>& off_mm,
                      std::mt19937_64& random, const RimErrors& errors = {}) {
  EdgeCurve edge = measured_rim(true_ellipse(diameter_mm, diameter_mm), {}, count, errors, random, 1.0, from, to);
  for (base::EdgePoint& point : edge.points) {
    const double u = std::atan2(point.point_mm.y(), point.point_mm.x()) / (2.0 * pi);
    point.point_mm += off_mm(u - std::floor(u)) * Eigen::Vector3d(point.point_mm.x(), point.point_mm.y(), 0.0).normalized();
  }
  return edge;
}

/// One hump of `high_mm` between two places.
std::function<double(double)> hump(double from, double to, double high_mm) {
  return [=](double u) {
    const double t = (u - from + (u < from - 0.5 ? 1.0 : 0.0)) / (to - from);
    return t > 0.0 && t < 1.0 ? high_mm * std::sin(pi * t) : 0.0;
  };
}

TEST(NominalFit, AStretchThatIsBrokenOutIsLeftOutAndNamed) {
  std::mt19937_64 random(31);
  // Half a bore of 62 mm, as scans see it, broken out to 1.4 mm over its last eighth: there it pulls most.
  const EdgeCurve edge = bent_circle(62.0, 64, 0.0, 0.5, hump(0.43, 0.51, 1.4), random);
  const auto all = fit_nominal(edge, {NominalKind::kCircle, {}}, {.leave_out_stretches = false});
  ASSERT_TRUE(all.has_value()) << all.error().message;
  EXPECT_GT(std::abs(all->nominal.size_mm[0] - 62.0), 0.3) << "what the fit to all points says";
  const auto fit = fit_nominal(edge, {NominalKind::kCircle, {}});
  ASSERT_TRUE(fit.has_value()) << fit.error().message;
  EXPECT_LT(std::abs(fit->nominal.size_mm[0] - 62.0), 3.0 * fit->size_sigma_mm(0));
  EXPECT_LT(fit->size_sigma_mm(0), 0.03);
  EXPECT_TRUE(has_warning(*fit, "stretch_left_out"));
  EXPECT_FALSE(has_warning(*fit, "form")) << "the rest has none";
  ASSERT_EQ(fit->left_out.size(), 1U);
  EXPECT_NEAR(fit->left_out[0].from_mm, 0.43 * pi * 62.0, 3.0) << "a point stands for 1.5 mm";
  EXPECT_NEAR(fit->left_out[0].from_mm + fit->left_out[0].length_mm, 0.5 * pi * 62.0, 3.0);
  EXPECT_NEAR(fit->left_out[0].most_u_mm, -1.4, 0.1) << "away from the opening";
  EXPECT_EQ(fit->deviations.points.size(), edge.points.size()) << "what is left out is still shown";
}

TEST(NominalFit, SigmasAreTrueWhereAStretchWasLeftOut) {
  // Where a break-out begins some of it stays in the fit, and the sigmas do not know it.
  constexpr int kSeeds = 40;
  double squares = 0.0;
  for (int seed = 0; seed < kSeeds; ++seed) {
    std::mt19937_64 random(static_cast<unsigned>(seed) + 700U);
    const EdgeCurve edge = bent_circle(62.0, 40, 0.0, 0.5, hump(0.43, 0.51, 1.4), random);
    const auto fit = fit_nominal(edge, {NominalKind::kCircle, {}});
    ASSERT_TRUE(fit.has_value()) << fit.error().message;
    ASSERT_EQ(fit->left_out.size(), 1U) << "seed " << seed;
    squares += std::pow((fit->nominal.size_mm[0] - 62.0) / fit->size_sigma_mm(0), 2);
  }
  EXPECT_NEAR(squares / kSeeds, 1.0, 3.0 * std::sqrt(2.0 / kSeeds));
}

TEST(NominalFit, StretchesOverTheSeamAndTwoAtOnceAreLeftOut) {
  std::mt19937_64 random(32);
  const auto two = [seam = hump(0.96, 1.04, 0.8), spatter = hump(0.4, 0.45, -0.6)](double u) { return seam(u) + spatter(u); };
  const EdgeCurve edge = bent_circle(500.0, 200, 0.0, 1.0, two, random);
  const auto fit = fit_nominal(edge, {NominalKind::kCircle, {}});
  ASSERT_TRUE(fit.has_value()) << fit.error().message;
  EXPECT_LT(std::abs(fit->nominal.size_mm[0] - 500.0), 3.0 * fit->size_sigma_mm(0));
  ASSERT_EQ(fit->left_out.size(), 2U);
  for (const ForeignStretch& stretch : fit->left_out) {
    const bool at_seam = stretch.from_mm > 0.9 * edge.length_mm;
    EXPECT_NEAR(stretch.length_mm, (at_seam ? 0.08 : 0.05) * pi * 500.0, 20.0) << "a point stands for 8 mm";
    EXPECT_NEAR(stretch.most_u_mm, at_seam ? -0.8 : 0.6, 0.1);
  }
}

TEST(NominalFit, FormAllRoundAndNoiseLeaveNothingOut) {
  std::mt19937_64 random(33);
  // An ellipse is no circle anywhere.
  const EdgeCurve ellipse = measured_rim(true_ellipse(502.0, 498.0), some_pose(), 120, {}, random);
  auto fit = fit_nominal(ellipse, {NominalKind::kCircle, {}});
  ASSERT_TRUE(fit.has_value()) << fit.error().message;
  EXPECT_TRUE(fit->left_out.empty());
  EXPECT_TRUE(has_warning(*fit, "form"));
  // Noise of twice what its sigmas say, over half a rim: all of them are looked at, and by chance one in a hundred loses a stretch.
  int looked_at = 0;
  for (int seed = 0; seed < 25; ++seed) {
    EdgeCurve half = bent_circle(
        62.0, 30, 0.0, 0.5, [](double) { return 0.0; }, random);
    for (base::EdgePoint& point : half.points) point.cov_mm2 *= 0.25;
    fit = fit_nominal(half, {NominalKind::kCircle, {}});
    ASSERT_TRUE(fit.has_value()) << fit.error().message;
    looked_at += has_warning(*fit, "form") ? 1 : 0;
    EXPECT_TRUE(fit->left_out.empty()) << "seed " << seed;
  }
  EXPECT_EQ(looked_at, 25);
}

TEST(NominalFit, WhatBendsSmoothlyIsFormAndNotAStretch) {
  // As heat bends a cut: humps that begin nowhere, of several widths, some twenty times what the sigmas explain. Neighbours deviate together, so that a rim is worth
  // a few points alone.
  std::mt19937_64 random(35);
  for (const double sharpness : {2.0, 4.0, 6.0, 8.0}) {
    const auto bent = [sharpness](double u) {
      return 1.5 * std::pow(0.5 + 0.5 * std::cos(2.0 * pi * (u - 0.3)), sharpness) + 0.5 * std::sin(6.0 * pi * u + 0.4) +
             0.2 * std::cos(10.0 * pi * u);
    };
    const auto fit = fit_nominal(bent_circle(1000.0, 236, 0.0, 1.0, bent, random), {NominalKind::kCircle, {}});
    ASSERT_TRUE(fit.has_value()) << fit.error().message;
    EXPECT_TRUE(fit->left_out.empty()) << sharpness << ": " << fit->left_out.front().points.size() << " points";
    EXPECT_TRUE(has_warning(*fit, "form"));
  }
}

TEST(NominalFit, ComesToRestWherePointsLieFarOffTheirSigmas) {
  std::mt19937_64 random(34);
  // As a hole's edge has them: along the rim a point has no error of its own. Its weight follows the curve's direction then.
  for (int trial = 0; trial < 20; ++trial) {
    EdgeCurve edge = bent_circle(62.0, 30, 0.0, 0.5, hump(0.40, 0.52, 1.4 + 0.1 * trial), random);
    for (base::EdgePoint& point : edge.points) {
      const Eigen::Vector3d across = point.normal.cross(point.tangent);
      point.cov_mm2 = 4e-4 * across * across.transpose() + 9e-4 * point.normal * point.normal.transpose() +
                      1e-8 * Eigen::Matrix3d::Identity();
    }
    const auto fit = fit_nominal(edge, {NominalKind::kCircle, {}}, {.leave_out_stretches = false});
    EXPECT_TRUE(fit.has_value()) << fit.error().message;
  }
}

TEST(NominalFit, AMirroredNominalIsRefused) {
  std::mt19937_64 random(5);
  const EdgeCurve edge = measured_rim(rim_of(lopsided(true)), some_pose(), 200, {}, random);
  EXPECT_TRUE(fit_nominal(edge, lopsided(true)).has_value());
  const auto list = fit_nominal(edge, mirrored(lopsided(true)));
  ASSERT_FALSE(list.has_value());
  EXPECT_EQ(list.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(list.error().message, HasSubstr("mirror image"));

  const EdgeCurve inclined = measured_rim(on_cylinder(true_oval(900.0, 400.0), 700.0, 0.5), some_pose(), 200, {}, random);
  EXPECT_TRUE(fit_nominal(inclined, {NominalKind::kOval, {900.0, 400.0}, 2.5, Saddle{700.0, 0.0, 0.5}}).has_value());
  const auto saddle = fit_nominal(inclined, {NominalKind::kOval, {900.0, 400.0}, 2.5, Saddle{700.0, 0.0, -0.5}});
  ASSERT_FALSE(saddle.has_value());
  EXPECT_THAT(saddle.error().message, HasSubstr("mirror image"));
}

TEST(NominalFit, ANominalInAnotherUnitIsNamed) {
  std::mt19937_64 random(8);
  const EdgeCurve edge = measured_rim(rim_of(lopsided(true)), some_pose(), 200, {}, random);
  Nominal inches = lopsided(true);
  for (auto& p : inches.points_mm) p /= 25.4;
  const auto fit = fit_nominal(edge, inches);
  ASSERT_FALSE(fit.has_value());
  EXPECT_EQ(fit.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(fit.error().message, HasSubstr("inches read as mm"));
}

TEST(NominalFit, AListWithoutNormalsFacesTheHead) {
  std::mt19937_64 random(6);
  const EdgeCurve edge = measured_rim(rim_of(lopsided(true)), some_pose(), 200, {}, random, 0.0);
  Nominal clockwise = lopsided(false);
  std::reverse(clockwise.points_mm.begin(), clockwise.points_mm.end());
  const auto fit = fit_nominal(edge, clockwise);
  ASSERT_TRUE(fit.has_value()) << fit.error().message;
  EXPECT_LT(fit->rms_mm, 1e-5);
  const NominalCurve curve = *NominalCurve::make(fit->nominal);
  const Eigen::Vector3d towards_head = some_pose().rotation * Eigen::Vector3d::UnitZ();
  EXPECT_GT((fit->frame_from_hole.rotation * curve.at(0.0).normal).dot(towards_head), 0.99);
}

TEST(NominalFit, WhatDetermineNothingIsNamed) {
  std::mt19937_64 random(7);
  EdgeCurve edge = measured_rim(true_ellipse(500.0, 300.0), some_pose(), 40, {}, random);
  edge.points.resize(2);
  edge.shared_mm.resize(6, 0);
  auto fit = fit_nominal(edge, {NominalKind::kCircle, {500.0}});
  ASSERT_FALSE(fit.has_value());
  EXPECT_EQ(fit.error().code, ErrorCode::kNoUniqueSolution);
  edge = measured_rim(true_ellipse(500.0, 300.0), some_pose(), 40, {}, random);
  edge.points[3].cov_mm2.setZero();
  fit = fit_nominal(edge, {NominalKind::kCircle, {500.0}});
  ASSERT_FALSE(fit.has_value());
  EXPECT_THAT(fit.error().message, HasSubstr("point 4 of the rim has no covariance"));
}

}  // namespace
}  // namespace crosstie::edge
