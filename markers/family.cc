#include "markers/family.h"

#include <algorithm>
#include <array>
#include <bit>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/text.h"
#include "markers/detail/apriltag_library.h"
#include "markers/detail/code_rules.h"

namespace crosstie::markers {
namespace {

enum class Rule { kStartSequence, kOppositePair, kWideCode };

/// What distinguishes the families; radii in radii of the dot.
struct FamilyDescription {
  std::string_view name;
  Rule rule;
  int bits;
  double ring_inner, ring_outer, disc_outer, border_outer;
};

constexpr std::string_view kAprilTagPrefix = "apriltag:";
constexpr std::uint32_t kRing10Start = 0b110;
constexpr int kRing10StartBits = 3;

constexpr std::array kFamilies = {
    FamilyDescription{"ring10", Rule::kStartSequence, 10, 1.8, 2.6, 3.2, 3.6},
    FamilyDescription{"aicon12", Rule::kOppositePair, 12, 2.0, 3.0, 3.9, 3.9},
    FamilyDescription{"aicon14", Rule::kOppositePair, 14, 2.0, 3.0, 3.9, 3.9},
    FamilyDescription{"aicon20", Rule::kOppositePair, 20, 2.5, 4.0, 4.9, 4.9},
    FamilyDescription{"agisoft12", Rule::kWideCode, 12, 2.25, 3.5, 4.2, 4.2},
    FamilyDescription{"agisoft14", Rule::kWideCode, 14, 2.25, 3.5, 4.2, 4.2},
    FamilyDescription{"agisoft16", Rule::kWideCode, 16, 2.25, 3.5, 4.2, 4.2},
    FamilyDescription{"agisoft20", Rule::kWideCode, 20, 2.25, 3.5, 4.2, 4.2},
};

std::vector<MarkerCode> codes_of(const FamilyDescription& family) {
  switch (family.rule) {
    case Rule::kStartSequence:
      return detail::start_sequence_codes(kRing10Start, kRing10StartBits, family.bits - kRing10StartBits);
    case Rule::kOppositePair:
      return detail::opposite_pair_codes(family.bits);
    case Rule::kWideCode:
      return detail::wide_code_codes(family.bits);
  }
  return {};
}

}  // namespace

std::uint64_t smallest_rotation(std::uint64_t ring, int bits) {
  const std::uint64_t all = (std::uint64_t{1} << bits) - 1U;
  std::uint64_t smallest = ring;
  for (int by = 1; by < bits; ++by) {
    ring = ((ring << 1) | (ring >> (bits - 1))) & all;
    smallest = std::min(smallest, ring);
  }
  return smallest;
}

std::uint64_t mirrored_ring(std::uint64_t ring, int bits) {
  std::uint64_t mirrored = 0;
  for (int bit = 0; bit < bits; ++bit) mirrored = (mirrored << 1) | ((ring >> bit) & 1U);
  return mirrored;
}

std::optional<int> MarkerFamily::id_of_ring(std::uint64_t ring) const {
  const std::uint64_t smallest = smallest_rotation(ring, bits);
  const auto found = std::lower_bound(by_rotation.begin(), by_rotation.end(), smallest,
                                      [](const MarkerCode& code, std::uint64_t value) { return code.code < value; });
  if (found == by_rotation.end() || found->code != smallest) return std::nullopt;
  return found->id;
}

std::optional<std::uint64_t> MarkerFamily::code_of(int id) const {
  const auto found =
      std::lower_bound(codes.begin(), codes.end(), id, [](const MarkerCode& code, int value) { return code.id < value; });
  if (found == codes.end() || found->id != id) return std::nullopt;
  return found->code;
}

std::vector<std::string> marker_family_names() {
  std::vector<std::string> names;
  for (const FamilyDescription& family : kFamilies) names.emplace_back(family.name);
  for (const std::string& name : detail::apriltag_names()) names.push_back(std::string(kAprilTagPrefix) + name);
  return names;
}

Result<MarkerFamily> marker_family(std::string_view name) {
  if (name.starts_with(kAprilTagPrefix)) {
    if (auto family = detail::apriltag_family(name.substr(kAprilTagPrefix.size()))) {
      family->name = name;
      return *std::move(family);
    }
  }
  const auto found =
      std::find_if(kFamilies.begin(), kFamilies.end(), [name](const FamilyDescription& family) { return family.name == name; });
  if (found == kFamilies.end()) {
    const std::vector<std::string> names = marker_family_names();
    const std::optional<std::string> meant = base::nearest_word(name, names);
    return base::fail(base::ErrorCode::kUsage,
                      fmt::format("no marker family \"{}\"{}; known: {}", name,
                                  meant ? fmt::format(" (did you mean \"{}\"?)", *meant) : "", fmt::join(names, ", ")));
  }
  MarkerFamily family;
  family.name = name;
  family.bits = found->bits;
  family.ring_inner = found->ring_inner;
  family.ring_outer = found->ring_outer;
  family.disc_outer = found->disc_outer;
  family.border_outer = found->border_outer;
  if (found->rule == Rule::kStartSequence) {
    family.start_sequence = kRing10Start;
    family.start_bits = kRing10StartBits;
  }
  family.codes = codes_of(*found);
  family.by_rotation = family.codes;
  for (MarkerCode& code : family.by_rotation) code.code = smallest_rotation(code.code, family.bits);
  std::sort(family.by_rotation.begin(), family.by_rotation.end(),
            [](const MarkerCode& a, const MarkerCode& b) { return a.code < b.code; });
  return family;
}

}  // namespace crosstie::markers
