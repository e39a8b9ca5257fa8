#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "base/result.h"

namespace crosstie::base::detail {

/// An open file descriptor.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(Descriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  Descriptor& operator=(Descriptor&&) = delete;
  ~Descriptor();

  [[nodiscard]] int get() const { return fd_; }
  /// close() with its error; the descriptor is gone afterwards in any case.
  int close();

 private:
  int fd_;
};

/// "cannot <doing> <path>: <strerror(number)>", kFileSystem.
tl::unexpected<Error> system_failure(std::string_view doing, const std::filesystem::path& path, int number);

/// Opens a regular file for reading without ever waiting for it (a FIFO would).
Result<Descriptor> open_regular(const std::filesystem::path& path);

/// read() that repeats after signals; -1 with errno on failure.
long read_some(int fd, char* buffer, std::size_t size);

}  // namespace crosstie::base::detail
