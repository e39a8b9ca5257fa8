// Manifests of captured patterns. What is read can be written and is then the same sequence.
#include <cstdio>

#include "base/pattern_sequence.h"
#include "tests/fuzz/input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace crosstie;
  const auto sequence = base::read_pattern_manifest(fuzz::file("patterns.json", fuzz::text_of(data, size)));
  if (!fuzz::sensible(sequence)) return 0;
  fuzz::expect(sequence->validate().has_value(), "a manifest that is read is valid");
  const auto path = fuzz::folder() / "again.json";
  fuzz::expect(base::write_pattern_manifest(path, *sequence).has_value(), "a manifest that was read can be written");
  const auto again = base::read_pattern_manifest(path);
  if (!again) std::fprintf(stderr, "%s\n", again.error().message.c_str());
  fuzz::expect(again && again->patterns.size() == sequence->patterns.size(), "a manifest that was written is read as the same");
  for (int i = 0; i < static_cast<int>(sequence->patterns.size()); ++i) static_cast<void>(sequence->first_of(i));
  return 0;
}
