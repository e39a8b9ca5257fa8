#include "devices/frame_check.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>

namespace crosstie::devices {
namespace {

using base::ErrorCode;

constexpr std::int64_t kMaxLate = 64;  // frames by which one may come late

/// From the id of the frame before, across the wrap.
std::int64_t step_of(std::uint64_t before, std::uint64_t id, int id_bits) {
  auto step = static_cast<std::int64_t>(id - before);
  if (id_bits == 64) return step;
  const std::int64_t range = (std::int64_t{1} << id_bits) - 1;  // 0 is left out
  step %= range;
  if (step > range / 2) step -= range;
  if (step < -range / 2) step += range;
  return step;
}

/// Ids that go on where the camera's start over, from 0.
std::vector<std::int64_t> continued_ids(std::span<const FrameHeader> headers, int id_bits,
                                        std::vector<FrameFinding>& findings) {
  std::vector<std::int64_t> ids;
  ids.reserve(headers.size());
  for (std::size_t i = 0; i < headers.size(); ++i) {
    if (i == 0) {
      ids.push_back(0);
      continue;
    }
    std::int64_t step = step_of(headers[i - 1].id, headers[i].id, id_bits);
    if (step < -kMaxLate && headers[i].device_time > headers[i - 1].device_time) {
      findings.push_back({FrameFault::kRestarted, i});
      step = 1;
    }
    ids.push_back(ids.back() + step);
  }
  return ids;
}

/// Repeated and late frames, in the order of arrival.
void find_disorder(const std::vector<std::int64_t>& ids, std::vector<FrameFinding>& findings) {
  std::set<std::int64_t> seen;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    if (!seen.empty() && ids[i] < *seen.rbegin()) {
      findings.push_back({seen.contains(ids[i]) ? FrameFault::kRepeated : FrameFault::kSwapped, i});
    } else if (seen.contains(ids[i])) {
      findings.push_back({FrameFault::kRepeated, i});
    }
    seen.insert(ids[i]);
  }
}

/// Two frames whose ids follow each other among those that arrived.
struct Step {
  std::size_t index = 0;  ///< of the later one
  std::int64_t ids = 0;
  std::optional<double> passed_s;  ///< nothing where a device time is missing
};

std::vector<Step> steps_of(std::span<const FrameHeader> headers, const std::vector<std::int64_t>& ids) {
  std::vector<std::size_t> order(ids.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return ids[a] < ids[b]; });
  std::vector<Step> steps;
  for (std::size_t k = 1; k < order.size(); ++k) {
    const std::size_t before = order[k - 1], i = order[k];
    if (ids[i] == ids[before]) continue;  // repeated
    Step step{i, ids[i] - ids[before], {}};
    if (headers[i].device_time.count() != 0 && headers[before].device_time.count() != 0) {
      step.passed_s = std::chrono::duration<double>(headers[i].device_time - headers[before].device_time).count();
    }
    steps.push_back(step);
  }
  return steps;
}

bool goes_back(const Step& step) { return step.passed_s && *step.passed_s <= 0.0; }

/// Gaps of ids, and times that contradict them.
void find_gaps(const std::vector<Step>& steps, double period_s, std::vector<FrameFinding>& findings) {
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const Step& step = steps[k];
    if (step.ids > 1) findings.push_back({FrameFault::kLost, step.index, static_cast<std::uint64_t>(step.ids - 1)});
    if (goes_back(step)) findings.push_back({FrameFault::kSwapped, step.index});
    if (!step.passed_s || period_s == 0.0) continue;
    // Exchanged times make their neighbours' steps too long.
    if ((k > 0 && goes_back(steps[k - 1])) || (k + 1 < steps.size() && goes_back(steps[k + 1]))) continue;
    const double missed = std::round(*step.passed_s / period_s) - static_cast<double>(step.ids);
    if (missed >= 1.0) findings.push_back({FrameFault::kMissed, step.index, static_cast<std::uint64_t>(missed)});
  }
}

}  // namespace

std::string_view frame_fault_name(FrameFault fault) {
  switch (fault) {
    case FrameFault::kLost:
      return "lost";
    case FrameFault::kRepeated:
      return "repeated";
    case FrameFault::kSwapped:
      return "swapped";
    case FrameFault::kRestarted:
      return "restarted";
    case FrameFault::kMissed:
      return "missed";
  }
  return "";
}

base::Result<> FrameCheckOptions::validate() const {
  if (id_bits != 64 && (id_bits < 8 || id_bits > 32)) {
    return base::fail(ErrorCode::kUsage, fmt::format("frames: ids of {} bits; cameras count in 8 to 32 or in 64", id_bits));
  }
  if (!std::isfinite(period_s) || period_s < 0.0) {
    return base::fail(ErrorCode::kUsage, fmt::format("frames: a period of {} s", period_s));
  }
  return {};
}

base::Result<std::vector<FrameFinding>> check_frames(std::span<const FrameHeader> headers, const FrameCheckOptions& options) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  std::vector<FrameFinding> findings;
  const std::vector<std::int64_t> ids = continued_ids(headers, options.id_bits, findings);
  find_disorder(ids, findings);
  find_gaps(steps_of(headers, ids), options.period_s, findings);
  std::stable_sort(findings.begin(), findings.end(),
                   [](const FrameFinding& a, const FrameFinding& b) { return a.index < b.index; });
  return findings;
}

}  // namespace crosstie::devices
