#pragma once

#include <cstddef>
#include <functional>
#include <string_view>

#include "base/progress.h"
#include "base/result.h"

namespace crosstie::base {

/// Runs `work(i)` for every i in [0, count) on `threads` threads (0: as many as the machine has).
///
/// Each call writes only to slot i of whatever it fills, so the outcome does not depend on the number of threads. When calls
/// fail, the error of the smallest failing i is returned, whatever the order in which they ran. Cancelling stops before the
/// next item. `progress` is reported from one thread at a time under the name `stage`.
/// An exception that leaves `work` becomes an Error of code kInternal.
Result<> parallel_for(std::size_t count, int threads, std::string_view stage, const Progress& progress,
                      const std::function<Result<>(std::size_t)>& work);

}  // namespace crosstie::base
