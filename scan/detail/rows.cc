#include "scan/detail/rows.h"

#include <algorithm>
#include <stdexcept>

#include "base/parallel.h"

namespace crosstie::scan::detail {

base::Result<> over_rows(int height, int threads, std::string_view stage, const base::Progress& progress, const RowWork& work) {
  return base::parallel_for(band_count(height), threads, stage, progress, [&](std::size_t band) -> base::Result<> {
    const int first = static_cast<int>(band) * kRowsPerBand;
    work(first, std::min(height, first + kRowsPerBand));
    return {};
  });
}

void over_rows(int height, int threads, const RowWork& work) {
  const auto done = over_rows(height, threads, "rows", {}, work);
  if (!done) throw std::runtime_error(done.error().message);
}

}  // namespace crosstie::scan::detail
