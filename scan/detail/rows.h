#pragma once

#include <cstddef>
#include <functional>
#include <string_view>

#include "base/progress.h"
#include "base/result.h"

namespace crosstie::scan::detail {

/// Rows of an image that one call works on. Sums are carried within a band and added up band by band, so that their rounding does not
/// depend on the number of threads.
inline constexpr int kRowsPerBand = 32;

[[nodiscard]] constexpr std::size_t band_count(int height) {
  return static_cast<std::size_t>((height + kRowsPerBand - 1) / kRowsPerBand);
}
[[nodiscard]] constexpr std::size_t band_of(int row) { return static_cast<std::size_t>(row / kRowsPerBand); }

using RowWork = std::function<void(int first, int last)>;

/// Runs `work(first, last)` for every band of rows [first, last) on `threads` threads (0: as many as the machine has). Each call writes to
/// its own rows, or to its band's slot. An error is only that of cancelling.
base::Result<> over_rows(int height, int threads, std::string_view stage, const base::Progress& progress, const RowWork& work);

/// The same of work that is short and not cancelled. std::runtime_error where an exception left `work`.
void over_rows(int height, int threads, const RowWork& work);

}  // namespace crosstie::scan::detail
