#include "scan/detail/fringe_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "scan/detail/fringe_kernel.h"
#include "scan/detail/rows.h"

namespace crosstie::scan::detail {
namespace {

using base::Image;
using base::Result;

constexpr double kSamplePixels = 1e5;     // of which the residuals' statistics are made
constexpr double kMarginSigmas = 3.0;     // of an end of the grey scale: samples nearer to it may have been cut off by noise
constexpr float kLeastModulation = 3.0F;  // levels: of pixels that tell the noise
constexpr float kClear = 4.0F;            // levels between their darkest or brightest sample and the ends of the grey scale,
constexpr float kLeastClear = 1.0F;       // in the dark, where there are hardly pixels with so many
constexpr std::size_t kFewPixels = 2000;  // of a set

/// The least squares of one pixel over some of its samples.
struct PixelFit {
  double mean = 0.0, a = 0.0, b = 0.0;
  double squares = 0.0;
  double gain = 0.0;
  int used = 0;
};

class Solver {
 public:
  Solver(const std::vector<double>& shifts, double white_level) : low_(0.0), high_(white_level), white_(white_level) {
    for (const double shift : shifts) {
      const double angle = 2.0 * std::numbers::pi * shift;
      directions_.emplace_back(1.0, std::cos(angle), std::sin(angle));
    }
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    for (const Eigen::Vector3d& d : directions_) normal += d * d.transpose();
    const Eigen::Matrix3d inverse = normal.inverse();
    for (const Eigen::Vector3d& d : directions_) weights_.emplace_back(inverse * d);
    plan_.steps = static_cast<int>(shifts.size());
    for (int n = 0; n < plan_.steps; ++n) {
      const auto i = static_cast<std::size_t>(n);
      const Eigen::Vector3d& weights = weights_[i];
      plan_.cosine[i] = static_cast<float>(directions_[i].y());
      plan_.sine[i] = static_cast<float>(directions_[i].z());
      plan_.mean_weight[i] = static_cast<float>(weights.x());
      plan_.a_weight[i] = static_cast<float>(weights.y());
      plan_.b_weight[i] = static_cast<float>(weights.z());
    }
    plan_.square_weight = plan_.steps > 3 ? 1.0F / static_cast<float>(plan_.steps - 3) : 0.0F;
    set_margins(0.0, 0.0);
    gain_ = 0.5 * (inverse(1, 1) + inverse(2, 2));  // of uneven shifts the mean over all phases
  }

  /// What lies within these of the grey scale's ends is looked at again.
  void set_margins(double low, double high) {
    low_ = low;
    high_ = white_ - high;
    plan_.clip_low = static_cast<float>(low_);
    plan_.clip_high = static_cast<float>(high_);
  }

  [[nodiscard]] const FringePlan& plan() const { return plan_; }
  [[nodiscard]] double gain() const { return gain_; }

  /// Over the samples that are not cut off; nothing where fewer than three are left, or do not tell a phase.
  [[nodiscard]] std::optional<PixelFit> fit(const std::vector<double>& levels) const {
    std::vector<char> use(levels.size(), 1);
    for (std::size_t n = 0; n < levels.size(); ++n) use[n] = levels[n] > 0.0 && levels[n] < white_;
    auto result = fit_of(levels, use);
    // Noise decides whether a sample near the end of the scale is cut off; taking only those that were not would bias the rest.
    // What all others predict for it decides instead.
    for (int pass = 0; result && pass < 3; ++pass) {
      bool changed = false;
      for (std::size_t n = 0; n < levels.size(); ++n) {
        const double predicted = result->mean + result->a * directions_[n].y() + result->b * directions_[n].z();
        const char fits = predicted > low_ && predicted < high_ && levels[n] < white_;
        changed = changed || fits != use[n];
        use[n] = fits;
      }
      if (!changed) break;
      result = fit_of(levels, use);
    }
    return result;
  }

  /// Of a pixel none of whose samples is cut off.
  void residuals_of_all(const std::vector<double>& levels, std::vector<double>& residuals) const {
    Eigen::Vector3d fit = Eigen::Vector3d::Zero();
    for (std::size_t n = 0; n < levels.size(); ++n) fit += levels[n] * weights_[n];
    for (std::size_t n = 0; n < levels.size(); ++n) residuals[n] = levels[n] - fit.dot(directions_[n]);
  }

 private:
  [[nodiscard]] std::optional<PixelFit> fit_of(const std::vector<double>& levels, const std::vector<char>& use) const {
    constexpr double kWeakest = 0.05;  // least pivot of the normal matrix per sample: shifts too near to each other
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    PixelFit result;
    for (std::size_t n = 0; n < levels.size(); ++n) {
      if (!use[n]) continue;
      normal += directions_[n] * directions_[n].transpose();
      right += levels[n] * directions_[n];
      ++result.used;
    }
    if (result.used < 3) return {};
    const Eigen::LDLT<Eigen::Matrix3d> ldlt(normal);
    if (!(ldlt.vectorD().minCoeff() > kWeakest)) return {};
    const Eigen::Vector3d x = ldlt.solve(right);
    result.mean = x(0);
    result.a = x(1);
    result.b = x(2);
    for (std::size_t n = 0; n < levels.size(); ++n) {
      if (use[n]) result.squares += std::pow(levels[n] - x.dot(directions_[n]), 2);
    }
    const double modulation = std::hypot(x(1), x(2));
    if (result.mean - modulation < -low_) return {};  // less than no light
    const Eigen::Vector3d across(0.0, -x(2) / std::max(modulation, 1e-12), x(1) / std::max(modulation, 1e-12));
    result.gain = across.dot(ldlt.solve(across));
    return result;
  }

  std::vector<Eigen::Vector3d> directions_;
  std::vector<Eigen::Vector3d> weights_;  // A, a and b are their sums over the levels
  double low_;
  double high_;
  double white_;
  double gain_ = 0.0;
  FringePlan plan_ = {};
};

double turns_of(double a, double b) {
  const double turns = std::atan2(b, a) / (2.0 * std::numbers::pi);
  return turns < 0.0 ? std::min(turns + 1.0, 1.0 - 1e-7) : turns;
}

/// The samples of one row in all images.
template <typename Sample>
std::array<const Sample*, kMaxSteps> rows_of(const std::vector<Image>& images, int y) {
  std::array<const Sample*, kMaxSteps> rows = {};
  for (std::size_t n = 0; n < images.size(); ++n) rows[n] = images[n].view().template row<Sample>(y);
  return rows;
}

/// Every sixteenth number, in no order that the fringes could share.
bool one_of_16(std::uint32_t number) { return (number * 2654435761U) >> 28U == 0; }

/// Residuals of pixels all over the image.
template <typename Sample>
void sample_residuals(const std::vector<Image>& images, const std::vector<double>& shifts, const Solver& solver, float clear,
                      ResidualStatistics& statistics, ImageDrift& drift) {
  const auto width = static_cast<std::size_t>(images.front().width());
  const int height = images.front().height();
  const auto every = static_cast<std::size_t>(std::max(1.0, std::sqrt(static_cast<double>(width) * height / kSamplePixels)));
  const std::size_t count = (width + every - 1) / every;
  const float brightest = static_cast<float>(images.front().white_level()) - kClear;
  std::vector<float> turns(count), modulation(count), mean(count), squares(count);
  std::vector<std::uint8_t> clipped(count);
  std::vector<std::vector<Sample>> samples(images.size(), std::vector<Sample>(count));
  std::array<const Sample*, kMaxSteps> sampled = {};
  for (std::size_t n = 0; n < images.size(); ++n) sampled[n] = samples[n].data();
  std::vector<double> levels(images.size()), residuals(images.size());
  std::uint32_t sample = 0;
  for (std::size_t y = 0; y < static_cast<std::size_t>(height); y += every) {
    const auto rows = rows_of<Sample>(images, static_cast<int>(y));
    for (std::size_t n = 0; n < images.size(); ++n) {
      for (std::size_t i = 0; i < count; ++i) samples[n][i] = rows[n][i * every];
    }
    solve_fringes(solver.plan(), sampled.data(), count,
                  {turns.data(), modulation.data(), mean.data(), squares.data(), clipped.data()});
    for (std::size_t i = 0; i < count; ++i) {
      if (clipped[i] || modulation[i] < kLeastModulation || mean[i] - modulation[i] < clear ||
          mean[i] + modulation[i] > brightest)
        continue;
      for (std::size_t n = 0; n < levels.size(); ++n) levels[n] = samples[n][i];
      solver.residuals_of_all(levels, residuals);
      statistics.add(turns[i], modulation[i], mean[i], shifts, residuals);
      if (one_of_16(sample++)) drift.add(turns[i], modulation[i], mean[i], residuals);
    }
  }
}

/// A pixel that was solved without those of its samples that are cut off.
struct ClippedPixel {
  std::size_t pixel;
  float gain;
};

template <typename Sample>
void solve_rows(const std::vector<Image>& images, const Solver& solver, int first, int last, FringeSet& set,
                std::vector<ClippedPixel>& clipped_pixels) {
  const auto width = static_cast<std::size_t>(images.front().width());
  std::vector<std::uint8_t> clipped(width);
  std::vector<double> levels(images.size());
  for (int y = first; y < last; ++y) {
    const std::size_t at = static_cast<std::size_t>(y) * width;
    const auto rows = rows_of<Sample>(images, y);
    const bool any = solve_fringes(solver.plan(), rows.data(), width,
                                   {&set.turns[at], &set.modulation[at], &set.mean[at], &set.squares[at], clipped.data()});
    if (!any) continue;
    for (std::size_t x = 0; x < width; ++x) {
      if (!clipped[x]) continue;
      for (std::size_t n = 0; n < levels.size(); ++n) levels[n] = rows[n][x];
      const auto fit = solver.fit(levels);
      set.modulation[at + x] = fit ? static_cast<float>(std::hypot(fit->a, fit->b)) : 0.0F;
      if (!fit) continue;
      clipped_pixels.push_back({at + x, static_cast<float>(fit->gain)});
      set.turns[at + x] = static_cast<float>(turns_of(fit->a, fit->b));
      set.mean[at + x] = static_cast<float>(fit->mean);
      set.squares[at + x] = fit->used > 3 ? static_cast<float>(fit->squares / (fit->used - 3)) : 0.0F;
    }
  }
}

}  // namespace

Result<FringeSet> solve_set(const std::vector<Image>& images, const std::vector<double>& shifts, double exposure,
                            const SolveSetOptions& options, ResidualStatistics& statistics, const base::Progress& progress) {
  const int width = images.front().width();
  const int height = images.front().height();
  const bool bytes = images.front().bits() == 8;
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const double white = images.front().white_level();
  Solver solver(shifts, white);
  ImageDrift drift(shifts);
  const std::size_t before = statistics.size();
  for (const float clear : {kClear, kLeastClear}) {
    if (statistics.size() - before >= kFewPixels) break;
    drift = ImageDrift(shifts);
    if (bytes) {
      sample_residuals<std::uint8_t>(images, shifts, solver, clear, statistics, drift);
    } else {
      sample_residuals<std::uint16_t>(images, shifts, solver, clear, statistics, drift);
    }
  }
  const base::GreyNoise noise = options.noise ? *options.noise : statistics.noise();
  solver.set_margins(std::max(1.0, kMarginSigmas * std::sqrt(noise.variance(0.0))),
                     kMarginSigmas * std::sqrt(noise.variance(white)));

  FringeSet set;
  set.drift = drift.estimate();
  set.steps = static_cast<int>(images.size());
  set.exposure = exposure;
  set.gain = solver.gain();
  set.white_level = white;
  for (auto* plane : {&set.turns, &set.modulation, &set.mean, &set.squares}) plane->resize(pixels);
  std::vector<std::vector<ClippedPixel>> clipped(band_count(height));
  auto done = over_rows(height, options.threads, "phases", progress, [&](int first, int last) {
    if (bytes) {
      solve_rows<std::uint8_t>(images, solver, first, last, set, clipped[band_of(first)]);
    } else {
      solve_rows<std::uint16_t>(images, solver, first, last, set, clipped[band_of(first)]);
    }
  });
  if (!done) return base::fail(std::move(done));
  if (std::any_of(clipped.begin(), clipped.end(), [](const auto& band) { return !band.empty(); })) {
    set.gains.assign(pixels, static_cast<float>(set.gain));
    for (const auto& band : clipped) {
      for (const ClippedPixel& one : band) set.gains[one.pixel] = one.gain;
    }
  }
  return set;
}

}  // namespace crosstie::scan::detail
