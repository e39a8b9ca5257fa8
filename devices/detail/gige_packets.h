#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

namespace crosstie::devices::detail {

/// The packets of GigE Vision (AIA, version 1.2) as far as a simulated camera speaks them: its control protocol GVCP and its stream protocol
/// GVSP. All numbers are big-endian.

inline constexpr std::uint16_t kGvcpPort = 3956;
inline constexpr std::size_t kGvcpMaxBytes = 576;  ///< what every link carries

enum class GvcpCommand : std::uint16_t {
  kDiscovery = 0x0002,
  kPacketResend = 0x0040,
  kReadRegister = 0x0080,
  kWriteRegister = 0x0082,
  kReadMemory = 0x0084,
  kWriteMemory = 0x0086,
};

enum class GvcpStatus : std::uint16_t {
  kSuccess = 0x0000,
  kNotImplemented = 0x8001,
  kInvalidParameter = 0x8002,
  kInvalidAddress = 0x8003,
  kAccessDenied = 0x8006,
};

/// Reads numbers one after the other; past the end it is no longer good and reads zeros.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) : rest_(bytes) {}

  std::uint16_t u16() { return static_cast<std::uint16_t>(number(2)); }
  std::uint32_t u32() { return number(4); }
  [[nodiscard]] bool good() const { return good_; }
  [[nodiscard]] std::span<const std::byte> rest() const { return rest_; }

 private:
  std::uint32_t number(std::size_t size) {
    if (rest_.size() < size) {
      good_ = false;
      rest_ = {};
      return 0;
    }
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < size; ++i) value = value << 8U | std::to_integer<std::uint32_t>(rest_[i]);
    rest_ = rest_.subspan(size);
    return value;
  }

  std::span<const std::byte> rest_;
  bool good_ = true;
};

class ByteWriter {
 public:
  ByteWriter& u16(std::uint32_t value) { return number(value, 2); }
  ByteWriter& u32(std::uint32_t value) { return number(value, 4); }
  ByteWriter& bytes(std::span<const std::byte> more) {
    bytes_.insert(bytes_.end(), more.begin(), more.end());
    return *this;
  }
  [[nodiscard]] const std::vector<std::byte>& written() const { return bytes_; }

 private:
  ByteWriter& number(std::uint32_t value, unsigned size) {
    for (unsigned i = size; i-- > 0;) bytes_.push_back(static_cast<std::byte>(value >> 8U * i));
    return *this;
  }

  std::vector<std::byte> bytes_;
};

struct GvcpRequest {
  std::uint16_t command = 0;
  std::uint16_t id = 0;
  std::span<const std::byte> payload;
};

/// Nothing for what is no request of this protocol.
inline std::optional<GvcpRequest> parse_gvcp_request(std::span<const std::byte> packet) {
  constexpr std::uint32_t kKey = 0x42;
  ByteReader reader(packet);
  const std::uint16_t key_and_flags = reader.u16();
  GvcpRequest request;
  request.command = reader.u16();
  const std::size_t size = reader.u16();
  request.id = reader.u16();
  if (!reader.good() || key_and_flags >> 8U != kKey || reader.rest().size() < size) return std::nullopt;
  request.payload = reader.rest().first(size);
  return request;
}

inline std::vector<std::byte> gvcp_answer(const GvcpRequest& request, GvcpStatus status, std::span<const std::byte> payload) {
  ByteWriter answer;
  answer.u16(static_cast<std::uint32_t>(status)).u16(request.command + 1U);
  answer.u16(static_cast<std::uint32_t>(payload.size())).u16(request.id).bytes(payload);
  return answer.written();
}

struct GvspImage {
  std::uint16_t block_id = 0;  ///< of the frame
  std::uint64_t timestamp_ns = 0;
  std::uint32_t pixel_format = 0;
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
};

enum class GvspKind : std::uint8_t { kLeader = 1, kTrailer = 2, kPayload = 3 };

inline ByteWriter gvsp_packet(GvspKind kind, std::uint16_t block_id, std::uint32_t packet_id) {
  ByteWriter packet;
  packet.u16(0).u16(block_id).u32(static_cast<std::uint32_t>(kind) << 24U | (packet_id & 0xffffffU));
  return packet;
}

inline std::vector<std::byte> gvsp_leader(const GvspImage& image) {
  constexpr std::uint32_t kImagePayload = 1;
  ByteWriter packet = gvsp_packet(GvspKind::kLeader, image.block_id, 0);
  packet.u16(0).u16(kImagePayload);
  packet.u32(static_cast<std::uint32_t>(image.timestamp_ns >> 32U)).u32(static_cast<std::uint32_t>(image.timestamp_ns));
  packet.u32(image.pixel_format).u32(image.width_px).u32(image.height_px).u32(0).u32(0).u16(0).u16(0);
  return packet.written();
}

inline std::vector<std::byte> gvsp_trailer(const GvspImage& image, std::uint32_t packet_id) {
  constexpr std::uint32_t kImagePayload = 1;
  return gvsp_packet(GvspKind::kTrailer, image.block_id, packet_id).u16(0).u16(kImagePayload).u32(image.height_px).written();
}

}  // namespace crosstie::devices::detail
