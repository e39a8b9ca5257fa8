#include "base/plane.h"

#include <sys/mman.h>

#include <algorithm>
#include <mutex>

namespace crosstie::base::detail {
namespace {

constexpr std::size_t kHugePage = std::size_t{2} << 20U;
constexpr std::size_t kLarge = 2 * kHugePage;
constexpr std::size_t kMostKept = std::size_t{96} << 20U;  // more would raise the peak of what follows

std::size_t whole_pages(std::size_t bytes) { return (bytes + kHugePage - 1) / kHugePage * kHugePage; }

#if defined(__SANITIZE_ADDRESS__)
constexpr bool kKeep = false;  // so that what is used after it was let go shows
#else
constexpr bool kKeep = true;
#endif

/// Large planes that were let go, for the next ones of that size: the system has to clear the memory that it gives, which takes longer than
/// to fill it. It may take them back when it is short of memory.
class KeptPlanes {
 public:
  /// Null where there is none.
  void* take(std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    const auto found = std::find_if(blocks_.rbegin(), blocks_.rend(), [&](const Block& block) { return block.bytes == bytes; });
    if (found == blocks_.rend()) return nullptr;
    void* memory = found->memory;
    blocks_.erase(std::next(found).base());
    kept_ -= bytes;
    return memory;
  }

  bool keep(void* memory, std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    if (kept_ + bytes > kMostKept) return false;
    (void)madvise(memory, bytes, MADV_FREE);
    blocks_.push_back({memory, bytes});
    kept_ += bytes;
    return true;
  }

 private:
  struct Block {
    void* memory;
    std::size_t bytes;
  };
  std::mutex mutex_;
  std::vector<Block> blocks_ = [] {
    std::vector<Block> blocks;
    blocks.reserve(kMostKept / kLarge + 1);  // letting go must not fail
    return blocks;
  }();
  std::size_t kept_ = 0;
};

KeptPlanes& kept_planes() {
  static auto* planes = new KeptPlanes;  // outlives all that is static
  return *planes;
}

}  // namespace

void* allocate_plane(std::size_t bytes) {
  if (bytes < kLarge) return ::operator new(bytes);
  const std::size_t size = whole_pages(bytes);
  if (void* kept = kept_planes().take(size)) return kept;
  void* memory = ::operator new (size, std::align_val_t{kHugePage});
  (void)madvise(memory, size, MADV_HUGEPAGE);  // where there are none, it stays as it is
  return memory;
}

void free_plane(void* memory, std::size_t bytes) noexcept {
  if (bytes < kLarge) {
    ::operator delete(memory);
    return;
  }
  const std::size_t size = whole_pages(bytes);
  if (kKeep && kept_planes().keep(memory, size)) return;
  ::operator delete (memory, std::align_val_t{kHugePage});
}

}  // namespace crosstie::base::detail
