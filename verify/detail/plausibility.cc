#include "verify/detail/plausibility.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "verify/detail/robust_fit.h"

namespace crosstie::verify::detail {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;
using base::Warning;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using math::AlignmentPair;

constexpr double kUnitTolerance = 0.02;     // of a ratio of lengths to a unit's factor
constexpr double kScaleTolerance = 0.005;   // beyond: no measurement error, but another size
constexpr double kPoorFit = 0.01;           // median deviation over the extent of the points
constexpr double kMirrorSuspicion = 1e-3;   // the same, from which a mirrored fit is tried
constexpr double kMirrorAdvantage = 0.1;    // median of the mirrored over that of the plain fit
constexpr double kAxisTolerance = 0.01;     // of a rotation matrix to a permutation, about half a degree
constexpr double kGrossMedians = 8.0;       // distance over its median: beyond any normal spread of thousands of points
constexpr double kGrossSigmas = 5.0;        // and over its predicted sigma, where there is one
constexpr double kRoundingOfExtent = 1e-9;  // below, a deviation is rounding
constexpr double kFramesDiffer = 10.0;      // untransformed over fitted median
constexpr std::size_t kFewPoints = 5;

struct Unit {
  double mm;
  const char* pair;
};
constexpr std::array<Unit, 5> kUnits = {
    {{10.0, "cm and mm"}, {25.4, "inches and mm"}, {304.8, "feet and mm"}, {1000.0, "m and mm"}, {1e6, "um and m"}}};

double extent(std::span<const AlignmentPair> pairs) {
  Vector3d centre = Vector3d::Zero();
  for (const AlignmentPair& pair : pairs) centre += pair.a_mm / static_cast<double>(pairs.size());
  double sum = 0.0;
  for (const AlignmentPair& pair : pairs) sum += (pair.a_mm - centre).squaredNorm();
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

/// Median ratio of measured to nominal lengths, over neighbours in the list at several distances.
std::optional<double> length_ratio(std::span<const AlignmentPair> pairs) {
  std::vector<double> ratios;
  for (std::size_t step = 1; step < pairs.size() && ratios.size() < 20000; ++step) {
    for (std::size_t i = 0; i + step < pairs.size(); ++i) {
      const double nominal = (pairs[i].a_mm - pairs[i + step].a_mm).norm();
      if (nominal > 0.0) ratios.push_back((pairs[i].b_mm - pairs[i + step].b_mm).norm() / nominal);
    }
  }
  if (ratios.empty()) return std::nullopt;
  const auto middle = ratios.begin() + static_cast<std::ptrdiff_t>(ratios.size() / 2);
  std::nth_element(ratios.begin(), middle, ratios.end());
  return *middle;
}

Result<> check_units(double ratio) {
  for (const Unit& unit : kUnits) {
    for (const double factor : {unit.mm, 1.0 / unit.mm}) {
      if (std::abs(ratio / factor - 1.0) > kUnitTolerance) continue;
      return fail(
          ErrorCode::kBadInput,
          fmt::format("lengths of the measurement are {:.6g} times those of the reference: the factor between {}; state "
                      "the right unit of one of the two lists",
                      ratio, unit.pair));
    }
  }
  return {};
}

/// "x from -y, y from x": how the axes of the reference come from those of the measurement, if the matrix is a permutation.
std::optional<std::string> permutation_text(const Matrix3d& matrix) {
  std::string text;
  for (int row = 0; row < 3; ++row) {
    Eigen::Index column = 0;
    matrix.row(row).cwiseAbs().maxCoeff(&column);
    Eigen::RowVector3d unit = Eigen::RowVector3d::Zero();
    unit(column) = std::copysign(1.0, matrix(row, column));
    if ((matrix.row(row) - unit).norm() > kAxisTolerance) return std::nullopt;
    if (column == row && unit(column) > 0.0) continue;
    text += fmt::format("{}{} from {}{}", text.empty() ? "" : ", ", "xyz"[row], unit(column) < 0.0 ? "-" : "", "xyz"[column]);
  }
  if (text.empty()) return std::nullopt;
  return text;
}

Result<> check_mirror(std::span<const AlignmentPair> pairs, const RobustFit& plain, double extent_mm, bool with_scale) {
  if (plain.median_mm < kMirrorSuspicion * extent_mm) return {};
  const auto mirror = robust_fit(mirrored(pairs), with_scale);
  if (!mirror || mirror->median_mm > kMirrorAdvantage * plain.median_mm) return {};
  const Matrix3d matrix = mirror->a_from_b.rotation.toRotationMatrix() * Vector3d(1.0, 1.0, -1.0).asDiagonal();
  const auto axes = permutation_text(matrix);
  return fail(
      ErrorCode::kBadInput,
      fmt::format("the measurement is the mirror image of the reference: one of the two frames is left-handed{}; correct "
                  "the axes in its file",
                  axes ? fmt::format(" (the reference's {})", *axes) : ""));
}

void warn_of_gross_points(const Partners& partners, std::span<const std::size_t> index, const RobustFit& fit, double extent_mm,
                          std::vector<Warning>& warnings) {
  if (index.size() < kFewPoints) return;
  const double limit_mm = std::max(kGrossMedians * fit.median_mm, kRoundingOfExtent * extent_mm);
  for (std::size_t i = 0; i < index.size(); ++i) {
    const AlignmentPair& pair = partners.pairs[index[i]];
    const double sigma_mm = std::sqrt((pair.cov_a_mm2 + pair.cov_b_mm2).trace());
    if (fit.distance_mm[i] <= limit_mm || fit.distance_mm[i] <= kGrossSigmas * sigma_mm) continue;
    const int id = partners.ids[index[i]];
    warnings.push_back(
        {"gross_point", std::to_string(id),
         fmt::format("point {} lies {:.3f} mm from its reference, the middle point {:.4f} mm: moved, mistaken or "
                     "misnumbered; the fit leans towards it, so correct or exclude it",
                     id, fit.distance_mm[i], fit.median_mm)});
  }
}

double untransformed_median(std::span<const AlignmentPair> pairs) {
  std::vector<double> distance;
  for (const AlignmentPair& pair : pairs) distance.push_back((pair.a_mm - pair.b_mm).norm());
  std::sort(distance.begin(), distance.end());
  return distance[distance.size() / 2];
}

}  // namespace

Result<std::vector<Warning>> check_plausibility(const Partners& partners, Fit fit) {
  std::vector<std::size_t> index;
  for (std::size_t i = 0; i < partners.pairs.size(); ++i) {
    if (partners.used[i]) index.push_back(i);
  }
  const std::vector<AlignmentPair> pairs = partners.used_pairs();
  std::vector<Warning> warnings;
  const bool with_scale = fit == Fit::kSimilarity;
  if (const auto ratio = length_ratio(pairs)) {
    if (!with_scale) {
      if (auto ok = check_units(*ratio); !ok) return fail(std::move(ok));
    }
    if (std::abs(*ratio - 1.0) > kScaleTolerance) {
      warnings.push_back({"scale_mismatch", "",
                          fmt::format("lengths of the measurement are {:.6g} times those of the reference; that is no error of "
                                      "measurement but another scale: check the scale bars or the unit",
                                      *ratio)});
    }
  }
  if (pairs.size() < kFewPoints) {
    warnings.push_back(
        {"few_points", "", fmt::format("only {} common points: a best fit through so few hides errors", pairs.size())});
  }
  const auto robust = robust_fit(pairs, with_scale);
  if (!robust) return warnings;

  const double extent_mm = extent(pairs);
  if (auto ok = check_mirror(pairs, *robust, extent_mm, with_scale); !ok) return fail(std::move(ok));
  warn_of_gross_points(partners, index, *robust, extent_mm, warnings);
  if (robust->median_mm > kPoorFit * extent_mm) {
    warnings.push_back({"poor_fit", "",
                        fmt::format("half of the points lie over {:.3f} mm from their reference after the fit, on an object of "
                                    "{:.0f} mm (rms radius): are the two lists of the same object, numbered alike?",
                                    robust->median_mm, extent_mm)});
  } else if (const auto axes = permutation_text(robust->a_from_b.rotation.toRotationMatrix())) {
    warnings.push_back({"permuted_axes", "", fmt::format("the axes are permuted: the reference's {}", *axes)});
  }
  const double limit_mm = std::max(kFramesDiffer * robust->median_mm, kRoundingOfExtent * extent_mm);
  if (fit == Fit::kNone && untransformed_median(pairs) > limit_mm) {
    warnings.push_back(
        {"frames_differ", "",
         fmt::format("as they stand half of the points lie over {:.3f} mm from their reference, after a rigid fit "
                     "{:.4f} mm: the two frames differ",
                     untransformed_median(pairs), robust->median_mm)});
  }
  return warnings;
}

}  // namespace crosstie::verify::detail
