#include "markers/detail/blobs.h"

#include <algorithm>
#include <bit>

#include "markers/detail/level_kernels.h"

namespace crosstie::markers::detail {
namespace {

/// Pixels [begin, end) of a row.
struct Run {
  int begin, end;
  std::uint32_t label;
};

/// The runs of one row: where a bit differs from the one before it, a run begins or ends.
void find_runs(const std::uint64_t* words, std::size_t count, int width, std::vector<Run>& runs) {
  runs.clear();
  std::uint64_t last = 0;
  int begin = -1;
  for (std::size_t w = 0; w < count; ++w) {
    const std::uint64_t word = words[w];
    std::uint64_t changes = word ^ ((word << 1) | last);
    last = word >> 63;
    const int base = static_cast<int>(64 * w);
    while (changes != 0) {
      const int at = base + std::countr_zero(changes);
      changes &= changes - 1;
      if (begin < 0) {
        begin = at;
      } else {
        runs.push_back({begin, at, 0});
        begin = -1;
      }
    }
  }
  if (begin >= 0) runs.push_back({begin, width, 0});
}

/// Sums of 0 .. n - 1, and of their squares.
std::int64_t sum_to(std::int64_t n) { return n * (n - 1) / 2; }
std::int64_t squares_to(std::int64_t n) { return (n - 1) * n * (2 * n - 1) / 6; }

class Blobs {
 public:
  std::uint32_t add(const Run& run, int y) {
    parents_.push_back(static_cast<std::uint32_t>(blobs_.size()));
    blobs_.push_back({0, 0, 0, 0, 0, 0, run.begin, run.end - 1, y, y});
    return parents_.back();
  }

  std::uint32_t root(std::uint32_t label) {
    while (parents_[label] != label) {
      parents_[label] = parents_[parents_[label]];
      label = parents_[label];
    }
    return label;
  }

  void extend(std::uint32_t label, const Run& run, int y) {
    Blob& blob = blobs_[label];
    const std::int64_t n = run.end - run.begin;
    const std::int64_t x = sum_to(run.end) - sum_to(run.begin);
    blob.count += n;
    blob.x += x;
    blob.y += n * y;
    blob.xx += squares_to(run.end) - squares_to(run.begin);
    blob.xy += x * y;
    blob.yy += n * y * y;
    blob.left = std::min(blob.left, run.begin);
    blob.right = std::max(blob.right, run.end - 1);
    blob.bottom = y;
  }

  /// Joins two roots; the older one stays.
  std::uint32_t join(std::uint32_t a, std::uint32_t b) {
    if (a == b) return a;
    if (a > b) std::swap(a, b);
    parents_[b] = a;
    Blob& to = blobs_[a];
    Blob& from = blobs_[b];
    to.count += from.count;
    to.x += from.x;
    to.y += from.y;
    to.xx += from.xx;
    to.xy += from.xy;
    to.yy += from.yy;
    to.left = std::min(to.left, from.left);
    to.right = std::max(to.right, from.right);
    to.top = std::min(to.top, from.top);
    to.bottom = std::max(to.bottom, from.bottom);
    from.count = 0;
    return a;
  }

  [[nodiscard]] std::vector<Blob> of_at_least(std::int64_t count) const {
    std::vector<Blob> kept;
    std::copy_if(blobs_.begin(), blobs_.end(), std::back_inserter(kept),
                 [count](const Blob& blob) { return blob.count >= count; });
    return kept;
  }

 private:
  std::vector<Blob> blobs_;
  std::vector<std::uint32_t> parents_;
};

}  // namespace

std::vector<Blob> find_blobs(const std::uint64_t* words, int width, int height, std::int64_t min_count) {
  Blobs blobs;
  const std::size_t count = words_per_row(width);
  std::vector<Run> above, here;
  for (int y = 0; y < height; ++y, words += count) {
    find_runs(words, count, width, here);
    auto first = above.begin();  // of those that may touch this and later runs
    for (Run& run : here) {
      while (first != above.end() && first->end <= run.begin) ++first;
      bool joined = false;
      for (auto other = first; other != above.end() && other->begin < run.end; ++other) {
        const std::uint32_t root = blobs.root(other->label);
        run.label = joined ? blobs.join(blobs.root(run.label), root) : root;
        joined = true;
      }
      if (!joined) run.label = blobs.add(run, y);
      blobs.extend(run.label, run, y);
    }
    above.swap(here);
  }
  return blobs.of_at_least(min_count);
}

}  // namespace crosstie::markers::detail
