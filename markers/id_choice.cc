#include "markers/id_choice.h"

#include <algorithm>
#include <bit>
#include <iterator>

#include <fmt/format.h>

namespace crosstie::markers {
namespace {

using base::ErrorCode;
using base::Result;

struct Candidate {
  MarkerCode code;
  int distance = 0;  ///< to the nearest chosen code
  bool chosen = false;
};

Result<std::vector<Candidate>> candidates_of(const MarkerFamily& family, std::span<const int> pool) {
  std::vector<int> ids(pool.begin(), pool.end());
  std::sort(ids.begin(), ids.end());
  if (const auto twice = std::adjacent_find(ids.begin(), ids.end()); twice != ids.end()) {
    return base::fail(ErrorCode::kUsage, fmt::format("id {} is given twice", *twice));
  }
  std::vector<Candidate> candidates;
  for (const int id : ids) {
    const auto code = family.code_of(id);
    if (!code) return base::fail(ErrorCode::kUsage, fmt::format("{} has no id {}", family.name, id));
    candidates.push_back({{id, *code}, family.bits + 1, false});
  }
  return candidates;
}

int parity(const Candidate& c) { return std::popcount(c.code.code) % 2; }

/// What any two different codes are apart at least: 2 where all have an even, or all an odd number of segments set; for tags
/// more, but how much is not asked here.
int least_distance(const MarkerFamily& family, const std::vector<Candidate>& candidates) {
  if (family.tag) return 0;
  const bool same = std::all_of(candidates.begin(), candidates.end(),
                                [&](const Candidate& c) { return parity(c) == parity(candidates.front()); });
  return same ? 2 : 1;
}

/// The greedy choice of `count` of the candidates, which are that many at least.
IdChoice greedy_choice(const MarkerFamily& family, std::vector<Candidate> candidates, int count) {
  const int least = least_distance(family, candidates);
  IdChoice choice;
  choice.smallest_distance = count > 1 ? family.bits : 0;
  bool all_are_near = false;
  while (choice.ids.size() < static_cast<std::size_t>(count)) {
    // Once every candidate is as near as codes can be, the order no longer matters.
    const auto next = all_are_near ? std::find_if(candidates.begin(), candidates.end(), [](const auto& c) { return !c.chosen; })
                                   : std::max_element(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
                                       return (a.chosen ? -1 : a.distance) < (b.chosen ? -1 : b.distance);
                                     });
    next->chosen = true;
    if (!choice.ids.empty()) choice.smallest_distance = std::min(choice.smallest_distance, next->distance);
    choice.ids.push_back(next->code.id);
    if (all_are_near || next->distance <= least) {
      all_are_near = true;
      continue;
    }
    for (Candidate& c : candidates) {
      if (!c.chosen) c.distance = std::min(c.distance, code_distance(family, next->code.code, c.code.code));
    }
  }
  std::sort(choice.ids.begin(), choice.ids.end());
  return choice;
}

}  // namespace

int cyclic_distance(std::uint64_t ring_a, std::uint64_t ring_b, int bits) {
  const std::uint64_t all = (std::uint64_t{1} << bits) - 1U;
  int smallest = bits;
  for (int turn = 0; turn < bits; ++turn) {
    smallest = std::min(smallest, std::popcount(ring_a ^ ring_b));
    ring_b = ((ring_b << 1) | (ring_b >> (bits - 1))) & all;
  }
  return smallest;
}

int code_distance(const MarkerFamily& family, std::uint64_t code_a, std::uint64_t code_b) {
  if (!family.tag) return cyclic_distance(code_a, code_b, family.bits);
  int smallest = family.bits;
  for (int quarter = 0; quarter < 4; ++quarter) {
    smallest = std::min(smallest, std::popcount(code_a ^ code_b));
    code_b = quarter_turned(*family.tag, code_b, family.bits);
  }
  return smallest;
}

Result<IdChoice> choose_distant_ids(const MarkerFamily& family, std::span<const int> pool, int count) {
  if (count < 1 || static_cast<std::size_t>(count) > pool.size()) {
    return base::fail(ErrorCode::kUsage, fmt::format("{} ids are wanted of the {} that there are", count, pool.size()));
  }
  const auto candidates = candidates_of(family, pool);
  if (!candidates) return tl::unexpected<base::Error>(candidates.error());
  IdChoice best = greedy_choice(family, *candidates, count);
  // Codes of one parity are at least 2 apart, which the greedy way through a mixed family may miss.
  for (const int wanted : {0, 1}) {
    std::vector<Candidate> half;
    std::copy_if(candidates->begin(), candidates->end(), std::back_inserter(half),
                 [&](const Candidate& c) { return parity(c) == wanted; });
    if (half.size() < static_cast<std::size_t>(count) || half.size() == candidates->size()) continue;
    IdChoice choice = greedy_choice(family, std::move(half), count);
    if (choice.smallest_distance > best.smallest_distance) best = std::move(choice);
  }
  return best;
}

}  // namespace crosstie::markers
