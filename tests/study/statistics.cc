#include "tests/study/statistics.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "math/distributions.h"

namespace crosstie::study {

MeanSquare mean_square(const std::vector<Square>& seeds, double level) {
  MeanSquare result;
  double sum = 0.0;
  for (const Square& seed : seeds) {
    sum += seed.square;
    result.dof += seed.dof;
  }
  if (result.dof <= 0.0) return result;
  result.mean = sum / result.dof;
  result.expected = {math::chi_square_quantile(0.5 * (1.0 - level), result.dof) / result.dof,
                     math::chi_square_quantile(0.5 * (1.0 + level), result.dof) / result.dof};
  return result;
}

double quantile(std::vector<double> values, double p) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  const double at = p * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return std::lerp(values[below], values[above], at - static_cast<double>(below));
}

Interval bootstrap_mean(const std::vector<double>& seeds, double level, std::uint64_t random_seed) {
  if (seeds.empty()) return {};
  constexpr int kRounds = 5000;
  std::mt19937_64 random(random_seed);
  std::vector<double> means;
  for (int round = 0; round < kRounds; ++round) {
    double sum = 0.0;
    for (std::size_t i = 0; i < seeds.size(); ++i) sum += seeds[random() % seeds.size()];
    means.push_back(sum / static_cast<double>(seeds.size()));
  }
  return {quantile(means, 0.5 * (1.0 - level)), quantile(means, 0.5 * (1.0 + level))};
}

}  // namespace crosstie::study
