#include "edge/detail/foreign_stretch.h"

#include <algorithm>
#include <cmath>

#include "math/distributions.h"

namespace crosstie::edge::detail {
namespace {

constexpr double kMostForeign = 0.25;         // of the points
constexpr double kVarianceOfNearest = 0.368;  // of the nearest three quarters of a normal distribution, over its own
constexpr std::size_t kLeastPoints = 12;      // three quarters of which determine a circle in space with redundancy
constexpr std::size_t kStarts = 16;           // round a closed rim
constexpr std::size_t kFollowed = 2;          // of them
constexpr int kFirstSteps = 2;                // of concentration, for each start
constexpr int kSteps = 10;                    // for those that are followed
constexpr int kRounds = 20;                   // of judgement
constexpr double kFar = 3.29;                 // sigmas: one point of a thousand
constexpr double kBeside = 1.96;              // of a point beside a stretch
constexpr double kChance = 0.01;              // of one rim, as for rejections elsewhere
constexpr double kTogether = 2.0;             // points that deviate together, at least: they count as one
constexpr std::size_t kShortest = 2;          // points of a stretch

/// Distances in the surface across the rim, without what the points share. Not a number beyond the end of an open nominal.
struct Offsets {
  std::vector<double> u_mm;
  std::vector<double> variance_mm2;  ///< of each point alone
};

std::optional<Offsets> offsets(const base::EdgeCurve& edge, Nominal nominal, const NominalState& state) {
  nominal.size_mm = state.size_mm;
  const auto curve = NominalCurve::make(nominal);
  if (!curve) return std::nullopt;
  base::EdgeCurve alone = edge;
  for (std::size_t i = 0; i < alone.points.size() && state.shared.size() > 0; ++i)
    alone.points[i].point_mm -= edge.shared_mm.middleRows<3>(static_cast<Eigen::Index>(3 * i)) * state.shared;
  const EdgeDeviations off = deviations(alone, *curve, state.frame_from_hole);
  Offsets result{std::vector<double>(edge.points.size(), std::nan("")), std::vector<double>(edge.points.size(), 0.0)};
  for (std::size_t k = 0; k < off.points.size(); ++k) {
    result.u_mm[off.points[k]] = off.uv_mm(0, static_cast<Eigen::Index>(k));
    result.variance_mm2[off.points[k]] = off.cov_mm2[k](0, 0);
  }
  return result;
}

/// A choice of points, where they lie off the nominal that fits them, and the sum of their squares.
struct Choice {
  std::vector<char> keep;
  Offsets off;
  double squares = HUGE_VAL;
};

/// The fit to a choice of points, and the choice of as many that lie nearest to it, some times in turn.
std::optional<Choice> concentrated(const base::EdgeCurve& edge, const Nominal& nominal, const FitPart& fit_part,
                                   std::vector<char> keep, std::size_t count, int steps) {
  std::optional<Choice> best;
  for (int step = 0; step < steps; ++step) {
    const auto fit = fit_part(part_of(edge, keep));
    if (!fit) return best;
    auto off = offsets(edge, nominal, fit->state);
    if (!off) return best;
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < keep.size(); ++i) {
      if (std::isfinite(off->u_mm[i])) order.push_back(i);
    }
    if (order.size() < count) return best;
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return std::abs(off->u_mm[a]) < std::abs(off->u_mm[b]); });
    Choice choice{std::vector<char>(keep.size(), 0), *std::move(off), 0.0};
    for (std::size_t k = 0; k < count; ++k) {
      choice.keep[order[k]] = 1;
      choice.squares += choice.off.u_mm[order[k]] * choice.off.u_mm[order[k]];
    }
    const bool rests = choice.keep == keep;
    keep = choice.keep;
    if (!best || choice.squares < best->squares) best = std::move(choice);
    if (rests) return best;
  }
  return best;
}

std::optional<Choice> nearest_three_quarters(const base::EdgeCurve& edge, const Nominal& nominal, const FitPart& fit_part) {
  const std::size_t n = edge.points.size();
  const auto left_out = static_cast<std::size_t>(kMostForeign * static_cast<double>(n));
  std::vector<Choice> choices;
  for (std::size_t start = 0; start < kStarts; ++start) {
    // Round a closed rim the piece that is left out goes over its seam; of an open one it moves from end to end.
    const std::size_t first = edge.closed ? start * n / kStarts : start * (n - left_out) / (kStarts - 1);
    std::vector<char> keep(n, 1);
    for (std::size_t k = 0; k < left_out; ++k) keep[(first + k) % n] = 0;
    if (auto choice = concentrated(edge, nominal, fit_part, std::move(keep), n - left_out, kFirstSteps))
      choices.push_back(*std::move(choice));
  }
  const auto is_better = [](const Choice& a, const Choice& b) { return a.squares < b.squares; };
  std::stable_sort(choices.begin(), choices.end(), is_better);
  if (choices.size() > kFollowed) choices.resize(kFollowed);
  std::optional<Choice> best;
  for (const Choice& choice : choices) {
    auto followed = concentrated(edge, nominal, fit_part, choice.keep, n - left_out, kSteps);
    if (followed && (!best || is_better(*followed, *best))) best = std::move(followed);
  }
  return best;
}

/// The form of the kept points: what their own sigmas leave of the mean square of their distances.
double form_variance(const Choice& choice, double share_of_variance) {
  double squares = 0.0, own = 0.0, count = 0.0;
  for (std::size_t i = 0; i < choice.keep.size(); ++i) {
    if (!choice.keep[i] || !std::isfinite(choice.off.u_mm[i])) continue;
    squares += choice.off.u_mm[i] * choice.off.u_mm[i];
    own += choice.off.variance_mm2[i];
    count += 1.0;
  }
  return count > 0.0 ? std::max(0.0, squares / share_of_variance - own) / count : 0.0;
}

std::vector<ForeignStretch> stretches_of(const base::EdgeCurve& edge, const Offsets& off, double form_mm2) {
  const std::size_t n = off.u_mm.size();
  const auto is_beyond = [&](std::size_t i, double sigmas, bool positive) {
    return (off.u_mm[i] > 0.0) == positive && std::abs(off.u_mm[i]) > sigmas * std::sqrt(form_mm2 + off.variance_mm2[i]);
  };
  const auto is_far = [&](std::size_t i) { return is_beyond(i, kFar, off.u_mm[i] > 0.0); };
  // Of a closed rim from a point on that belongs to the nominal: no stretch goes over the seam then.
  std::size_t origin = 0;
  while (edge.closed && origin < n && is_beyond(origin, kBeside, off.u_mm[origin] > 0.0)) ++origin;
  if (origin == n) return {};
  const auto at = [&](std::size_t k) { return (origin + k) % n; };
  std::vector<ForeignStretch> stretches;
  for (std::size_t k = 0; k < n; ++k) {
    if (!is_far(at(k))) continue;
    const bool positive = off.u_mm[at(k)] > 0.0;
    std::size_t first = k, end = k;
    while (end < n && is_beyond(at(end), kFar, positive)) ++end;
    const bool is_stretch = end - k >= kShortest;
    while (end < n && is_beyond(at(end), kBeside, positive)) ++end;
    while (first > 0 && is_beyond(at(first - 1), kBeside, positive)) --first;
    if (is_stretch) {
      ForeignStretch stretch;
      for (std::size_t i = first; i < end; ++i) {
        stretch.points.push_back(at(i));
        if (std::abs(off.u_mm[at(i)]) > std::abs(stretch.most_u_mm)) stretch.most_u_mm = off.u_mm[at(i)];
      }
      stretch.from_mm = edge.points[at(first)].s_mm;
      stretch.length_mm = edge.points[at(end - 1)].s_mm - stretch.from_mm;
      if (stretch.length_mm < 0.0) stretch.length_mm += edge.length_mm;
      stretches.push_back(std::move(stretch));
    }
    k = end - 1;
  }
  return stretches;
}

SplitRim split_by(std::vector<ForeignStretch> stretches, std::size_t n) {
  SplitRim split{std::vector<char>(n, 1), std::move(stretches)};
  for (const ForeignStretch& stretch : split.stretches) {
    for (const std::size_t i : stretch.points) split.keep[i] = 0;
  }
  return split;
}

/// How many neighbours of the kept points deviate together, so that they count as one: 1 + 2 sum of the correlations of u over lags from 1 until one is
/// not positive (initial positive sequence: Geyer, Statistical Science 7(4), 1992).
double points_together(const std::vector<char>& keep, const Offsets& off, bool closed) {
  const std::size_t n = keep.size();
  const auto counts = [&](std::size_t i) { return keep[i] && std::isfinite(off.u_mm[i]); };
  const auto mean_product = [&](std::size_t lag) {
    double sum = 0.0, count = 0.0;
    for (std::size_t i = 0; i < (closed ? n : n - lag); ++i) {
      const std::size_t k = (i + lag) % n;
      if (!counts(i) || !counts(k)) continue;
      sum += off.u_mm[i] * off.u_mm[k];
      count += 1.0;
    }
    return count > 0.0 ? sum / count : 0.0;
  };
  const double variance = mean_product(0);
  double together = 1.0;
  for (std::size_t lag = 1; lag < n / 2; ++lag) {
    const double product = mean_product(lag);
    if (!(product > 0.0)) break;
    together += 2.0 * product / variance;
  }
  return std::max(kTogether, together);
}

/// Fisher's F of a stretch that is left out over its limit: above 1 chance does not explain how much better the rest fits without it.
double significance(const PartFit& without, const PartFit& with, std::size_t n, double together) {
  const auto rows = static_cast<double>(with.redundancy - without.redundancy);
  const auto redundancy = static_cast<double>(without.redundancy);
  if (!(rows > 0.0 && redundancy > 0.0)) return 0.0;
  const double count = static_cast<double>(n) / together;
  const double choices = std::max(1.0, kMostForeign * count * count);  // first points times lengths
  const double ratio = (with.square_sum - without.square_sum) / rows / (without.square_sum / redundancy);
  return ratio / math::f_quantile(1.0 - kChance / choices, rows / together, redundancy / together);
}

/// Those that chance does not explain; the least of the others goes back first.
std::optional<SplitRim> significant(const base::EdgeCurve& edge, const Nominal& nominal, SplitRim split,
                                    const FitPart& fit_part) {
  const std::size_t n = split.keep.size();
  while (!split.stretches.empty()) {
    const auto without = fit_part(part_of(edge, split.keep));
    if (!without) return std::nullopt;
    const auto off = offsets(edge, nominal, without->state);
    if (!off) return std::nullopt;
    const double together = points_together(split.keep, *off, edge.closed);
    double least = 1.0;
    std::optional<std::size_t> back;
    for (std::size_t k = 0; k < split.stretches.size(); ++k) {
      std::vector<char> keep = split.keep;
      for (const std::size_t i : split.stretches[k].points) keep[i] = 1;
      const auto with = fit_part(part_of(edge, keep));
      const double here = with ? significance(*without, *with, n, together) : HUGE_VAL;
      if (here >= least) continue;
      least = here;
      back = k;
    }
    if (!back) return split;
    split.stretches.erase(split.stretches.begin() + static_cast<std::ptrdiff_t>(*back));
    split = split_by(std::move(split.stretches), n);
  }
  return std::nullopt;
}

}  // namespace

base::EdgeCurve part_of(const base::EdgeCurve& edge, const std::vector<char>& keep) {
  base::EdgeCurve part = edge;
  part.points.clear();
  const Eigen::Index causes = edge.shared_mm.cols();
  const auto count = static_cast<Eigen::Index>(std::count(keep.begin(), keep.end(), 1));
  part.shared_mm.resize(3 * count, causes);
  for (std::size_t i = 0; i < keep.size(); ++i) {
    if (!keep[i]) continue;
    if (causes > 0) {
      part.shared_mm.middleRows<3>(static_cast<Eigen::Index>(3 * part.points.size())) =
          edge.shared_mm.middleRows<3>(static_cast<Eigen::Index>(3 * i));
    }
    part.points.push_back(edge.points[i]);
  }
  part.shared_tilt_rad.resize(0, 0);
  return part;
}

std::optional<SplitRim> without_foreign_stretches(const base::EdgeCurve& edge, const Nominal& nominal,
                                                  const FitPart& fit_part) {
  const std::size_t n = edge.points.size();
  if (n < kLeastPoints) return std::nullopt;
  auto choice = nearest_three_quarters(edge, nominal, fit_part);
  if (!choice) return std::nullopt;
  double share = kVarianceOfNearest;
  for (int round = 0; round < kRounds; ++round) {
    const SplitRim split = split_by(stretches_of(edge, choice->off, form_variance(*choice, share)), n);
    share = 1.0;
    const auto left_out = static_cast<double>(std::count(split.keep.begin(), split.keep.end(), 0));
    if (left_out > kMostForeign * static_cast<double>(n)) return std::nullopt;
    if (split.keep == choice->keep) return significant(edge, nominal, split, fit_part);
    const auto fit = fit_part(part_of(edge, split.keep));
    if (!fit) return std::nullopt;
    auto off = offsets(edge, nominal, fit->state);
    if (!off) return std::nullopt;
    choice = Choice{split.keep, *std::move(off), 0.0};
  }
  return std::nullopt;  // the judgement goes to and fro
}

}  // namespace crosstie::edge::detail
