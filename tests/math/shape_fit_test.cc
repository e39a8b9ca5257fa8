// Fits of shapes to points that were made from a known shape: every kind, far origins, parts of shapes, strays; the covariance
// against the scatter of the errors; what does not determine a shape is refused.
#include "math/shape_fit.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "math/distributions.h"

namespace crosstie::math {
namespace {

using base::ErrorCode;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using testing::HasSubstr;

constexpr double kPi = std::numbers::pi;
using Points = std::vector<Vector3d>;

/// Local axes of the true shapes: the third is the direction.
Matrix3d tilted_axes() {
  return (Eigen::AngleAxisd(0.7, Vector3d(1.0, -2.0, 0.5).normalized()) * Eigen::AngleAxisd(0.3, Vector3d::UnitX()))
      .toRotationMatrix();
}

struct Truth {
  Matrix3d axes = tilted_axes();
  Vector3d origin = Vector3d(120.0, -80.0, 950.0);
  double radius = 30.0;
  double half_angle = 0.35;
};

enum class Kind { kLine, kPlane, kCircle, kSphere, kCylinder, kCone };

/// A point of the shape, a and b in -1 .. 1; `turn_rad` is how much of a circumference is there.
Vector3d point_of(Kind kind, const Truth& truth, double a, double b, double turn_rad) {
  const double phi = 0.5 * turn_rad * a;
  Vector3d local = Vector3d::Zero();
  switch (kind) {
    case Kind::kLine:
      local = {0.0, 0.0, 50.0 * a};
      break;
    case Kind::kPlane:
      local = {60.0 * a, 25.0 * b, 0.0};
      break;
    case Kind::kCircle:
      local = {truth.radius * std::cos(phi), truth.radius * std::sin(phi), 0.0};
      break;
    case Kind::kSphere: {
      const double theta = 0.5 * kPi * (b + 1.0) * turn_rad / (2.0 * kPi);
      local =
          truth.radius * Vector3d(std::sin(theta) * std::cos(kPi * a), std::sin(theta) * std::sin(kPi * a), std::cos(theta));
      break;
    }
    case Kind::kCylinder:
      local = {truth.radius * std::cos(phi), truth.radius * std::sin(phi), 40.0 * b};
      break;
    case Kind::kCone: {
      const double rho = truth.radius + 25.0 * b * std::tan(truth.half_angle);
      local = {rho * std::cos(phi), rho * std::sin(phi), 25.0 * b};
      break;
    }
  }
  return truth.origin + truth.axes * local;
}

class Sampler {
 public:
  explicit Sampler(unsigned seed) : random_(seed) {}
  double uniform() { return 2.0 * static_cast<double>(random_() >> 11) / 9007199254740992.0 - 1.0; }
  double normal() { return normal_quantile(0.5 + 0.5 * uniform() * (1.0 - 1e-15)); }
  Vector3d noise(double sigma) { return sigma * Vector3d(normal(), normal(), normal()); }

  Points shape(Kind kind, const Truth& truth, int count, double turn_rad, double sigma) {
    Points points;
    for (int i = 0; i < count; ++i) {
      const double a = uniform();
      points.push_back(point_of(kind, truth, a, uniform(), turn_rad) + noise(sigma));
    }
    return points;
  }

 private:
  std::mt19937_64 random_;
};

/// A shape as location, direction, size, angle.
struct Any {
  Vector3d point = Vector3d::Zero();
  Vector3d direction = Vector3d::UnitZ();
  double size = 0.0;
  double angle = 0.0;
  ShapeQuality quality;
};

base::Result<Any> fit_any(Kind kind, const Points& points, const ShapeFitOptions& options = {}) {
  const auto as = [](auto fit, auto convert) -> base::Result<Any> {
    if (!fit) return base::fail(std::move(fit));
    Any any = convert(fit->shape);
    any.quality = fit->quality;
    return any;
  };
  switch (kind) {
    case Kind::kLine:
      return as(fit_line(points, options), [](const Line& s) { return Any{s.point_mm, s.direction, 0.0, 0.0, {}}; });
    case Kind::kPlane:
      return as(fit_plane(points, options), [](const Plane& s) { return Any{s.point_mm, s.normal, 0.0, 0.0, {}}; });
    case Kind::kCircle:
      return as(fit_circle(points, options), [](const Circle& s) { return Any{s.centre_mm, s.normal, s.radius_mm, 0.0, {}}; });
    case Kind::kSphere:
      return as(fit_sphere(points, options), [](const Sphere& s) {
        return Any{s.centre_mm, Vector3d::UnitZ(), s.radius_mm, 0.0, {}};
      });
    case Kind::kCylinder:
      return as(fit_cylinder(points, options), [](const Cylinder& s) {
        return Any{s.point_mm, s.direction, s.radius_mm, 0.0, {}};
      });
    case Kind::kCone:
      break;
  }
  return as(fit_cone(points, options), [](const Cone& s) {
    return Any{s.point_mm, s.direction, s.distance_mm, s.half_angle_rad, {}};
  });
}

/// The seven errors of a fit in its own frame: truth less estimate, at the fit's point.
Eigen::Matrix<double, 7, 1> errors(Kind kind, const Truth& truth, const Any& fit) {
  Eigen::Matrix<double, 7, 1> error = Eigen::Matrix<double, 7, 1>::Zero();
  const Matrix3d& frame = fit.quality.frame;
  Vector3d direction = truth.axes.col(2);
  if (direction.dot(frame.col(2)) < 0.0) direction = -direction;
  Vector3d at = truth.origin;
  double size = truth.radius;
  if (kind == Kind::kLine || kind == Kind::kCylinder || kind == Kind::kCone) {
    // Where the true axis meets the plane through the point across the fitted direction.
    const double along = frame.col(2).dot(fit.point - truth.origin) / frame.col(2).dot(direction);
    at += along * direction;
    if (kind == Kind::kCone) size = (truth.radius + along * std::tan(truth.half_angle)) * std::cos(truth.half_angle);
  }
  if (kind == Kind::kPlane)
    at = fit.point + frame.col(2) * (direction.dot(truth.origin - fit.point) / direction.dot(frame.col(2)));
  error.head<3>() = frame.transpose() * (at - fit.point);
  if (kind != Kind::kSphere) {
    const Vector3d tilt = frame.transpose() * direction;
    error(3) = tilt.x() / tilt.z();
    error(4) = tilt.y() / tilt.z();
  }
  if (kind != Kind::kLine && kind != Kind::kPlane) error(5) = size - fit.size;
  if (kind == Kind::kCone) error(6) = truth.half_angle - fit.angle;
  return error;
}

const std::vector<std::pair<Kind, std::vector<int>>> kKinds = {
    {Kind::kLine, {0, 1, 3, 4}},   {Kind::kPlane, {2, 3, 4}},          {Kind::kCircle, {0, 1, 2, 3, 4, 5}},
    {Kind::kSphere, {0, 1, 2, 5}}, {Kind::kCylinder, {0, 1, 3, 4, 5}}, {Kind::kCone, {0, 1, 3, 4, 5, 6}},
};

TEST(ShapeFit, ExactPointsGiveTheShape) {
  for (const auto& [kind, unknowns] : kKinds) {
    for (const double turn_rad : {2.0 * kPi, kPi, 0.5 * kPi, 0.2 * kPi}) {
      for (const double away : {0.0, 1e6}) {
        SCOPED_TRACE(testing::Message() << static_cast<int>(kind) << " turn " << turn_rad << " away " << away);
        Truth truth;
        truth.origin += Vector3d(away, -2.0 * away, 0.5 * away);
        const auto fit = fit_any(kind, Sampler(3).shape(kind, truth, 40, turn_rad, 0.0));
        ASSERT_TRUE(fit) << fit.error().message;
        // Coordinates of 2e6 mm are rounded to 2e-10 mm; a part of a turn makes that larger.
        EXPECT_LT(errors(kind, truth, *fit).norm(), away > 0.0 ? 2e-6 : 1e-10);
        EXPECT_EQ(fit->quality.unknowns, static_cast<int>(unknowns.size()));
        EXPECT_EQ(fit->quality.count, 40U);
      }
    }
  }
}

/// Normalised squared errors over seeds against chi-square bounds at 99.9 %.
void expect_true_covariance(Kind kind, const std::vector<int>& unknowns, int seeds, int points, double turn_rad,
                            const std::function<ShapeFitOptions(Points&, std::vector<Matrix3d>&, Sampler&)>& make) {
  double sum = 0.0;
  for (int seed = 0; seed < seeds; ++seed) {
    const Truth truth;
    Sampler sampler(100U + static_cast<unsigned>(seed));
    Points measured = sampler.shape(kind, truth, points, turn_rad, 0.0);
    std::vector<Matrix3d> covariances;
    const ShapeFitOptions options = make(measured, covariances, sampler);
    const auto fit = fit_any(kind, measured, options);
    ASSERT_TRUE(fit) << fit.error().message;
    const Eigen::VectorXd error = errors(kind, truth, *fit)(unknowns);
    const Eigen::MatrixXd covariance = fit->quality.covariance(unknowns, unknowns);
    sum += error.dot(covariance.ldlt().solve(error));
  }
  const double dof = seeds * static_cast<double>(unknowns.size());
  EXPECT_GT(sum, chi_square_quantile(0.0005, dof)) << sum / dof;
  EXPECT_LT(sum, chi_square_quantile(0.9995, dof)) << sum / dof;
}

TEST(ShapeFit, CovarianceIsTrueWithOneSigma) {
  for (const auto& [kind, unknowns] : kKinds) {
    for (const double turn_rad : {2.0 * kPi, 0.6 * kPi}) {
      SCOPED_TRACE(testing::Message() << static_cast<int>(kind) << " turn " << turn_rad);
      expect_true_covariance(kind, unknowns, 150, 40, turn_rad, [](Points& points, auto&, Sampler& sampler) {
        for (Vector3d& point : points) point += sampler.noise(0.05);
        ShapeFitOptions options;
        options.sigma_mm = 0.05;
        return options;
      });
    }
  }
}

TEST(ShapeFit, CovarianceIsTrueWithCovariancesOfPoints) {
  for (const auto& [kind, unknowns] : kKinds) {
    SCOPED_TRACE(testing::Message() << static_cast<int>(kind));
    expect_true_covariance(kind, unknowns, 150, 40, 1.2 * kPi, [](Points& points, auto& covariances, Sampler& sampler) {
      for (Vector3d& point : points) {
        // Long ellipsoids, some of them ten times as long as others.
        const double size = std::pow(10.0, 0.5 * (sampler.uniform() - 1.0));
        const Matrix3d axes = Eigen::Quaterniond(sampler.normal(), sampler.normal(), sampler.normal(), sampler.normal())
                                  .normalized()
                                  .toRotationMatrix();
        const Vector3d sigma = size * Vector3d(0.01, 0.03, 0.15);
        covariances.emplace_back(axes * sigma.array().square().matrix().asDiagonal() * axes.transpose());
        point += axes * sigma.cwiseProduct(sampler.noise(1.0));
      }
      ShapeFitOptions options;
      options.cov_mm2 = covariances;
      return options;
    });
  }
}

TEST(ShapeFit, SigmaFollowsFromResidualsWhereNoneIsGiven) {
  for (const auto& [kind, unknowns] : kKinds) {
    const Points points = Sampler(5).shape(kind, Truth(), 400, kPi, 0.05);
    const auto fit = fit_any(kind, points);
    ASSERT_TRUE(fit) << fit.error().message;
    EXPECT_NEAR(fit->quality.sigma0, 0.05, 0.005);
    ShapeFitOptions options;
    options.sigma_mm = fit->quality.sigma0;
    const auto known = fit_any(kind, points, options);
    ASSERT_TRUE(known);
    EXPECT_NEAR(known->quality.sigma0, 1.0, 1e-9);
    EXPECT_LT((known->quality.covariance - fit->quality.covariance).norm(), 1e-9 * fit->quality.covariance.norm());
    double squares = 0.0;
    for (const double residual : fit->quality.residuals_mm) squares += residual * residual;
    EXPECT_NEAR(fit->quality.rms_mm, std::sqrt(squares / 400.0), 1e-12);
    const long rows = kind == Kind::kLine || kind == Kind::kCircle ? 800 : 400;
    EXPECT_EQ(fit->quality.redundancy, rows - static_cast<long>(unknowns.size()));
  }
}

TEST(ShapeFit, ResidualsAreDistancesFromTheShape) {
  const auto expect = [](const auto& fit, const Points& points, auto distance) {
    ASSERT_TRUE(fit) << fit.error().message;
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_NEAR(fit->quality.residuals_mm[i], distance(fit->shape, points[i]), 1e-11);
    }
  };
  const auto points = [](Kind kind) { return Sampler(37).shape(kind, Truth(), 50, kPi, 0.5); };
  const auto length = [](const auto& shape, const Vector3d& p) { return distance_mm(shape, p); };
  const auto signed_length = [](const auto& shape, const Vector3d& p) { return signed_distance_mm(shape, p); };
  expect(fit_line(points(Kind::kLine)), points(Kind::kLine), length);
  expect(fit_circle(points(Kind::kCircle)), points(Kind::kCircle), length);
  expect(fit_plane(points(Kind::kPlane)), points(Kind::kPlane), signed_length);
  expect(fit_sphere(points(Kind::kSphere)), points(Kind::kSphere), signed_length);
  expect(fit_cylinder(points(Kind::kCylinder)), points(Kind::kCylinder), signed_length);
  expect(fit_cone(points(Kind::kCone)), points(Kind::kCone), signed_length);
  const auto cone = fit_cone(points(Kind::kCone));
  ASSERT_TRUE(cone);
  EXPECT_NEAR(signed_distance_mm(cone->shape, cone->shape.apex_mm()), 0.0, 1e-11);
}

TEST(ShapeFit, KnownRadius) {
  // A short arc says little about its radius: stated, it makes the axis much better known.
  const Truth truth;
  for (const Kind kind : {Kind::kCircle, Kind::kSphere, Kind::kCylinder}) {
    SCOPED_TRACE(testing::Message() << static_cast<int>(kind));
    const Points points = Sampler(7).shape(kind, truth, 60, 0.4, 0.02);
    ShapeFitOptions options;
    options.sigma_mm = 0.02;
    options.radius = {truth.radius, 0.0};
    const auto held = fit_any(kind, points, options);
    ASSERT_TRUE(held) << held.error().message;
    EXPECT_EQ(held->size, truth.radius);
    EXPECT_EQ(held->quality.size_sigma_mm(), 0.0);
    options.radius = {truth.radius + 0.03, 0.05};
    const auto prior = fit_any(kind, points, options);
    ASSERT_TRUE(prior) << prior.error().message;
    EXPECT_LT(prior->quality.size_sigma_mm(), 0.05);
    EXPECT_NEAR(prior->size, truth.radius, 3.0 * prior->quality.size_sigma_mm());
    EXPECT_EQ(prior->quality.redundancy, held->quality.redundancy);
    EXPECT_LT(held->quality.point_cov_mm2().trace(), prior->quality.point_cov_mm2().trace());
    // A prior that says nothing changes nothing.
    options.radius = {5.0 * truth.radius, 1e9};
    const auto loose = fit_any(kind, points, options);
    options.radius.reset();
    const auto free = fit_any(kind, points, options);
    ASSERT_EQ(loose.has_value(), free.has_value());
    if (free) {
      EXPECT_NEAR(loose->size, free->size, 1e-4);
    }
  }
}

TEST(ShapeFit, StraysAreFoundAndLeftOut) {
  for (const auto& [kind, unknowns] : kKinds) {
    for (const double share : {0.05, 0.3, 0.5}) {
      SCOPED_TRACE(testing::Message() << static_cast<int>(kind) << " strays " << share);
      const Truth truth;
      Sampler sampler(11);
      Points points = sampler.shape(kind, truth, 300, 1.5 * kPi, 0.03);
      const auto strays = static_cast<std::size_t>(share * 300.0);
      for (std::size_t i = 0; i < strays; ++i) {
        points[i] = truth.origin + 60.0 * Vector3d(sampler.uniform(), sampler.uniform(), sampler.uniform());
      }
      ShapeFitOptions options;
      options.robust = true;
      const auto fit = fit_any(kind, points, options);
      ASSERT_TRUE(fit) << fit.error().message;
      const Eigen::VectorXd error = errors(kind, truth, *fit)(unknowns);
      const Eigen::MatrixXd covariance = fit->quality.covariance(unknowns, unknowns);
      EXPECT_LT(error.dot(covariance.ldlt().solve(error)), chi_square_quantile(0.9999, static_cast<double>(unknowns.size())));
      std::size_t good_rejected = 0;
      for (const RejectedPoint& one : fit->quality.rejected) good_rejected += one.index >= strays ? 1U : 0U;
      EXPECT_LE(good_rejected, 4U);
      EXPECT_GE(fit->quality.rejected.size() - good_rejected + 3U, strays) << "few strays happen to lie on the shape";
      EXPECT_EQ(fit->quality.count + fit->quality.rejected.size(), points.size());
    }
  }
}

TEST(ShapeFit, OneBlunderAmongFewPoints) {
  const Truth truth;
  Points points = Sampler(13).shape(Kind::kPlane, truth, 12, kPi, 0.01);
  points[4] += 0.3 * truth.axes.col(2);
  ShapeFitOptions options;
  options.robust = true;
  options.sigma_mm = 0.01;
  const auto fit = fit_plane(points, options);
  ASSERT_TRUE(fit) << fit.error().message;
  ASSERT_EQ(fit->quality.rejected.size(), 1U);
  EXPECT_EQ(fit->quality.rejected[0].index, 4U);
  EXPECT_NEAR(std::abs(fit->quality.rejected[0].residual_mm), 0.3, 0.03);
  EXPECT_GT(fit->quality.rejected[0].w, 10.0);
}

std::string refusal(Kind kind, const Points& points, ErrorCode code = ErrorCode::kNoUniqueSolution,
                    const ShapeFitOptions& options = {}) {
  const auto fit = fit_any(kind, points, options);
  if (fit) return "was accepted";
  EXPECT_EQ(fit.error().code, code) << fit.error().message;
  return fit.error().message;
}

TEST(ShapeFit, RefusesWhatIsNotDetermined) {
  const Truth truth;
  Sampler sampler(17);
  const std::vector<int> least = {2, 3, 3, 4, 5, 6};
  for (std::size_t i = 0; i < kKinds.size(); ++i) {
    const Kind kind = kKinds[i].first;
    EXPECT_THAT(refusal(kind, {}), HasSubstr("0 points"));
    EXPECT_THAT(refusal(kind, sampler.shape(kind, truth, least[i] - 1, kPi, 0.0)), HasSubstr("are needed"));
    EXPECT_THAT(refusal(kind, Points(20, truth.origin)), HasSubstr("in one place"));
    Points damaged = sampler.shape(kind, truth, 20, kPi, 0.01);
    damaged[7].y() = std::nan("");
    EXPECT_THAT(refusal(kind, damaged, ErrorCode::kBadInput), HasSubstr("point 8"));
    damaged[7].y() = 1e300;
    EXPECT_THAT(refusal(kind, damaged, ErrorCode::kBadInput), HasSubstr("too large"));
  }
  for (const double sigma : {0.0, 0.02}) {
    SCOPED_TRACE(sigma);
    const Points line = sampler.shape(Kind::kLine, truth, 30, 0.0, sigma);
    const Points plane = sampler.shape(Kind::kPlane, truth, 60, 0.0, sigma);
    EXPECT_THAT(refusal(Kind::kPlane, line), HasSubstr(sigma > 0.0 ? "as thick as wide" : "on one line"));
    EXPECT_THAT(refusal(Kind::kCircle, line), HasSubstr("line"));
    EXPECT_THAT(refusal(Kind::kSphere, line), HasSubstr("fit of a sphere"));
    for (const Kind solid : {Kind::kSphere, Kind::kCylinder, Kind::kCone}) {
      EXPECT_THAT(refusal(solid, plane), HasSubstr("plane"));
    }
  }
  const Points ring = sampler.shape(Kind::kCircle, truth, 30, 2.0 * kPi, 0.0);
  EXPECT_THAT(refusal(Kind::kSphere, ring), HasSubstr("in one plane"));
  EXPECT_THAT(refusal(Kind::kCylinder, ring), HasSubstr("in one plane"));
  const Points cap = sampler.shape(Kind::kSphere, truth, 30, 0.1, 0.05);
  EXPECT_THAT(refusal(Kind::kSphere, cap), HasSubstr("curvature does not show"));
  Points blob;
  for (int i = 0; i < 50; ++i) blob.push_back(sampler.noise(1.0));
  EXPECT_THAT(refusal(Kind::kLine, blob), HasSubstr("as wide across as long"));
  EXPECT_THAT(refusal(Kind::kPlane, blob), HasSubstr("as thick as wide"));
}

TEST(ShapeFit, RefusesOptionsOutOfTheirDomain) {
  const Points points = Sampler(19).shape(Kind::kCylinder, Truth(), 20, kPi, 0.01);
  const std::vector<Matrix3d> covariances(20, Matrix3d::Identity());
  const auto refused = [&](const ShapeFitOptions& options) {
    return refusal(Kind::kCylinder, points, ErrorCode::kUsage, options);
  };
  EXPECT_THAT(refused({.sigma_mm = 0.0}), HasSubstr("sigma"));
  EXPECT_THAT(refused({.sigma_mm = std::nan("")}), HasSubstr("sigma"));
  EXPECT_THAT(refused({.sigma_mm = 0.1, .cov_mm2 = covariances}), HasSubstr("not both"));
  EXPECT_THAT(refused({.cov_mm2 = std::span(covariances).first(5)}), HasSubstr("one covariance for each"));
  EXPECT_THAT(refused({.radius = RadiusKnowledge{-1.0, 0.0}}), HasSubstr("radius"));
  EXPECT_THAT(refused({.radius = RadiusKnowledge{30.0, 0.1}}), HasSubstr("ratio"));
  EXPECT_THAT(refusal(Kind::kPlane, points, ErrorCode::kUsage, {.radius = RadiusKnowledge{1.0, 0.0}}), HasSubstr("no radius"));
  const std::vector<Matrix3d> zeros(20, Matrix3d::Zero());
  EXPECT_THAT(refusal(Kind::kCylinder, points, ErrorCode::kBadInput, {.cov_mm2 = zeros}), HasSubstr("covariance of point 1"));
}

TEST(ShapeFit, MinimalPointsHaveNoCovarianceButOfGivenSigmas) {
  const Points points = Sampler(23).shape(Kind::kSphere, Truth(), 4, 2.0 * kPi, 0.0);
  const auto fit = fit_sphere(points);
  ASSERT_TRUE(fit) << fit.error().message;
  EXPECT_TRUE(std::isnan(fit->quality.size_sigma_mm()));
  const auto known = fit_sphere(points, {.sigma_mm = 0.01});
  ASSERT_TRUE(known) << known.error().message;
  EXPECT_GT(known->quality.size_sigma_mm(), 0.0);
}

TEST(ShapeFit, SigmasThatAreTooSmallAreNamed) {
  const Points points = Sampler(29).shape(Kind::kCylinder, Truth(), 200, kPi, 0.05);
  const auto fit = fit_cylinder(points, {.sigma_mm = 0.01});
  ASSERT_TRUE(fit);
  ASSERT_EQ(fit->quality.warnings.size(), 1U);
  EXPECT_EQ(fit->quality.warnings[0].code, "residuals_exceed_sigma");
}

TEST(ShapeFit, ExtremeCones) {
  for (const double half_angle_deg : {0.2, 2.0, 45.0, 80.0, 88.0}) {
    for (const double turn_rad : {2.0 * kPi, 0.5 * kPi}) {
      SCOPED_TRACE(testing::Message() << half_angle_deg << " turn " << turn_rad);
      Truth truth;
      truth.half_angle = half_angle_deg * kPi / 180.0;
      Sampler sampler(31);
      Points points;
      for (int i = 0; i < 120; ++i) {
        const double phi = 0.5 * turn_rad * sampler.uniform();
        const double along = 15.0 * sampler.uniform();  // of the generatrix
        const double rho = truth.radius + along * std::sin(truth.half_angle);
        points.push_back(truth.origin +
                         truth.axes * Vector3d(rho * std::cos(phi), rho * std::sin(phi), along * std::cos(truth.half_angle)));
      }
      const auto fit = fit_any(Kind::kCone, points);
      ASSERT_TRUE(fit) << fit.error().message;
      EXPECT_LT(errors(Kind::kCone, truth, *fit).norm(), 1e-9);
      EXPECT_GT(fit->direction.dot(truth.axes.col(2)), 0.99);
    }
  }
}

}  // namespace
}  // namespace crosstie::math
