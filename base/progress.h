#pragma once

#include <cstddef>
#include <functional>
#include <stop_token>
#include <string_view>

#include "base/result.h"

namespace crosstie::base {

/// How a long operation talks to its caller: it reports, and asks whether to stop. Always the last argument, default `{}`.
struct Progress {
  /// Called as `report(stage, done, total)`; from one thread at a time, `done` never decreases within a stage.
  std::function<void(std::string_view stage, std::size_t done, std::size_t total)> report;
  std::stop_token stop;

  void operator()(std::string_view stage, std::size_t done, std::size_t total) const {
    if (report) report(stage, done, total);
  }
  [[nodiscard]] bool cancelled() const { return stop.stop_requested(); }
};

/// The error of an operation that its caller stopped.
[[nodiscard]] inline tl::unexpected<Error> cancelled(std::string_view what) {
  return fail(ErrorCode::kCancelled, std::string(what) + " was cancelled");
}

}  // namespace crosstie::base
