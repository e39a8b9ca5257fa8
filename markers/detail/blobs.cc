#include "markers/detail/blobs.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "markers/detail/level_kernels.h"

namespace crosstie::markers::detail {
namespace {

/// The runs of one row: run i has the pixels [edges[2 i], edges[2 i + 1]). The run after the last lies beyond all.
struct Runs {
  explicit Runs(int width) : edges(static_cast<std::size_t>(width) + 4), labels(edges.size() / 2) { close(); }

  /// Where a bit differs from the one before it, a run begins or ends.
  void find(const std::uint64_t* words, std::size_t word_count, int width) {
    int* to = edges.data();
    std::uint64_t last = 0;
    for (std::size_t w = 0; w < word_count; ++w) {
      const std::uint64_t word = words[w];
      std::uint64_t changes = word ^ ((word << 1) | last);
      last = word >> 63;
      const int base = static_cast<int>(64 * w);
      while (changes != 0) {
        *to++ = base + std::countr_zero(changes);
        changes &= changes - 1;
      }
    }
    if ((to - edges.data()) % 2 != 0) *to++ = width;
    count = static_cast<std::size_t>(to - edges.data()) / 2;
    close();
  }

  std::vector<int> edges;
  std::vector<std::uint32_t> labels;
  std::size_t count = 0;

 private:
  void close() { edges[2 * count] = edges[2 * count + 1] = std::numeric_limits<int>::max(); }
};

/// Sums of a run's pixels; x twice and xx twelve times.
Blob sums_of(int begin, int end, int y) {
  const std::int64_t n = end - begin;
  const std::int64_t middle2 = begin + end - 1;
  const std::int64_t x2 = n * middle2;
  return {n, x2, n * y, n * (3 * middle2 * middle2 + n * n - 1), x2 * y, n * y * y, begin, end - 1, y, y};
}

void add(const Blob& from, Blob& to) {
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
}

/// Blobs by label; those that were joined to another have no pixels.
class Blobs {
 public:
  explicit Blobs(std::size_t expected) {
    blobs_.reserve(expected);
    parents_.reserve(expected);
  }

  std::uint32_t begin(const Blob& run) {
    parents_.push_back(static_cast<std::uint32_t>(blobs_.size()));
    blobs_.push_back(run);
    return parents_.back();
  }

  std::uint32_t root(std::uint32_t label) {
    while (parents_[label] != label) {
      parents_[label] = parents_[parents_[label]];
      label = parents_[label];
    }
    return label;
  }

  void extend(std::uint32_t root, const Blob& run) { add(run, blobs_[root]); }

  /// Joins two roots; the older one stays.
  std::uint32_t join(std::uint32_t a, std::uint32_t b) {
    if (a == b) return a;
    if (a > b) std::swap(a, b);
    parents_[b] = a;
    add(blobs_[b], blobs_[a]);
    blobs_[b].count = 0;
    return a;
  }

  [[nodiscard]] std::vector<Blob> of_at_least(std::int64_t count) const {
    std::vector<Blob> kept;
    for (const Blob& blob : blobs_) {
      if (blob.count == 0 || blob.count < count) continue;
      kept.push_back(blob);
      kept.back().x /= 2;
      kept.back().xx /= 12;
      kept.back().xy /= 2;
    }
    return kept;
  }

 private:
  std::vector<Blob> blobs_;
  std::vector<std::uint32_t> parents_;
};

}  // namespace

std::vector<Blob> find_blobs(const std::uint64_t* words, int width, int height, std::int64_t min_count) {
  constexpr std::size_t kPixelsPerBlob = 256;  // on photographs, or more
  Blobs blobs(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) / kPixelsPerBlob + 64);
  const std::size_t word_count = words_per_row(width);
  Runs above(width), here(width);
  for (int y = 0; y < height; ++y, words += word_count) {
    here.find(words, word_count, width);
    const int* other = above.edges.data();  // the first that may touch this and later runs
    for (std::size_t i = 0; i < here.count; ++i) {
      const int begin = here.edges[2 * i];
      const int end = here.edges[2 * i + 1];
      while (other[1] <= begin) other += 2;
      const Blob run = sums_of(begin, end, y);
      if (other[0] >= end) {
        here.labels[i] = blobs.begin(run);
        continue;
      }
      std::size_t k = static_cast<std::size_t>(other - above.edges.data()) / 2;
      std::uint32_t label = blobs.root(above.labels[k]);
      while (above.edges[2 * ++k] < end) label = blobs.join(label, blobs.root(above.labels[k]));
      blobs.extend(label, run);
      here.labels[i] = label;
    }
    std::swap(above, here);
  }
  return blobs.of_at_least(min_count);
}

}  // namespace crosstie::markers::detail
