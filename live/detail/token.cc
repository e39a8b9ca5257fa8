#include "live/detail/token.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <string>

#include <sys/random.h>

#include <fmt/format.h>

#include "base/file_descriptor.h"
#include "live/page_server.h"

namespace crosstie::live {

std::string make_token() {
  std::array<unsigned char, 16> bytes{};
  std::span<unsigned char> rest = bytes;
  while (!rest.empty()) {
    const ssize_t taken = ::getrandom(rest.data(), rest.size(), 0);
    if (taken < 0 && errno != EINTR) throw std::runtime_error("no random numbers: " + base::last_system_error());
    if (taken > 0) rest = rest.subspan(static_cast<std::size_t>(taken));
  }
  return fmt::format("{:02x}", fmt::join(bytes, ""));
}

namespace detail {

bool same_token(std::string_view given, std::string_view wanted) {
  unsigned different = given.size() == wanted.size() ? 0 : 1;
  for (std::size_t i = 0; i < given.size(); ++i) {
    const char other = i < wanted.size() ? wanted[i] : '\0';
    // Volatile: no compiler may stop at the first difference.
    const volatile unsigned step = static_cast<unsigned char>(given[i]) ^ static_cast<unsigned char>(other);
    different |= step;
  }
  return different == 0;
}

bool valid_token(std::string_view token) {
  return token.size() >= 16 && token.size() <= 128 && std::all_of(token.begin(), token.end(), [](char one) {
           return (one >= 'a' && one <= 'z') || (one >= 'A' && one <= 'Z') || (one >= '0' && one <= '9') || one == '-' ||
                  one == '_';
         });
}

}  // namespace detail
}  // namespace crosstie::live
