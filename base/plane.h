#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace crosstie::base {

namespace detail {
void* allocate_plane(std::size_t bytes);  // std::bad_alloc
void free_plane(void* memory, std::size_t bytes) noexcept;
}  // namespace detail

/// Memory for a value of every pixel. Values that are given no start value have none (no zeros, which someone else overwrites), and large
/// planes (of 4 MiB and more) lie in huge pages where the system has them. Up to 96 MiB of large planes that were let go are kept for the
/// next ones of their size; the system may take them back when it is short of memory.
template <typename Value>
class PlaneAllocator {
 public:
  using value_type = Value;

  PlaneAllocator() noexcept = default;
  template <typename Other>
  PlaneAllocator(const PlaneAllocator<Other>&) noexcept {}  // NOLINT(google-explicit-constructor): as std::allocator

  [[nodiscard]] Value* allocate(std::size_t count) {
    if (count > static_cast<std::size_t>(-1) / sizeof(Value)) throw std::bad_array_new_length();
    return static_cast<Value*>(detail::allocate_plane(count * sizeof(Value)));
  }
  void deallocate(Value* memory, std::size_t count) noexcept { detail::free_plane(memory, count * sizeof(Value)); }

  template <typename Other>
  void construct(Other* place) noexcept {
    ::new (static_cast<void*>(place)) Other;
  }

  friend bool operator==(const PlaneAllocator&, const PlaneAllocator&) noexcept { return true; }
};

/// A value of every pixel, row by row. `resize` leaves new ones undetermined.
template <typename Value>
using Plane = std::vector<Value, PlaneAllocator<Value>>;

}  // namespace crosstie::base
