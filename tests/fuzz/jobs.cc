// job.toml.
#include "app/job.h"
#include "tests/fuzz/input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace crosstie;
  const auto job = app::read_job(fuzz::file("job.toml", fuzz::text_of(data, size)));
  if (!fuzz::sensible(job)) return 0;
  static_cast<void>(job->board_cameras());
  const auto words = app::format_id_ranges(job->ids);
  const auto again = app::parse_id_ranges(words);
  fuzz::expect(again && again->ranges == job->ids.ranges, "ranges of ids are written as they are read");
  return 0;
}
