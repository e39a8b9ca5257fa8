#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace crosstie::base::detail {

/// Unsigned integers out of raw bytes; the caller has checked that they are there.
inline std::uint8_t byte_at(std::string_view bytes, std::size_t at) { return static_cast<std::uint8_t>(bytes[at]); }
inline std::uint16_t little16(std::string_view bytes, std::size_t at) {
  return static_cast<std::uint16_t>(byte_at(bytes, at) | byte_at(bytes, at + 1) << 8);
}
inline std::uint16_t big16(std::string_view bytes, std::size_t at) {
  return static_cast<std::uint16_t>(byte_at(bytes, at) << 8 | byte_at(bytes, at + 1));
}
inline std::uint32_t little32(std::string_view bytes, std::size_t at) {
  return std::uint32_t{little16(bytes, at)} | std::uint32_t{little16(bytes, at + 2)} << 16;
}
inline std::uint32_t big32(std::string_view bytes, std::size_t at) {
  return std::uint32_t{big16(bytes, at)} << 16 | std::uint32_t{big16(bytes, at + 2)};
}

}  // namespace crosstie::base::detail
