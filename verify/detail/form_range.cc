#include "verify/detail/form_range.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <utility>

#include <Eigen/Cholesky>

#include "math/distributions.h"

namespace crosstie::verify::detail {
namespace {

/// Points by the square place in which they lie.
std::vector<std::vector<int>> places_of(const std::vector<Eigen::Vector2d>& place_mm, double edge_mm) {
  std::map<std::pair<long, long>, std::vector<int>> cells;
  for (std::size_t i = 0; i < place_mm.size(); ++i) {
    cells[{std::lround(std::floor(place_mm[i].x() / edge_mm)), std::lround(std::floor(place_mm[i].y() / edge_mm))}].push_back(
        static_cast<int>(i));
  }
  std::vector<std::vector<int>> result;
  result.reserve(cells.size());
  for (auto& [cell, members] : cells) result.push_back(std::move(members));
  return result;
}

/// Mean distance of neighbours, from the extent and the number.
double point_distance(const FormPoints& points) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(HUGE_VAL);
  Eigen::Vector2d high = -low;
  for (const Eigen::Vector2d& p : points.place_mm) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return std::sqrt(std::max(1e-12, (high - low).prod() / static_cast<double>(points.place_mm.size())));
}

}  // namespace

void raise_to_scatter(FormPoints& points, Eigen::Index kept) {
  const auto squares = points.deviation_mm.head(kept).array().square();
  const double dof = static_cast<double>(kept - points.design.cols());
  if (points.variance_mm2.head(kept).minCoeff() > 0.0) {
    points.variance_mm2 *= std::max(1.0, (squares / points.variance_mm2.head(kept).array()).sum() / dof);
  } else {
    points.variance_mm2.setConstant(squares.sum() / dof);
  }
}

Correlation correlation_of(const FormPoints& points) {
  constexpr std::size_t kLeastPlaces = 16;
  constexpr double kChance = 0.01;
  Correlation result;
  const double step = point_distance(points);
  double largest = 1.0;
  for (double factor = 2.0;; factor *= 2.0) {
    const auto places = places_of(points.place_mm, factor * step);
    if (places.size() < kLeastPlaces) break;
    double sum = 0.0;
    int used = 0;
    for (const auto& place : places) {
      if (static_cast<double>(place.size()) < 0.5 * factor * factor) continue;  // a border's splinter is no place of this size
      double mean = 0.0;
      double variance = 0.0;
      for (const int i : place) {
        mean += points.deviation_mm(i);
        variance += points.variance_mm2(i);
      }
      sum += mean * mean / variance;
      ++used;
    }
    const double dof = used - static_cast<double>(points.design.cols());
    if (dof < static_cast<double>(kLeastPlaces) / 2.0) continue;
    const double square = sum / dof;
    if (square > math::chi_square_quantile(1.0 - kChance, dof) / dof && square > largest) {
      largest = square;
      result = {1.0 / square, factor * step};
    }
  }
  return result;
}

double trimmed_range(std::vector<double>& values, std::size_t count) {
  const auto kept = values.end() - static_cast<std::ptrdiff_t>(std::min(count, values.size() - 1));
  if (count > 0)
    std::nth_element(values.begin(), kept, values.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
  const auto [low, high] = std::minmax_element(values.begin(), kept);
  return *high - *low;
}

double range_sigma(const FormPoints& points, double discard_share, double place_mm, int resamples) {
  std::vector<std::vector<int>> places;
  if (place_mm > 0.0) {
    places = places_of(points.place_mm, place_mm);
  } else {
    for (std::size_t i = 0; i < points.place_mm.size(); ++i) places.push_back({static_cast<int>(i)});
  }
  std::mt19937_64 random(1);
  const Eigen::Index unknowns = points.design.cols();
  double sum = 0.0;
  double squares = 0.0;
  for (int k = 0; k < resamples; ++k) {
    std::vector<int> drawn;
    drawn.reserve(points.place_mm.size());
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(unknowns, unknowns);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(unknowns);
    for (std::size_t p = 0; p < places.size(); ++p) {
      for (const int i : places[random() % places.size()]) {
        drawn.push_back(i);
        const auto row = points.design.row(i);
        normal.noalias() += row.transpose() * row;
        right.noalias() += row.transpose() * points.deviation_mm(i);
      }
    }
    const Eigen::VectorXd change = normal.ldlt().solve(right);
    std::vector<double> values;
    values.reserve(drawn.size());
    for (const int i : drawn) values.push_back(points.deviation_mm(i) - points.design.row(i).dot(change));
    const auto count = static_cast<std::size_t>(discard_share * static_cast<double>(values.size()));
    const double range = trimmed_range(values, count);
    sum += range;
    squares += range * range;
  }
  return std::sqrt(std::max(0.0, (squares - sum * sum / resamples) / (resamples - 1)));
}

double predicted_range(const Eigen::VectorXd& variance_mm2, double discard_share) {
  const auto n = static_cast<double>(variance_mm2.size());
  const double share = std::max(discard_share, 0.5 / n);
  const double largest = std::sqrt(variance_mm2.maxCoeff());
  if (!(largest > 0.0)) return 0.0;
  double low = 0.0;
  double high = 10.0 * largest;
  for (int k = 0; k < 60; ++k) {
    const double q = 0.5 * (low + high);
    double beyond = 0.0;
    for (const double variance : variance_mm2) {
      if (variance > 0.0) beyond += 2.0 * math::normal_cdf(-q / std::sqrt(variance)) / n;
    }
    (beyond > share ? low : high) = q;
  }
  return low + high;
}

}  // namespace crosstie::verify::detail
