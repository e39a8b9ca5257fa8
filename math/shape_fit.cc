#include "math/shape_fit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Eigenvalues>

#include "math/detail/shape_outliers.h"
#include "math/detail/shape_start.h"
#include "math/distributions.h"

namespace crosstie::math {
namespace {

using base::ErrorCode;
using base::Result;
using detail::PointSet;
using detail::ShapeKind;
using detail::ShapeProblem;
using detail::ShapeSolution;
using detail::ShapeState;

constexpr int kDirections = 800;          // of the axis search: 5 degrees apart
constexpr double kFlat = 1e-14;           // ratio of squared extents below which rounding decides
constexpr double kSlender = 4.0;          // squared extents: a plane is twice as wide as thick, a line twice as long as wide
constexpr double kWeakShare = 1.0 / 3.0;  // sigma of a radius over the radius; sigma of a direction in rad
constexpr double kSimplerLevel = 1e-6;    // probability of taking a simpler shape for a curved one
constexpr double kClearlyWorse = 100.0;   // mean square of the simpler shape's over that of the curved one
constexpr double kMisfitLevel = 0.999;    // chi-square test of given sigmas
constexpr Eigen::Index kCompared = 2000;  // points that compare with a simpler shape

/// The points' frame of the computation: p = centre + unit_mm * x.
struct Frame {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double unit_mm = 1.0;
};

struct Fit {
  ShapeState state;  ///< in mm, in the frame of the points
  ShapeQuality quality;
};

tl::unexpected<base::Error> weak(ShapeKind kind, const std::string& why) {
  return base::fail(ErrorCode::kNoUniqueSolution, "fit of a " + detail::name_of(kind) + ": " + why);
}

Result<Frame> frame_of(ShapeKind kind, std::span<const Eigen::Vector3d> points) {
  Frame frame;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) {
      return base::fail(ErrorCode::kBadInput, "fit of a " + detail::name_of(kind) + ": point " + std::to_string(i + 1) +
                                                  " has a coordinate that is not a finite number");
    }
    frame.centre += (points[i] - frame.centre) / static_cast<double>(i + 1);
  }
  double spread = 0.0;
  for (const Eigen::Vector3d& point : points) spread = std::max(spread, (point - frame.centre).cwiseAbs().maxCoeff());
  if (!std::isfinite(spread) || spread > 1e100) {
    return base::fail(ErrorCode::kBadInput, "fit of a " + detail::name_of(kind) + ": coordinates are too large");
  }
  const double resolution = 16.0 * std::numeric_limits<double>::epsilon() * frame.centre.cwiseAbs().maxCoeff();
  if (!(spread > resolution) || spread < 1e-100) return weak(kind, "all points are in one place");
  frame.unit_mm = std::exp2(std::round(std::log2(spread)));
  return frame;
}

Result<PointSet> point_set(ShapeKind kind, std::span<const Eigen::Vector3d> points, const ShapeFitOptions& options,
                           const Frame& frame) {
  PointSet set;
  set.xyz.resize(3, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    set.xyz.col(static_cast<Eigen::Index>(i)) = (points[i] - frame.centre) / frame.unit_mm;
  }
  if (options.sigma_mm) set.sigma = *options.sigma_mm / frame.unit_mm;
  for (std::size_t i = 0; i < options.cov_mm2.size(); ++i) {
    const Eigen::Matrix3d& cov = options.cov_mm2[i];
    if (!cov.allFinite() || !(cov.diagonal().minCoeff() >= 0.0) || !(cov.trace() > 0.0)) {
      return base::fail(ErrorCode::kBadInput, "fit of a " + detail::name_of(kind) + ": the covariance of point " +
                                                  std::to_string(i + 1) + " is not positive");
    }
    set.cov.push_back(cov / (frame.unit_mm * frame.unit_mm));
  }
  set.update_centroid();
  return set;
}

/// Refuses points that are too few or in too simple a place.
Result<> check_extent(ShapeKind kind, const PointSet& points) {
  if (points.count() < detail::least_points(kind)) {
    return weak(kind, std::to_string(points.count()) + " points, at least " + std::to_string(detail::least_points(kind)) +
                          " are needed");
  }
  const Eigen::Vector3d squares =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(detail::Moments(points).scatter(), Eigen::EigenvaluesOnly).eigenvalues();
  if (!(squares(2) > 0.0)) return weak(kind, "all points are in one place");
  if (kind == ShapeKind::kLine) {
    if (squares(2) < kSlender * squares(1)) return weak(kind, "the points are as wide across as long; they are no line");
    return {};
  }
  if (squares(1) < kFlat * squares(2)) return weak(kind, "the points are on one line; add points beside it");
  if (kind == ShapeKind::kPlane && squares(1) < kSlender * squares(0)) {
    return weak(kind, "the points are as thick as wide: a line with its scatter, or no plane at all; add points beside it");
  }
  const bool is_solid = kind == ShapeKind::kSphere || kind == ShapeKind::kCylinder || kind == ShapeKind::kCone;
  if (is_solid && squares(0) < kFlat * squares(2)) {
    return weak(kind, "the points are in one plane; add points beside it");
  }
  return {};
}

/// Whether a plane (a line in place of a circle) fits the points as well, as far as their scatter lets tell: an F test, or
/// chi-square where sigmas are known. With few points F is no use: a misfit ten times as large is then enough.
bool is_simpler(const ShapeProblem& problem, const PointSet& points, const ShapeState& state, bool sigma_is_known) {
  const PointSet few = points.thinned(kCompared);
  const ShapeKind simpler = problem.kind == ShapeKind::kCircle ? ShapeKind::kLine : ShapeKind::kPlane;
  const auto flat = detail::best_solution({simpler, std::nullopt}, few, kDirections);
  if (!flat) return false;
  const double curved_sum = detail::shape_normals(problem.kind, state, few).square_sum;
  const auto unknowns = static_cast<double>(problem.unknowns().size());
  const double redundancy = detail::rows_of(problem.kind) * static_cast<double>(few.count()) - unknowns;
  const double more = unknowns - static_cast<double>(detail::parameters_of(simpler).size());
  const double gain = (flat->square_sum - curved_sum) / more;
  const double variance = redundancy > 0.0 ? curved_sum / redundancy : 0.0;
  if (sigma_is_known) return gain < chi_square_quantile(1.0 - kSimplerLevel, more) / more * std::max(variance, 1.0);
  if (redundancy <= 0.0) return false;
  return gain < std::min(f_quantile(1.0 - kSimplerLevel, more, redundancy), kClearlyWorse) * variance;
}

/// Refuses curved shapes that are as well flat.
Result<> check_curved(const ShapeProblem& problem, const PointSet& points, const ShapeState& state, bool sigma_is_known) {
  const bool is_curved = problem.kind != ShapeKind::kLine && problem.kind != ShapeKind::kPlane;
  if (!is_curved || problem.size || !is_simpler(problem, points, state, sigma_is_known)) return {};
  return weak(problem.kind, std::string("the points are as well on a ") +
                                (problem.kind == ShapeKind::kCircle ? "line" : "plane") +
                                ": their curvature does not show above their scatter");
}

Result<> check_determined(ShapeKind kind, const ShapeState& state, const ShapeCovariance& covariance) {
  if (!covariance.allFinite()) return {};
  const double tilt = std::sqrt(std::max(covariance(detail::kA, detail::kA), covariance(detail::kB, detail::kB)));
  if (tilt > kWeakShare) return weak(kind, "its direction is not determined (sigma above a third of a radian)");
  const bool has_radius = kind == ShapeKind::kCircle || kind == ShapeKind::kSphere || kind == ShapeKind::kCylinder;
  if (has_radius && std::sqrt(covariance(detail::kSize, detail::kSize)) > kWeakShare * state.size) {
    return weak(kind, "its radius is not determined (sigma above a third of it); add points round it, or state the radius");
  }
  return {};
}

/// From the units of the computation to mm.
ShapeCovariance in_mm(const ShapeCovariance& covariance, double unit_mm) {
  detail::Vector7d units = detail::Vector7d::Ones();
  for (const int length : {detail::kU, detail::kV, detail::kW, detail::kSize}) units(length) = unit_mm;
  return units.asDiagonal() * covariance * units.asDiagonal();
}

/// Distances of all points; rms and form of those that take part.
void add_residuals(ShapeKind kind, const PointSet& points, const ShapeState& state, double unit_mm, ShapeQuality& quality) {
  double squares = 0.0;
  double least = std::numeric_limits<double>::infinity();
  double largest = -least;
  quality.residuals_mm.reserve(static_cast<std::size_t>(points.xyz.cols()));
  for (Eigen::Index i = 0; i < points.xyz.cols(); ++i) {
    const double residual = detail::shape_residual(kind, state, points.xyz.col(i)) * unit_mm;
    quality.residuals_mm.push_back(residual);
    if (!points.takes_part(i)) continue;
    squares += residual * residual;
    least = std::min(least, residual);
    largest = std::max(largest, residual);
  }
  quality.count = static_cast<std::size_t>(points.count());
  quality.rms_mm = std::sqrt(squares / static_cast<double>(quality.count));
  quality.form_mm = detail::rows_of(kind) == 2 ? 2.0 * largest : largest - least;
}

/// Who was left out, by whom and how clearly.
void add_rejected(const ShapeProblem& problem, const PointSet& points, const std::vector<char>& agreeing,
                  const ShapeState& state, const ShapeCovariance& cofactors, double scale, ShapeQuality& quality) {
  for (Eigen::Index i = 0; i < points.xyz.cols(); ++i) {
    if (points.takes_part(i)) continue;
    const auto at = static_cast<std::size_t>(i);
    const double square = detail::standardised_square(problem.kind, state, points, i, cofactors, false);
    const bool agreed = agreeing.empty() || agreeing[at] != 0;
    quality.rejected.push_back({at, quality.residuals_mm[at],
                                std::sqrt(square / detail::rows_of(problem.kind)) / std::max(scale, 1e-300),
                                agreed ? RejectedPointReason::kResidual : RejectedPointReason::kNoConsensus});
  }
}

Result<Fit> fit(ShapeKind kind, std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options) {
  if (auto good = options.validate(points_mm.size()); !good) return base::fail(std::move(good));
  if (points_mm.size() < static_cast<std::size_t>(detail::least_points(kind))) {
    return weak(kind, std::to_string(points_mm.size()) + " points, at least " + std::to_string(detail::least_points(kind)) +
                          " are needed");
  }
  const auto frame = frame_of(kind, points_mm);
  if (!frame) return tl::unexpected(frame.error());
  auto points = point_set(kind, points_mm, options, *frame);
  if (!points) return base::fail(std::move(points));
  ShapeProblem problem{kind, std::nullopt};
  if (options.radius) problem.size = {options.radius->radius_mm / frame->unit_mm, options.radius->sigma_mm / frame->unit_mm};
  const bool sigma_is_known = options.sigma_mm || !options.cov_mm2.empty();

  ShapeState start;
  bool has_rivals = false;
  std::vector<char> agreeing;
  if (options.robust && points->xyz.cols() > detail::least_points(kind) + 1) {
    const auto agreed = detail::consensus(problem, *points);
    if (!agreed) return weak(kind, agreed.error().message);
    start = *agreed;
    agreeing = points->active;
    if (auto good = detail::reject_residuals(problem, options.max_w, sigma_is_known, *points, start); !good) {
      return weak(kind, good.error().message);
    }
    if (auto good = check_extent(kind, *points); !good) return base::fail(std::move(good));
  } else {
    if (auto good = check_extent(kind, *points); !good) return base::fail(std::move(good));
    const auto solution = detail::best_solution(problem, *points, kDirections);
    if (!solution) return weak(kind, "no start values were found");
    start = solution->state;
    has_rivals = solution->has_rivals;
  }
  ShapeSolution solution = detail::solve_shape(problem, *points, start);
  detail::solve_to_rounding(problem, *points, solution);
  if (auto good = check_curved(problem, *points, solution.state, sigma_is_known); !good) return base::fail(std::move(good));
  solution.state = detail::with_sign(kind, solution.state);
  if (kind != ShapeKind::kSphere) solution.state.axes = detail::axes_along(solution.state.axes.col(2));
  const auto cofactors = detail::shape_cofactors(problem, *points, solution.state);
  if (!cofactors) return weak(kind, cofactors.error().message);
  if (!solution.converged) return weak(kind, "the iteration does not settle; the points do not determine the shape");

  Fit result;
  ShapeQuality& quality = result.quality;
  quality.iterations = solution.iterations;
  quality.unknowns = static_cast<int>(problem.unknowns().size());
  quality.redundancy = detail::rows_of(kind) * static_cast<long>(points->count()) - quality.unknowns +
                       (problem.size && !problem.holds_size() ? 1 : 0);
  const double sigma0 = quality.redundancy > 0 ? std::sqrt(solution.square_sum / static_cast<double>(quality.redundancy)) : 0.0;
  quality.sigma0 = sigma_is_known ? sigma0 : sigma0 * frame->unit_mm;
  ShapeCovariance covariance = *cofactors;
  if (!sigma_is_known) covariance *= sigma0 * sigma0;
  if (!sigma_is_known && quality.redundancy <= 0) {
    const std::vector<int> unknowns = problem.unknowns();
    covariance(unknowns, unknowns).setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  if (auto good = check_determined(kind, solution.state, covariance); !good) return base::fail(std::move(good));
  if (sigma_is_known && quality.redundancy > 0 &&
      chi_square_cdf(solution.square_sum, static_cast<double>(quality.redundancy)) > kMisfitLevel) {
    quality.warnings.push_back({"residuals_exceed_sigma", detail::name_of(kind),
                                "the residuals are larger than the points' sigmas say (sigma0 well above 1): form error or "
                                "strays; the sigmas of the result do not contain it"});
  }
  if (has_rivals) {
    quality.warnings.push_back({"several_solutions", detail::name_of(kind),
                                "more than one " + detail::name_of(kind) + " passes through so few points; add points"});
  }
  quality.frame = solution.state.axes;
  quality.covariance = in_mm(covariance, frame->unit_mm);
  add_residuals(kind, *points, solution.state, frame->unit_mm, quality);
  add_rejected(problem, *points, agreeing, solution.state, *cofactors, sigma_is_known ? 1.0 : sigma0, quality);
  result.state = solution.state;
  result.state.origin = frame->centre + frame->unit_mm * solution.state.origin;
  result.state.size *= frame->unit_mm;
  return result;
}

/// The answer as the shape that was asked for.
template <typename Shape, typename Make>
Result<ShapeFit<Shape>> fit_as(ShapeKind kind, std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options,
                               Make make) {
  const bool has_radius = kind == ShapeKind::kCircle || kind == ShapeKind::kSphere || kind == ShapeKind::kCylinder;
  if (options.radius && !has_radius) {
    return base::fail(ErrorCode::kUsage, "a " + detail::name_of(kind) + " has no radius that could be known");
  }
  auto found = fit(kind, points_mm, options);
  if (!found) return base::fail(std::move(found));
  return ShapeFit<Shape>{make(found->state), std::move(found->quality)};
}

}  // namespace

Result<> ShapeFitOptions::validate(std::size_t points) const {
  const auto usage = [](const char* what) { return base::fail(ErrorCode::kUsage, what); };
  if (sigma_mm && !(*sigma_mm > 0.0 && std::isfinite(*sigma_mm))) return usage("the points' sigma must be positive");
  if (sigma_mm && !cov_mm2.empty()) return usage("the points have either one sigma or covariances, not both");
  if (!cov_mm2.empty() && cov_mm2.size() != points) return usage("there must be one covariance for each point");
  if (radius && !(radius->radius_mm > 0.0 && std::isfinite(radius->radius_mm))) return usage("a radius must be positive");
  if (radius && !(radius->sigma_mm >= 0.0 && std::isfinite(radius->sigma_mm))) {
    return usage("the sigma of a radius must be 0 (held) or positive");
  }
  if (radius && radius->sigma_mm > 0.0 && !sigma_mm && cov_mm2.empty()) {
    return usage("a radius with a sigma needs the points' sigma, too: their ratio is the weight");
  }
  if (!(max_w > 0.0)) return usage("the limit of standardised residuals must be positive");
  return {};
}

Eigen::Matrix3d ShapeQuality::point_cov_mm2() const { return frame * covariance.topLeftCorner<3, 3>() * frame.transpose(); }

Eigen::Matrix3d ShapeQuality::direction_cov_rad2() const {
  const Eigen::Matrix<double, 3, 2> across = frame.leftCols<2>();
  return across * covariance.block<2, 2>(detail::kA, detail::kA) * across.transpose();
}

double ShapeQuality::size_sigma_mm() const { return std::sqrt(covariance(detail::kSize, detail::kSize)); }

double ShapeQuality::half_angle_sigma_rad() const { return std::sqrt(covariance(detail::kAngle, detail::kAngle)); }

Result<ShapeFit<Line>> fit_line(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options) {
  return fit_as<Line>(ShapeKind::kLine, points_mm, options, [](const ShapeState& state) {
    return Line{state.origin, state.axes.col(2)};
  });
}

Result<ShapeFit<Plane>> fit_plane(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options) {
  return fit_as<Plane>(ShapeKind::kPlane, points_mm, options, [](const ShapeState& state) {
    return Plane{state.origin, state.axes.col(2)};
  });
}

Result<ShapeFit<Circle>> fit_circle(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options) {
  return fit_as<Circle>(ShapeKind::kCircle, points_mm, options, [](const ShapeState& state) {
    return Circle{state.origin, state.axes.col(2), state.size};
  });
}

Result<ShapeFit<Sphere>> fit_sphere(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options) {
  return fit_as<Sphere>(ShapeKind::kSphere, points_mm, options, [](const ShapeState& state) {
    return Sphere{state.origin, state.size};
  });
}

Result<ShapeFit<Cylinder>> fit_cylinder(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options) {
  return fit_as<Cylinder>(ShapeKind::kCylinder, points_mm, options, [](const ShapeState& state) {
    return Cylinder{state.origin, state.axes.col(2), state.size};
  });
}

Result<ShapeFit<Cone>> fit_cone(std::span<const Eigen::Vector3d> points_mm, const ShapeFitOptions& options) {
  return fit_as<Cone>(ShapeKind::kCone, points_mm, options, [](const ShapeState& state) {
    return Cone{state.origin, state.axes.col(2), state.size, state.angle};
  });
}

}  // namespace crosstie::math
