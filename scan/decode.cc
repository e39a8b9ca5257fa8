#include "scan/decode.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "scan/detail/blur_shift.h"
#include "scan/detail/fringe_kernel.h"
#include "scan/detail/fringe_set.h"
#include "scan/detail/gray_code.h"
#include "scan/detail/guard.h"
#include "scan/detail/noise.h"
#include "scan/detail/phase_quality.h"
#include "scan/detail/ripple.h"
#include "scan/detail/rows.h"
#include "scan/detail/stillness.h"
#include "scan/detail/unwrap.h"

namespace crosstie::scan {
namespace {

using base::ErrorCode;
using base::fail;
using base::Image;
using base::Pattern;
using base::PatternKind;
using base::PatternSequence;
using base::PhaseMap;
using base::PhasePlane;
using base::PhaseStatus;
using base::ProjectorAxis;
using base::Result;
using detail::FringeSet;

constexpr std::int64_t kLeastChanges = 100;  // of the Gray code, to tell whether it belongs to the fringes
constexpr std::int64_t kLeastPixels = 100;   // with modulation, for there to be anything to decode

/// Images of one axis, set and exposure.
using SetKey = std::tuple<ProjectorAxis, int, double>;

/// The largest significant shift of an image of a set [turns], 0: none.
double larger_drift(const detail::ImageDrift::Estimate& drift, double* sigma = nullptr) {
  constexpr double kSignificant = 5.0;  // sigmas
  double largest = 0.0;
  for (Eigen::Index n = 0; n < drift.turns.size(); ++n) {
    const double size = std::abs(drift.turns(n));
    if (size <= largest || size < kSignificant * drift.sigma_turns(n)) continue;
    largest = size;
    if (sigma != nullptr) *sigma = drift.sigma_turns(n);
  }
  return largest;
}

SetKey key_of(const Pattern& pattern) { return {pattern.axis, pattern.frequency, pattern.exposure}; }

}  // namespace

Result<> DecodeOptions::validate() const {
  const auto bad = [](const std::string& what) { return fail(ErrorCode::kUsage, "decoding options: " + what); };
  if (!(max_phase_sigma_rad > 0.0 && max_phase_sigma_rad < 1.0))
    return bad(fmt::format("max_phase_sigma_rad is {}, not in (0, 1)", max_phase_sigma_rad));
  if (!(min_modulation >= 0.0)) return bad(fmt::format("min_modulation is {}, it must be 0 or more", min_modulation));
  if (noise && !(noise->read >= 0.0 && noise->shot >= 0.0 && noise->read + noise->shot > 0.0 &&
                 std::isfinite(noise->read + noise->shot)))
    return bad("the noise must be positive");
  if (!(max_residual_ratio >= 0.0))
    return bad(fmt::format("max_residual_ratio is {}, it must be 0 or more", max_residual_ratio));
  if (!(max_movement_px >= 0.0)) return bad(fmt::format("max_movement_px is {}, it must be 0 or more", max_movement_px));
  if (!(max_light_change >= 0.0)) return bad(fmt::format("max_light_change is {}, it must be 0 or more", max_light_change));
  if (!(min_word_agreement >= 0.0 && min_word_agreement <= 1.0))
    return bad(fmt::format("min_word_agreement is {}, not in 0..1", min_word_agreement));
  return {};
}

struct Decoder::Parts {
  PatternSequence sequence;
  int width = 0;
  int height = 0;
  DecodeOptions options;
  int bits = 0;
  std::vector<char> given;  ///< of each pattern
  std::map<int, Image> waiting;
  std::map<SetKey, FringeSet> sets;
  detail::ResidualStatistics statistics;
  std::map<ProjectorAxis, detail::GrayWords> words;
  std::map<int, int> last_of;         ///< by the first image of a pattern that is shown more than once: its last one
  std::map<int, Image> first_images;  ///< of these
  std::map<int, Image> last_images;   ///< by the first one's index
  base::Plane<float> light;           ///< mean level of the first set's shortest exposure

  [[nodiscard]] std::size_t pixels() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
  Result<> solve_if_complete(const Pattern& pattern);
  Result<> read_gray_if_complete(ProjectorAxis axis);
  /// The set of a frequency with all its exposures in one.
  [[nodiscard]] FringeSet fused(ProjectorAxis axis, int frequency, const base::GreyNoise& noise);
  Result<PhasePlane> plane(ProjectorAxis axis, const base::GreyNoise& noise, double waveform, PhaseMap& map,
                           const base::Progress& progress);
};

Result<> Decoder::Parts::solve_if_complete(const Pattern& pattern) {
  std::vector<int> members;
  for (const int i : sequence.fringe_images(pattern.axis, pattern.frequency)) {
    if (sequence.patterns[static_cast<std::size_t>(i)].exposure != pattern.exposure) continue;
    if (!waiting.contains(i)) return {};
    members.push_back(i);
  }
  std::vector<Image> images;
  std::vector<double> shifts;
  for (const int i : members) {
    images.push_back(std::move(waiting.extract(i).mapped()));
    shifts.push_back(sequence.patterns[static_cast<std::size_t>(i)].shift);
  }
  auto set = detail::solve_set(images, shifts, pattern.exposure, {options.noise, options.threads}, statistics, {});
  if (!set) return fail(std::move(set));
  sets.emplace(key_of(pattern), std::move(*set));
  return {};
}

Result<> Decoder::Parts::read_gray_if_complete(ProjectorAxis axis) {
  const base::AxisCode& code = sequence.code(axis);
  if (code.gray_bits == 0 || words.contains(axis)) return {};
  const auto fringes = std::find_if(sets.begin(), sets.end(), [&](const auto& entry) {
    return std::get<0>(entry.first) == axis && std::get<1>(entry.first) == code.finest();
  });
  if (fringes == sets.end()) return {};
  std::vector<int> members;
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    const Pattern& pattern = sequence.patterns[i];
    if (pattern.axis != axis || (pattern.kind != PatternKind::kGray && pattern.kind != PatternKind::kGrayInverse)) continue;
    if (!waiting.contains(static_cast<int>(i))) return {};
    members.push_back(static_cast<int>(i));
  }
  std::vector<detail::GrayImages> images(static_cast<std::size_t>(code.gray_bits));
  for (const int i : members) {
    const Pattern& pattern = sequence.patterns[static_cast<std::size_t>(i)];
    detail::GrayImages& bit = images[static_cast<std::size_t>(pattern.bit)];
    Image image = std::move(waiting.extract(i).mapped());
    if (pattern.kind == PatternKind::kGray) {
      bit.bright_where_set = std::move(image);
    } else {
      bit.inverse = std::move(image);
    }
  }
  auto read = detail::read_gray_code(images, fringes->second, options.threads, {});
  if (!read) return fail(std::move(read));
  words.emplace(axis, std::move(*read));
  return {};
}

FringeSet Decoder::Parts::fused(ProjectorAxis axis, int frequency, const base::GreyNoise& noise) {
  std::vector<FringeSet> exposures;
  for (auto it = sets.begin(); it != sets.end();) {
    if (std::get<0>(it->first) == axis && std::get<1>(it->first) == frequency) {
      exposures.push_back(std::move(it->second));
      it = sets.erase(it);
    } else {
      ++it;
    }
  }
  std::sort(exposures.begin(), exposures.end(), [](const auto& a, const auto& b) { return a.exposure < b.exposure; });
  if (light.empty() && exposures.size() > 1) light = exposures.front().mean;  // of one exposure: see plane()
  FringeSet result = std::move(exposures.front());
  if (exposures.size() == 1) return result;
  for (const FringeSet& set : exposures) {
    if (set.drift.turns.size() > 0 && larger_drift(set.drift) > larger_drift(result.drift)) result.drift = set.drift;
  }
  // The light's complex amplitude from each exposure with the weight of its variance; levels as of the last, longest one.
  if (result.gains.empty()) result.gains.assign(pixels(), static_cast<float>(result.gain));
  for (std::size_t i = 0; i < pixels(); ++i) {
    double a = 0.0, b = 0.0, weights = 0.0, longest = 0.0;
    double mean = result.mean[i];
    double square = result.squares[i];
    for (std::size_t e = 0; e < exposures.size(); ++e) {
      const FringeSet& set = e == 0 ? result : exposures[e];
      if (set.modulation[i] <= 0.0F) continue;
      const double weight = set.exposure * set.exposure / (set.gain_at(i) * noise.variance(set.mean[i]));
      const double angle = 2.0 * std::numbers::pi * set.turns[i];
      a += weight * set.modulation[i] * std::cos(angle) / set.exposure;
      b += weight * set.modulation[i] * std::sin(angle) / set.exposure;
      weights += weight;
      if (set.exposure < longest) continue;
      longest = set.exposure;
      mean = set.mean[i];
      square = set.squares[i];
    }
    if (weights == 0.0) continue;
    const double turns = std::atan2(b, a) / (2.0 * std::numbers::pi);
    result.turns[i] = static_cast<float>(turns < 0.0 ? std::min(turns + 1.0, 1.0 - 1e-7) : turns);
    result.modulation[i] = static_cast<float>(longest * std::hypot(a, b) / weights);
    result.mean[i] = static_cast<float>(mean);
    result.squares[i] = static_cast<float>(square);
    result.gains[i] = static_cast<float>(longest * longest / (weights * noise.variance(mean)));
  }
  return result;
}

Result<PhasePlane> Decoder::Parts::plane(ProjectorAxis axis, const base::GreyNoise& noise, double waveform, PhaseMap& map,
                                         const base::Progress& progress) {
  const base::AxisCode& code = sequence.code(axis);
  const auto finest = static_cast<std::size_t>(code.finest());
  PhasePlane plane;
  plane.axis = axis;
  plane.fringes = code.fringes[finest];

  std::vector<FringeSet> all;
  for (std::size_t f = 0; f < code.fringes.size(); ++f) all.push_back(fused(axis, static_cast<int>(f), noise));
  std::vector<base::Plane<float>> sigmas;
  double squares = 0.0;
  std::int64_t tested = 0, disturbed = 0;
  std::int64_t lit = 0;
  for (FringeSet& set : all) {
    auto quality = detail::judge_phases(set, noise, waveform, options, width, height, map.status);
    squares += quality.squares;
    tested += quality.tested;
    disturbed += quality.disturbed;
    lit = quality.valid;
    sigmas.push_back(std::move(quality.sigma_turns));
  }
  if (tested > 0) {
    map.residual_ratio = std::max(map.residual_ratio, std::sqrt(squares / static_cast<double>(tested)));
    map.disturbed_fraction = std::max(map.disturbed_fraction, static_cast<double>(disturbed) / static_cast<double>(tested));
  }
  // The first set's mean is the scene's light; it is needed no more.
  if (light.empty()) light = std::move(all.front().mean);
  if (lit < kLeastPixels) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("fringes of the axis {} show in {} pixels only: were these images taken with this projector on? is the "
                    "order of the images that of the manifest?",
                    base::axis_name(axis), lit));
  }
  if (options.correct_ripple) {
    for (std::size_t f = 0; f < all.size(); ++f) {
      const double amplitude = detail::correct_ripple(map.status, width, height, all[f], options.threads);
      if (f == finest) plane.ripple_turns = amplitude;
    }
  }

  plane.sigma_turns = code.gray_bits == 0 && all.size() > 1 ? sigmas[finest] : std::move(sigmas[finest]);
  if (code.gray_bits > 0) {
    detail::GrayWords& code_words = words.at(axis);
    const auto found =
        detail::find_word_offset(code_words, all[finest], map.status, width, height, code.word_periods, options.threads);
    plane.word_offset = code.word_offset.value_or(found.offset);
    plane.word_agreement = found.agreement;
    const std::string why = found.changes < kLeastChanges ? "it hardly changes"
                            : found.misplaced_bit >= 0
                                ? fmt::format("bit {} is not where the phases go on", code.gray_bits - 1 - found.misplaced_bit)
                            : found.backwards                              ? "phases fall where its words grow"
                            : found.agreement < options.min_word_agreement ? "its words change at all phases"
                                                                           : "";
    if (!why.empty()) {
      return fail(
          ErrorCode::kBadInput,
          fmt::format("the Gray code of the axis {} does not agree with the fringes: {} ({} changes of the code, agreement "
                      "{:.2f}, {:.2f} is asked for); the images are in another order than the manifest says, or of another "
                      "sequence",
                      base::axis_name(axis), why, found.changes, found.agreement, options.min_word_agreement));
    }
    auto done = detail::unwrap_by_gray_code(code_words, all[finest], code.word_periods, *plane.word_offset, width, height,
                                            options.threads, plane, map.status, progress);
    if (!done) return fail(std::move(done));
  } else if (all.size() > 1) {
    std::vector<const FringeSet*> sets_of_axis;
    for (const FringeSet& set : all) sets_of_axis.push_back(&set);
    auto done = detail::unwrap_by_sets(sets_of_axis, sigmas, code, width, height, options.threads, plane, map.status, progress);
    if (!done) return fail(std::move(done));
  } else {
    plane.turns = std::move(all[finest].turns);
  }
  const double slope = detail::median_slope(plane, width, height);  // finest turns per px
  for (std::size_t f = 0; f < all.size() && slope > 0.0; ++f) {
    if (all[f].drift.turns.size() == 0) continue;
    map.stillness.drift_told = true;
    double sigma = 0.0;
    const double px_per_turn = plane.fringes / code.fringes[f] / slope;
    const double drift = larger_drift(all[f].drift, &sigma) * px_per_turn;
    if (drift <= map.stillness.drift_px) continue;
    map.stillness.drift_px = drift;
    map.stillness.drift_sigma_px = sigma * px_per_turn;
  }
  plane.modulation = std::move(all[finest].modulation);
  return plane;
}

Decoder::Decoder(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
Decoder::Decoder(Decoder&&) noexcept = default;
Decoder& Decoder::operator=(Decoder&&) noexcept = default;
Decoder::~Decoder() = default;

Result<Decoder> Decoder::make(const PatternSequence& sequence, int width, int height, const DecodeOptions& options) {
  if (auto ok = options.validate(); !ok) return fail(std::move(ok));
  if (auto ok = sequence.validate(); !ok) return fail(std::move(ok));
  if (width < 2 || height < 2 || static_cast<std::int64_t>(width) * height > base::kMaxImagePixels) {
    return fail(ErrorCode::kBadInput, fmt::format("images of {} x {} px cannot be decoded", width, height));
  }
  for (const base::AxisCode* code : {&sequence.x, &sequence.y}) {
    for (std::size_t f = 0; f < code->fringes.size(); ++f) {
      const auto axis = code == &sequence.x ? ProjectorAxis::kX : ProjectorAxis::kY;
      if (sequence.fringe_images(axis, static_cast<int>(f)).size() > static_cast<std::size_t>(detail::kMaxSteps)) {
        return fail(ErrorCode::kBadInput, fmt::format("more than {} images in a set of fringes", detail::kMaxSteps));
      }
    }
  }
  auto parts = std::make_unique<Parts>();
  parts->sequence = sequence;
  parts->width = width;
  parts->height = height;
  parts->options = options;
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    if (const auto first = sequence.first_of(static_cast<int>(i))) parts->last_of[*first] = static_cast<int>(i);
  }
  parts->given.assign(sequence.patterns.size(), 0);
  return Decoder(std::move(parts));
}

Result<> Decoder::add(int index, Image image) {
  Parts& parts = *parts_;
  const auto at = static_cast<std::size_t>(index);
  if (index < 0 || at >= parts.given.size() || parts.given[at]) {
    return fail(ErrorCode::kUsage, fmt::format("image {} of the sequence is not asked for", index));
  }
  if (image.width() != parts.width || image.height() != parts.height) {
    return fail(ErrorCode::kBadInput, fmt::format("image {} of the sequence has {} x {} px, the first one {} x {}", index + 1,
                                                  image.width(), image.height(), parts.width, parts.height));
  }
  if (parts.bits == 0) parts.bits = image.bits();
  if (image.bits() != parts.bits) {
    return fail(ErrorCode::kBadInput,
                fmt::format("image {} of the sequence has {} bits, the first one {}", index + 1, image.bits(), parts.bits));
  }
  parts.given[at] = 1;
  const Pattern& pattern = parts.sequence.patterns[at];
  // Of the images of one pattern the first and the last are compared.
  const auto first = parts.sequence.first_of(index);
  const bool is_last = first && parts.last_of[*first] == index;
  const bool compared = is_last || parts.last_of.contains(index);
  std::map<int, Image>& others = is_last ? parts.last_images : parts.first_images;
  const int other = is_last ? *first : index;
  if (pattern.repeat || pattern.kind == PatternKind::kWhite || pattern.kind == PatternKind::kBlack) {
    if (compared) others.emplace(other, std::move(image));
    return {};
  }
  if (compared) others.emplace(other, image);
  parts.waiting.emplace(index, std::move(image));
  if (pattern.kind == PatternKind::kFringe) {
    if (auto ok = parts.solve_if_complete(pattern); !ok) return ok;
  }
  return parts.read_gray_if_complete(pattern.axis);
}

Result<PhaseMap> Decoder::finish(const base::Progress& progress) {
  Parts& parts = *parts_;
  for (std::size_t i = 0; i < parts.given.size(); ++i) {
    if (!parts.given[i]) return fail(ErrorCode::kBadInput, fmt::format("image {} of the sequence is missing", i + 1));
  }
  PhaseMap map;
  map.width = parts.width;
  map.height = parts.height;
  map.status.assign(parts.pixels(), PhaseStatus::kValid);
  map.noise_given = parts.options.noise.has_value();
  map.noise = parts.options.noise.value_or(parts.statistics.noise());
  if (map.noise.read == 0.0 && map.noise.shot == 0.0) {
    return fail(ErrorCode::kBadInput,
                "sets of three steps leave no residuals from which the camera's noise could be told, and none is given");
  }
  const double waveform = parts.statistics.size() > 0 ? parts.statistics.waveform_square() : 0.0;
  for (const ProjectorAxis axis : {ProjectorAxis::kX, ProjectorAxis::kY}) {
    if (!parts.sequence.code(axis).used()) continue;
    auto plane = parts.plane(axis, map.noise, waveform, map, progress);
    if (!plane) return fail(std::move(plane));
    (axis == ProjectorAxis::kX ? map.x : map.y) = std::move(*plane);
  }
  map.light = std::move(parts.light);
  std::vector<detail::Repeated> repeated;
  for (auto& [first, image] : parts.first_images) {
    repeated.push_back(
        {parts.sequence.patterns[static_cast<std::size_t>(first)], std::move(image), std::move(parts.last_images.at(first))});
  }
  const int threads = parts.options.threads;
  auto compared = detail::compare_repeated(repeated, map.noise, parts.options.max_movement_px, threads, map.stillness);
  if (!compared) return fail(std::move(compared));
  auto still = detail::judge_stillness(map.stillness, parts.options.max_movement_px, parts.options.max_light_change);
  if (!still) return fail(std::move(still));
  using Counts = decltype(map.counts);
  std::vector<Counts> counts(detail::band_count(map.height), Counts{});
  detail::over_rows(map.height, threads, [&](int first, int last) {
    Counts& count = counts[detail::band_of(first)];
    for (std::size_t i = map.at(0, first); i < map.at(0, last); ++i) {
      ++count[static_cast<std::size_t>(map.status[i])];
      if (map.status[i] == PhaseStatus::kValid) continue;
      for (auto* plane : {&map.x, &map.y}) {
        if (*plane) (*plane)->turns[i] = std::numeric_limits<float>::quiet_NaN();
      }
    }
  });
  for (const Counts& count : counts) {
    for (std::size_t status = 0; status < count.size(); ++status) map.counts[status] += count[status];
  }
  // Of an exposure series modulations are those of different exposures from pixel to pixel: their changes tell nothing.
  const bool one_exposure =
      std::all_of(parts.sequence.patterns.begin(), parts.sequence.patterns.end(),
                  [&](const Pattern& pattern) { return pattern.exposure == parts.sequence.patterns.front().exposure; });
  if (parts.options.correct_blur && one_exposure) (void)detail::correct_blur_shift(map, threads);
  return map;
}

}  // namespace crosstie::scan
