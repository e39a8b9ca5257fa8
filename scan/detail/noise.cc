#include "scan/detail/noise.h"

#include <algorithm>
#include <cmath>

#include "math/distributions.h"
#include "math/median.h"

namespace crosstie::scan::detail {
namespace {

constexpr double kTrimmed = 10.0;           // medians: squares beyond are movement and edges, not noise
constexpr double kLevels = 32.0;            // groups of pixels by their mean level
constexpr double kLeastWidth = 2.0;         // of a group, in grey levels: below, whole numbers and their parity would show
constexpr double kLeastSpread = 0.15;       // of the levels over their size, for the noise to be told to grow with them
constexpr std::size_t kLeastInLevel = 200;  // pixels: a group with fewer is joined to the next

/// read + shot * mean through the levels, neither negative; weighted by the inverse square of the variance, as the scatter of a
/// variance is proportional to it.
template <typename Level>
base::GreyNoise line_through(const std::vector<Level>& levels) {
  double w = 0.0, wx = 0.0, wy = 0.0, wxx = 0.0, wxy = 0.0;
  for (const auto& level : levels) {
    const double weight = 1.0 / std::max(1e-12, level.variance * level.variance);
    w += weight;
    wx += weight * level.mean;
    wy += weight * level.variance;
    wxx += weight * level.mean * level.mean;
    wxy += weight * level.mean * level.variance;
  }
  if (w == 0.0) return {};
  const double determinant = w * wxx - wx * wx;
  // Levels that differ little tell no slope: then the same noise everywhere.
  const double shot = determinant > kLeastSpread * kLeastSpread * w * wxx ? (w * wxy - wx * wy) / determinant : 0.0;
  const double read = (wy - shot * wx) / w;
  if (shot < 0.0) return {wy / w, 0.0};
  if (read < 0.0) return {0.0, wxy / wxx};
  return {read, shot};
}

/// Mean of the squares below kTrimmed medians, over that of chi-square variables of these degrees of freedom. Less sensitive than the
/// median to samples of one pixel that have different noise, since they have different levels.
double trimmed_variance(std::vector<double>& squares, int dof) {
  const double limit = kTrimmed * math::median(squares);
  double sum = 0.0;
  double count = 0.0;
  for (const double square : squares) {
    if (square > limit) continue;
    sum += square;
    count += 1.0;
  }
  if (count == 0.0) return 0.0;
  const double cut = kTrimmed * math::chi_square_quantile(0.5, dof);
  return sum / count * math::chi_square_cdf(cut, dof) / math::chi_square_cdf(cut, dof + 2);
}

}  // namespace

void ResidualStatistics::add(double turns, double modulation, double mean, const std::vector<double>& shifts,
                             const std::vector<double>& residuals) {
  const int dof = static_cast<int>(residuals.size()) - 3;
  if (dof < 1) return;
  noise_.reset();
  double square = 0.0;
  for (std::size_t n = 0; n < residuals.size(); ++n) {
    double at = turns - shifts[n];
    if (at < 0.0 || at >= 1.0) at -= std::floor(at);
    const auto bin = std::min(static_cast<std::size_t>(at * kBins), static_cast<std::size_t>(kBins - 1));
    const double product = residuals[n] * modulation;
    products_[bin] += product;
    scatters_[bin] += product * product;
    weights_[bin] += modulation * modulation;
    square += residuals[n] * residuals[n];
  }
  pixels_.push_back({static_cast<float>(mean), static_cast<float>(modulation), static_cast<float>(square / dof), dof});
}

double ResidualStatistics::waveform_square() const {
  double sum = 0.0;
  for (std::size_t b = 0; b < products_.size(); ++b) {
    if (weights_[b] == 0.0) continue;
    sum += (products_[b] * products_[b] - scatters_[b]) / (weights_[b] * weights_[b]);  // less what noise alone makes of it
  }
  return std::max(0.0, sum / kBins);
}

ResidualStatistics::Level ResidualStatistics::level_of(std::span<const Pixel> pixels, double waveform) {
  Level level;
  const auto count = static_cast<double>(pixels.size());
  std::vector<int> all_dof;  // that there are, a few
  for (const Pixel& pixel : pixels) {
    level.mean += pixel.mean;
    if (std::find(all_dof.begin(), all_dof.end(), pixel.dof) == all_dof.end()) all_dof.push_back(pixel.dof);
  }
  level.mean /= count;
  std::vector<double> squares;
  for (const int dof : all_dof) {
    squares.clear();
    const double part = waveform * (dof + 3) / dof;
    for (const Pixel& pixel : pixels) {
      if (pixel.dof == dof) squares.push_back(std::max(0.0, pixel.square - part * pixel.modulation * pixel.modulation));
    }
    level.variance += trimmed_variance(squares, dof) * static_cast<double>(squares.size()) / count;
  }
  return level;
}

base::GreyNoise ResidualStatistics::noise() {
  if (!noise_) noise_ = estimate();
  return *noise_;
}

base::GreyNoise ResidualStatistics::estimate() const {
  if (pixels_.empty()) return {};
  const double waveform = waveform_square();
  const auto [darkest, brightest] =
      std::minmax_element(pixels_.begin(), pixels_.end(), [](const Pixel& a, const Pixel& b) { return a.mean < b.mean; });
  const double lowest = darkest->mean;
  const double width = std::max(kLeastWidth, (static_cast<double>(brightest->mean) - lowest) / kLevels);
  std::vector<std::vector<Pixel>> groups(static_cast<std::size_t>(kLevels) + 1);
  for (const Pixel& pixel : pixels_) {
    groups[static_cast<std::size_t>((static_cast<double>(pixel.mean) - lowest) / width)].push_back(pixel);
  }
  std::vector<Level> levels;
  std::vector<Pixel> joined;
  std::size_t left = pixels_.size();
  for (const std::vector<Pixel>& group : groups) {
    joined.insert(joined.end(), group.begin(), group.end());
    left -= group.size();
    if (joined.size() < kLeastInLevel || (left > 0 && left < kLeastInLevel)) continue;
    levels.push_back(level_of(joined, waveform));
    joined.clear();
  }
  if (!joined.empty()) levels.push_back(level_of(joined, waveform));
  return line_through(levels);
}

}  // namespace crosstie::scan::detail
