// The calibration of a scan's head, tested by the scan.

#include "app/scan_head.h"

#include <algorithm>

#include "scan/head_test.h"

namespace crosstie::app {
namespace {

using base::HeadTest;
using base::PhaseMap;
using base::Result;

constexpr std::int64_t kFewestSamples = 6;
constexpr double kFewMatches = 0.05;  // of the pixels with a phase

Result<HeadTest> test_of(const base::Head& head, const PhaseMap& left, const PhaseMap& right, const scan::DepthMap& depths) {
  if (!depths.epipolar_px.empty()) return scan::test_head(head, scan::phase_samples(depths, head), "phases");
  const auto samples = scan::texture_samples(left, right, depths, head);
  if (!samples) return tl::unexpected(samples.error());
  HeadTest test = scan::test_head(head, *samples, "texture");
  return test.samples < kFewestSamples ? HeadTest{} : test;
}

bool hardly_matches(const scan::DepthMap& depths) {
  const auto tried = depths.points + depths.unmatched + depths.off_curve;
  return static_cast<double>(depths.points) < kFewMatches * static_cast<double>(tried);
}

/// Whether all is well with the cameras' images exchanged: the head test passes, or there is none and many more points match.
bool fits_exchanged(const ScanTask& task, const base::Head& head, const std::array<PhaseMap, 2>& maps, bool tested,
                    const base::Progress& progress) {
  const auto depths = scan::match(maps[1], maps[0], head, task.match, progress);
  if (!depths || hardly_matches(*depths)) return false;
  const auto test = test_of(head, maps[1], maps[0], *depths);
  return test && (test->done() ? scan::judge_head(*test, off_curve_limit_px(task, head)).has_value() : !tested);
}

}  // namespace

Result<HeadTest> tested_head(const ScanTask& task, const base::Head& head, const std::array<PhaseMap, 2>& maps,
                             const scan::DepthMap& depths, const base::Progress& progress) {
  auto test = test_of(head, maps[0], maps[1], depths);
  if (!test) return test;
  auto judged = scan::judge_head(*test, off_curve_limit_px(task, head));
  if (judged && !hardly_matches(depths)) return test;
  if (fits_exchanged(task, head, maps, test->done(), progress)) {
    return base::fail(base::ErrorCode::kBadInput,
                      "the images of the left and the right camera are exchanged: they fit the head the other way round");
  }
  if (!judged) return base::fail(std::move(judged));
  return test;
}

}  // namespace crosstie::app
