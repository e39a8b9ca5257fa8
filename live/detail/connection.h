#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>

#include "base/file_descriptor.h"

namespace crosstie::live::detail {

/// Largest head of a request (request line and header fields) and largest body, bytes.
inline constexpr std::size_t kMaxHeadBytes = std::size_t{16} << 10;
inline constexpr std::size_t kMaxBodyBytes = std::size_t{64} << 10;

/// An accepted TCP connection whose every wait has an end: `patience` for the head of a request, for its body, and for each 64 KiB that
/// are written. One thread uses it; abort() may be called from any other while it exists.
class Connection {
 public:
  /// `socket` must not block (SOCK_NONBLOCK).
  Connection(base::FileDescriptor socket, std::chrono::nanoseconds patience);

  enum class Head {
    kComplete,
    kNone,     ///< closed, or silent from the beginning, as the connections are that browsers open in advance
    kSlow,     ///< begun, but not complete in time
    kTooLong,  ///< over kMaxHeadBytes
  };
  /// Reads the head of a request up to and including its empty line; read() hands it out then.
  [[nodiscard]] Head read_head();
  [[nodiscard]] std::string_view head() const { return std::string_view(received_).substr(0, head_size_); }

  /// The next bytes, first those of the head; 0 at the end; -1 where time or the allowance for a body with its chunk headers is used up.
  [[nodiscard]] std::ptrdiff_t read(char* data, std::size_t size);
  /// Whether read() gave up because the body was too slow.
  [[nodiscard]] bool body_was_slow() const { return body_was_slow_; }

  /// All of it, or false: the client is gone or does not read.
  bool write(std::string_view bytes);
  /// Whether the client has closed its side, or the connection is broken.
  [[nodiscard]] bool closed_by_client() const;

  /// Ends an answered connection: tells the client that nothing follows and reads what it still sends for at most `linger`, since closing
  /// with unread bytes makes the answer vanish on its way.
  void end(std::chrono::nanoseconds linger);
  /// Ends all waiting: reads see the end and writes fail.
  void abort() const;

  /// Numeric; empty where unknown.
  [[nodiscard]] std::string local_address() const;

 private:
  /// Whether the socket is ready for poll()'s `events` before `end`.
  [[nodiscard]] bool wait(short events, std::chrono::steady_clock::time_point end) const;
  [[nodiscard]] std::ptrdiff_t receive(char* data, std::size_t size) const;

  base::FileDescriptor socket_;
  std::chrono::nanoseconds patience_;
  std::string received_;  ///< the head and what came with it
  std::size_t head_size_ = 0;
  std::size_t handed_out_ = 0;  ///< of received_
  std::size_t body_allowance_;  ///< bytes that may still be received
  std::chrono::steady_clock::time_point body_end_;
  bool body_was_slow_ = false;
  bool broken_ = false;
};

}  // namespace crosstie::live::detail
