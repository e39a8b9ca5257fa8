#include "bundle/detail/axis_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include <fmt/format.h>
#include <Eigen/Cholesky>

#include "bundle/detail/outliers.h"
#include "math/distributions.h"

namespace crosstie::bundle::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Pose;
using base::Result;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kFarFromX_rad = 0.17;  // the travel is the machine's X axis
constexpr double kLeastTravel_mm = 1.0;
constexpr double kFarOff_mm = 1.0;  // from the line: no error motion, a wrong reading
constexpr double kExcessLevel = 1e-2;
constexpr int kHighestOrder = 3;
double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

/// A linear model of the stations' poses: observed differences y from the straight axis = design * unknowns.
struct Line {
  VectorXd y;
  MatrixXd design;  ///< base unknowns (9), then every candidate
  MatrixXd cov;     ///< of the stations, without stops
  MatrixXd by_mm;   ///< covariance of stops for unit sigma of coordinates
  MatrixXd by_rad;  ///< the same for angles

  [[nodiscard]] MatrixXd covariance(double sigma_mm, double sigma_rad) const {
    return cov + by_mm * std::pow(std::max(sigma_mm, kLeastStop_mm), 2) +
           by_rad * std::pow(std::max(sigma_rad, kLeastStop_rad), 2);
  }
};

struct Fit {
  VectorXd x;
  MatrixXd cov;
  double square_sum = 0.0;
  double log_likelihood = -std::numeric_limits<double>::infinity();  ///< restricted
  bool good = false;
};

Fit fit(const Line& line, const std::vector<Index>& columns, const MatrixXd& covariance) {
  Fit result;
  const Eigen::LLT<MatrixXd> root(covariance);
  if (root.info() != Eigen::Success) return result;
  const MatrixXd a = root.matrixL().solve(line.design(Eigen::all, columns));
  const VectorXd y = root.matrixL().solve(line.y);
  // Columns differ by many orders of magnitude: scaled before they are squared.
  const VectorXd scale = a.colwise().norm().cwiseMax(1e-300).cwiseInverse();
  const MatrixXd scaled = a * scale.asDiagonal();
  const Eigen::LLT<MatrixXd> normal(scaled.transpose() * scaled);
  if (normal.info() != Eigen::Success || normal.rcond() < 1e-13) return result;
  result.x = scale.asDiagonal() * normal.solve(scaled.transpose() * y);
  result.cov = scale.asDiagonal() * normal.solve(MatrixXd::Identity(scaled.cols(), scaled.cols())) * scale.asDiagonal();
  result.square_sum = (y - a * result.x).squaredNorm();
  const auto log_diagonal = [](const MatrixXd& l) { return l.diagonal().array().log().sum(); };
  result.log_likelihood = -0.5 * result.square_sum - log_diagonal(root.matrixLLT()) - log_diagonal(normal.matrixLLT());
  result.good = true;
  return result;
}

Line linearise(const StationPoses& stations, const Carriage& carriage, double scale_ppm, double reading_sigma_mm,
               const Pose& at_middle) {
  const auto count = static_cast<Index>(stations.axis_mm.size());
  Line line;
  line.y.resize(6 * count);
  line.design.resize(6 * count, 9 + static_cast<Index>(carriage.terms.size()));
  line.cov = stations.cov;
  line.by_mm = MatrixXd::Zero(6 * count, 6 * count);
  line.by_rad = line.by_mm;
  double pose[7];
  math::pose_to_values(at_middle, pose);
  const double direction[2] = {0.0, 0.0};
  const std::vector<double> none(carriage.terms.size(), 0.0);
  const double* values[] = {pose, direction, &scale_ppm, none.data()};
  for (Index k = 0; k < count; ++k) {
    const auto at = static_cast<std::size_t>(k);
    MatrixXd jacobian;
    const Pose on_axis = carried(carriage, stations.axis_mm[at], values, &jacobian);
    line.y.segment<6>(6 * k) = base::difference(on_axis, stations.machine_from_rig[at]);
    line.design.middleRows<6>(6 * k) = jacobian;
    line.cov.block<6, 6>(6 * k, 6 * k) += stop_covariance(on_axis, carriage.direction, 0.0, 0.0, reading_sigma_mm);
    line.by_mm.block<6, 6>(6 * k, 6 * k) = stop_covariance(on_axis, carriage.direction, 1.0, 0.0, 0.0);
    line.by_rad.block<6, 6>(6 * k, 6 * k) = stop_covariance(on_axis, carriage.direction, 0.0, 1.0, 0.0);
  }
  return line;
}

std::vector<Index> with(std::vector<Index> columns, Index one) {
  columns.insert(std::upper_bound(columns.begin(), columns.end(), one), one);
  return columns;
}

std::vector<Index> range(Index count) {
  std::vector<Index> columns(static_cast<std::size_t>(count));
  for (Index i = 0; i < count; ++i) columns[static_cast<std::size_t>(i)] = i;
  return columns;
}

/// Restricted maximum likelihood of the two stop sigmas: a grid in their logarithms, refined about its best.
std::pair<double, double> scatter(const Line& line, const std::vector<Index>& columns, const CommissionOptions& options) {
  double best_mm = 0.01;
  double best_rad = 1e-5;
  double best = -std::numeric_limits<double>::infinity();
  double span = std::log(100.0);
  for (int round = 0; round < 4; ++round) {
    const double centre_mm = best_mm;
    const double centre_rad = best_rad;
    for (int i = -4; i <= 4; ++i) {
      for (int j = -4; j <= 4; ++j) {
        const double mm = options.stop_sigma_mm.value_or(centre_mm * std::exp(span * i / 4.0));
        const double rad = options.stop_sigma_rad.value_or(centre_rad * std::exp(span * j / 4.0));
        const Fit here = fit(line, columns, line.covariance(mm, rad));
        if (!here.good || here.log_likelihood <= best) continue;
        best = here.log_likelihood;
        best_mm = mm;
        best_rad = rad;
      }
    }
    span /= 3.5;
  }
  return {best_mm, best_rad};
}

const char* motion_name(const AxisTerm& term) {
  constexpr const char* kShifts[] = {"EXX", "EYX", "EZX"};
  constexpr const char* kTurns[] = {"EAX", "EBX", "ECX"};
  return (term.angle ? kTurns : kShifts)[term.component];
}

}  // namespace

double two_sided_p(double t, double degrees) {
  if (degrees > 0.0) return math::student_two_sided(t, degrees);
  return std::erfc(std::abs(t) / std::sqrt(2.0));
}

base::Matrix6d stop_covariance(const Pose& machine_from_rig, const Vector3d& direction, double sigma_mm, double sigma_rad,
                               double reading_sigma_mm) {
  base::Matrix6d at_head = base::Matrix6d::Zero();
  at_head.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() * sigma_rad * sigma_rad;
  at_head.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() * sigma_mm * sigma_mm +
                                      reading_sigma_mm * reading_sigma_mm * direction * direction.transpose();
  const base::Matrix6d about = at_origin(-machine_from_rig.translation_mm);
  return about * at_head * about.transpose();
}

Result<StraightAxis> straight_axis(const StationPoses& stations) {
  const std::size_t count = stations.axis_mm.size();
  const auto [least, most] = std::minmax_element(stations.axis_mm.begin(), stations.axis_mm.end());
  const auto position = [&](std::size_t k) { return stations.machine_from_rig[k].translation_mm; };
  bool moved = false;  // readings in metres hardly differ, yet the head stood in different places
  for (std::size_t k = 1; k < count; ++k) moved = moved || (position(k) - position(0)).norm() > kFarOff_mm;
  const double spread_mm = *most - *least;
  if (count < 2 || (spread_mm < kLeastTravel_mm && !moved)) {
    return fail(
        ErrorCode::kNoUniqueSolution,
        count < 2
            ? std::string("one station does not determine the axis: take the cross at two readings or more, better at five "
                          "over the whole travel")
            : fmt::format("all {} stations have the axis reading {:.3f} mm: the axis is not determined; are the readings those "
                          "of the X axis?",
                          count, *least));
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double apart = (position(i) - position(j)).norm();
      if (std::abs(stations.axis_mm[i] - stations.axis_mm[j]) < 1e-3 && apart > kFarOff_mm) {
        return fail(ErrorCode::kBadInput,
                    fmt::format("stations {} and {} both read {:.3f} mm, yet the head stood {:.1f} mm apart: one of "
                                "the readings is wrong",
                                stations.names[j], stations.names[i], stations.axis_mm[i], apart));
      }
    }
  }
  std::array<std::vector<double>, 3> slopes;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const double way = stations.axis_mm[i] - stations.axis_mm[j];
      if (std::abs(way) < std::min(kLeastTravel_mm, 0.1 * spread_mm)) continue;
      const Vector3d slope = (position(i) - position(j)) / way;
      for (std::size_t c = 0; c < 3; ++c) slopes[c].push_back(slope(static_cast<Index>(c)));
    }
  }
  const Vector3d slope(median(slopes[0]), median(slopes[1]), median(slopes[2]));
  const double length = slope.norm();
  if (std::abs(length - 1.0) > 0.01) {
    const auto near = [&](double value) { return std::abs(length / value - 1.0) < 0.01; };
    const std::string unit = near(25.4)         ? ": the readings are in inches"
                             : near(1000.0)     ? ": the readings are in metres"
                             : near(0.001)      ? ": the readings are in micrometres"
                             : near(1.0 / 25.4) ? ": the cross and the spheres are in inches"
                                                : "; check the unit of the readings and that each belongs to its photographs";
    return fail(ErrorCode::kBadInput, fmt::format("the head moves {:.5g} mm per mm of axis reading{}", length, unit));
  }
  StraightAxis axis;
  axis.direction = slope / length;
  axis.scale_ppm = 1e6 * (length - 1.0);
  if (std::acos(std::min(1.0, std::abs(axis.direction.x()))) > kFarFromX_rad) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format(
            "the head travels along ({:.3f}, {:.3f}, {:.3f}) in the machine's frame, not along X: the spheres' ids or the "
            "machine's coordinates are permuted",
            axis.direction.x(), axis.direction.y(), axis.direction.z()));
  }
  std::array<std::vector<double>, 3> offsets;
  for (std::size_t k = 0; k < count; ++k) {
    const Vector3d offset = position(k) - slope * stations.axis_mm[k];
    for (std::size_t c = 0; c < 3; ++c) offsets[c].push_back(offset(static_cast<Index>(c)));
  }
  const Vector3d offset(median(offsets[0]), median(offsets[1]), median(offsets[2]));
  axis.reasons.resize(count);
  for (std::size_t k = 0; k < count && count > 3; ++k) {
    const Vector3d off = position(k) - slope * stations.axis_mm[k] - offset;
    const double along = off.dot(axis.direction);
    const double sigma =
        std::sqrt(stations.cov.block<6, 6>(6 * static_cast<Index>(k), 6 * static_cast<Index>(k)).topLeftCorner<3, 3>().trace());
    if (off.norm() < kFarOff_mm + 10.0 * sigma * position(k).norm()) continue;
    axis.reasons[k] = fmt::format(
        "it stands {:.2f} mm off the line of the others ({:+.2f} mm along it): its reading of {:.3f} mm is wrong, or "
        "its photographs are of another stop",
        off.norm(), along, stations.axis_mm[k]);
  }
  return axis;
}

std::vector<AxisTerm> AxisMotion::taken() const {
  std::vector<AxisTerm> list;
  for (const base::ErrorMotion& term : terms) {
    if (!term.in_frame) continue;
    const char letter = term.name[1];
    list.push_back({letter == 'Y' || letter == 'B'   ? 1
                    : letter == 'Z' || letter == 'C' ? 2
                                                     : 0,
                    term.order, term.angle, term.significant ? 0.0 : least_w * term.sigma});
  }
  return list;
}

AxisMotion find_motion(const StationPoses& stations, const Carriage& straight, double scale_ppm, double reading_sigma_mm,
                       const CommissionOptions& options) {
  std::set<double> readings(stations.axis_mm.begin(), stations.axis_mm.end());
  const int highest = std::min(kHighestOrder, static_cast<int>(readings.size()) - 1);
  Carriage full = straight;
  full.terms.clear();
  for (int component = 0; component < 3; ++component) {
    for (int order = 2; order <= highest; ++order) full.terms.push_back({component, order, false});
  }
  for (int component = 0; component < 3; ++component) {
    for (int order = 1; order <= std::min(2, highest); ++order) full.terms.push_back({component, order, true});
  }
  // The station nearest to the middle gives the place of linearisation.
  std::size_t nearest = 0;
  for (std::size_t k = 1; k < stations.axis_mm.size(); ++k) {
    if (std::abs(full.place(stations.axis_mm[k])) < std::abs(full.place(stations.axis_mm[nearest]))) nearest = k;
  }
  AxisMotion motion;
  motion.at_middle = stations.machine_from_rig[nearest];
  motion.at_middle.translation_mm -= full.direction * ((stations.axis_mm[nearest] - full.middle_mm) * (1.0 + 1e-6 * scale_ppm));
  const Line line = linearise(stations, full, scale_ppm, reading_sigma_mm, motion.at_middle);
  const auto candidates = static_cast<Index>(full.terms.size());
  const std::vector<Index> all = range(9 + candidates);

  motion.stop_sigma_mm = options.stop_sigma_mm.value_or(0.0);
  motion.stop_sigma_rad = options.stop_sigma_rad.value_or(0.0);
  const double dof = static_cast<double>(line.y.size()) - static_cast<double>(all.size());
  if (dof >= 1.0) {
    const Fit whole = fit(line, all, line.covariance(motion.stop_sigma_mm, motion.stop_sigma_rad));
    if (whole.good) motion.excess_p = 1.0 - math::chi_square_cdf(whole.square_sum, dof);
    if (whole.good && motion.excess_p < kExcessLevel && !(options.stop_sigma_mm && options.stop_sigma_rad)) {
      std::tie(motion.stop_sigma_mm, motion.stop_sigma_rad) = scatter(line, all, options);
      motion.stops_scatter = true;
      motion.degrees = dof;
    }
  }

  const double quantile = 1.0 - options.significance / 2.0;
  motion.least_w = motion.degrees > 0.0 ? math::student_quantile(quantile, motion.degrees) : math::normal_quantile(quantile);

  const MatrixXd covariance = line.covariance(motion.stop_sigma_mm, motion.stop_sigma_rad);
  std::vector<Index> in = range(9);
  const auto p_of = [&](const Fit& at, Index place) {
    return two_sided_p(at.x(place) / std::sqrt(at.cov(place, place)), motion.degrees);
  };
  for (Index round = 0; round < candidates; ++round) {
    double best_p = options.significance;
    Index best = -1;
    for (Index c = 9; c < 9 + candidates; ++c) {
      if (std::find(in.begin(), in.end(), c) != in.end()) continue;
      const std::vector<Index> columns = with(in, c);
      const Fit trial = fit(line, columns, covariance);
      if (!trial.good) continue;
      const double p = p_of(trial, static_cast<Index>(std::find(columns.begin(), columns.end(), c) - columns.begin()));
      if (p < best_p) {
        best_p = p;
        best = c;
      }
    }
    if (best < 0) break;
    in = with(in, best);
  }
  for (bool dropped = true; dropped;) {
    dropped = false;
    const Fit at = fit(line, in, covariance);
    if (!at.good) break;
    double worst_p = options.significance;
    std::size_t worst = 0;
    for (std::size_t i = 9; i < in.size(); ++i) {
      if (const double p = p_of(at, static_cast<Index>(i)); p >= worst_p) {
        worst_p = p;
        worst = i;
      }
    }
    if (worst > 0) {
      in.erase(in.begin() + static_cast<std::ptrdiff_t>(worst));
      dropped = true;
    }
  }
  if (const Fit at = fit(line, in, covariance); at.good) {
    const MatrixXd design = line.design(Eigen::all, in);
    const VectorXd residual = line.y - design * at.x;
    const MatrixXd residual_cov = covariance - design * at.cov * design.transpose();
    for (std::size_t k = 0; k < stations.axis_mm.size(); ++k) {
      const Index first = 6 * static_cast<Index>(k);
      const base::Matrix6d local = at_origin(stations.machine_from_rig[k].translation_mm);
      motion.off_axis.emplace_back(local * residual.segment<6>(first));
      const base::Matrix6d own = local * covariance.block<6, 6>(first, first) * local.transpose();
      const base::Matrix6d left = local * residual_cov.block<6, 6>(first, first) * local.transpose();
      const base::Vector6d scale = own.diagonal().cwiseSqrt().cwiseInverse();
      motion.w.push_back(
          standardised(scale.asDiagonal() * motion.off_axis.back(), scale.asDiagonal() * left * scale.asDiagonal()));
    }
  }
  for (Index c = 0; c < candidates; ++c) {
    const AxisTerm& term = full.terms[static_cast<std::size_t>(c)];
    base::ErrorMotion tested{.name = motion_name(term), .order = term.order, .angle = term.angle};
    const bool is_in = std::find(in.begin(), in.end(), 9 + c) != in.end();
    const std::vector<Index> columns = is_in ? in : with(in, 9 + c);
    const Fit at = fit(line, columns, covariance);
    if (at.good) {
      const auto place = static_cast<Index>(std::find(columns.begin(), columns.end(), 9 + c) - columns.begin());
      tested.coefficient = at.x(place);
      tested.sigma = std::sqrt(at.cov(place, place));
      tested.p = p_of(at, place);
    }
    tested.significant = is_in;
    tested.in_frame = is_in || (options.small_motions && tested.sigma > 0.0);
    motion.terms.push_back(std::move(tested));
  }
  return motion;
}

}  // namespace crosstie::bundle::detail
