#include "devices/gige_simulator.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <thread>
#include <utility>
#include <vector>

#include <arpa/inet.h>
#include <arv.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>

#include "base/file_descriptor.h"
#include "devices/detail/gige_packets.h"
#include "devices/host_time.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using base::FileDescriptor;
using detail::GvcpCommand;
using detail::GvcpStatus;
using Bytes = std::vector<std::byte>;

// Registers of the standard's bootstrap map.
constexpr guint32 kMacHigh = 0x0008, kMacLow = 0x000c, kDiscoveryBytes = 0x00f8, kCapability = 0x0934;
constexpr guint32 kStreamPort = 0x0d00, kStreamPacketSize = 0x0d04, kStreamAddress = 0x0d18, kControlPrivilege = 0x0a00;
constexpr guint32 kCanResend = 1U << 2U, kCanWriteMemory = 1U << 1U;

constexpr std::size_t kPacketOverhead = 36;      // headers of IP, UDP and GVSP, which the packet size counts
constexpr std::size_t kBurstPackets = 32;        // sent at once
constexpr double kLinkBytesPerSecond = 125e6;    // 1 Gbit/s: bursts of whole frames overflow the sockets of most hosts
constexpr std::chrono::milliseconds kIdle{100};  // between two looks at the heartbeat

bool same(const sockaddr_in& a, const sockaddr_in& b) {
  return a.sin_port == b.sin_port && a.sin_addr.s_addr == b.sin_addr.s_addr;
}

/// A UDP socket on a port of the host, 0: any free one; that of broadcasts is shared by all cameras of the host.
FileDescriptor bound_to(in_addr address, std::uint16_t port, bool shared = false) {
  FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const int yes = 1;
  if (socket.valid() && shared) ::setsockopt(socket.number(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(port);
  place.sin_addr = address;
  if (socket.valid() && ::bind(socket.number(), reinterpret_cast<const sockaddr*>(&place), sizeof place) != 0) return {};
  return socket;
}

class SimulatedGigeCamera : public GigeSimulator {
 public:
  SimulatedGigeCamera(in_addr address, const std::string& serial, FillPixels fill, FileDescriptor control)
      : fill_(std::move(fill)),
        camera_(arv_fake_camera_new(serial.c_str())),
        control_(std::move(control)),
        broadcast_(bound_to({htonl(INADDR_BROADCAST)}, detail::kGvcpPort, true)),
        stream_(bound_to(address, 0)) {
    arv_fake_camera_set_fill_pattern(camera_, &SimulatedGigeCamera::fill, this);
    GInetAddress* own = g_inet_address_new_from_bytes(reinterpret_cast<const guint8*>(&address), G_SOCKET_FAMILY_IPV4);
    arv_fake_camera_set_inet_address(camera_, own);
    g_object_unref(own);
    arv_fake_camera_write_register(camera_, kMacHigh, 0x0200);  // locally administered
    arv_fake_camera_write_register(camera_, kMacLow, ntohl(address.s_addr));
    arv_fake_camera_write_register(camera_, kCapability, kCanResend | kCanWriteMemory);
    thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
  }
  SimulatedGigeCamera(const SimulatedGigeCamera&) = delete;
  SimulatedGigeCamera& operator=(const SimulatedGigeCamera&) = delete;
  ~SimulatedGigeCamera() override {
    thread_.request_stop();
    thread_.join();
    if (buffer_ != nullptr) g_object_unref(buffer_);
    g_object_unref(camera_);
  }

 private:
  /// The buffer tells its size only once it is filled: its region and format tell it before.
  static void fill(ArvBuffer* buffer, void* self, guint32 exposure_us, guint32 gain, ArvPixelFormat code) {
    const GigeExposure exposure{arv_buffer_get_image_width(buffer), arv_buffer_get_image_height(buffer),
                                code == ARV_PIXEL_FORMAT_MONO_16 ? PixelFormat::kMono16 : PixelFormat::kMono8,
                                1e-6 * exposure_us, static_cast<double>(gain)};
    std::size_t unknown = 0;
    auto* data = static_cast<std::byte*>(const_cast<void*>(arv_buffer_get_data(buffer, &unknown)));
    const auto pixels = static_cast<std::size_t>(exposure.width_px) * static_cast<std::size_t>(exposure.height_px);
    static_cast<SimulatedGigeCamera*>(self)->fill_(
        exposure, {data, pixels * static_cast<std::size_t>(storage_bits(exposure.format)) / 8});
  }

  void run(const std::stop_token& stop) {
    HostTime next = host_now();
    while (!stop.stop_requested()) {
      const bool free_running = streaming() && arv_fake_camera_is_in_free_running_mode(camera_) != FALSE;
      if (!free_running) next = host_now();
      const auto wait = free_running ? std::min<std::chrono::nanoseconds>(next - host_now(), kIdle) : kIdle;
      await_requests(std::max(wait, std::chrono::nanoseconds(0)));
      forget_silent_controller();
      if (!free_running || !streaming() || host_now() < next) continue;
      guint32 period_us = 0;
      arv_fake_camera_read_register(camera_, ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US, &period_us);
      next = std::max(next + std::chrono::microseconds(period_us), host_now());
      expose();
      send();
    }
  }

  [[nodiscard]] guint32 reg(guint32 address) const {
    guint32 value = 0;
    arv_fake_camera_read_register(camera_, address, &value);
    return value;
  }
  [[nodiscard]] bool streaming() const {
    return controller_ && arv_fake_camera_get_acquisition_status(camera_) != 0 && reg(kStreamPort) != 0;
  }

  void await_requests(std::chrono::nanoseconds wait) {
    std::array<pollfd, 2> watched = {{{control_.number(), POLLIN, 0}, {broadcast_.number(), POLLIN, 0}}};
    const timespec timeout{0, static_cast<long>(std::min<std::int64_t>(wait.count(), 999'999'999))};
    if (::ppoll(watched.data(), watched.size(), &timeout, nullptr) <= 0) return;
    for (const FileDescriptor* socket : {&control_, &broadcast_}) {
      std::array<std::byte, 2048> packet;
      sockaddr_in from{};
      socklen_t size = sizeof from;
      const ssize_t received =
          ::recvfrom(socket->number(), packet.data(), packet.size(), 0, reinterpret_cast<sockaddr*>(&from), &size);
      if (received <= 0) continue;
      if (const auto request = detail::parse_gvcp_request({packet.data(), static_cast<std::size_t>(received)}))
        handle(*request, from);
    }
  }

  void handle(const detail::GvcpRequest& request, const sockaddr_in& from) {
    const bool of_controller = controller_ && same(from, *controller_);
    if (of_controller) heard_ = host_now();
    Bytes payload;
    const GvcpStatus status = execute(request, of_controller || !controller_, payload);
    const bool wanted = arv_fake_camera_get_control_channel_privilege(camera_) != 0;
    if (wanted && !controller_) {
      controller_ = from;
      heard_ = host_now();
    } else if (!wanted) {
      release();
    }
    const bool exposed = streaming() && arv_fake_camera_check_and_acknowledge_software_trigger(camera_) != FALSE;
    if (exposed) expose();
    if (request.command != static_cast<std::uint16_t>(GvcpCommand::kPacketResend)) {
      const Bytes answer = detail::gvcp_answer(request, status, payload);
      ::sendto(control_.number(), answer.data(), answer.size(), 0, reinterpret_cast<const sockaddr*>(&from), sizeof from);
    }
    if (exposed) send();
  }

  GvcpStatus execute(const detail::GvcpRequest& request, bool may_write, Bytes& answer) {
    detail::ByteReader reader(request.payload);
    switch (static_cast<GvcpCommand>(request.command)) {
      case GvcpCommand::kDiscovery: {
        answer.resize(kDiscoveryBytes);
        arv_fake_camera_read_memory(camera_, 0, kDiscoveryBytes, answer.data());
        return GvcpStatus::kSuccess;
      }
      case GvcpCommand::kReadRegister: {
        detail::ByteWriter values;
        while (!reader.rest().empty()) {
          const std::uint32_t address = reader.u32();
          if (!reader.good()) return GvcpStatus::kInvalidParameter;
          Bytes value(4);
          if (!read(address, value)) return GvcpStatus::kInvalidAddress;
          values.bytes(value);
        }
        answer = values.written();
        return GvcpStatus::kSuccess;
      }
      case GvcpCommand::kReadMemory: {
        const std::uint32_t address = reader.u32();
        reader.u16();
        Bytes memory(reader.u16());
        if (!reader.good() || memory.empty() || memory.size() > detail::kGvcpMaxBytes) return GvcpStatus::kInvalidParameter;
        if (!read(address, memory)) return GvcpStatus::kInvalidAddress;
        answer = detail::ByteWriter().u32(address).bytes(memory).written();
        return GvcpStatus::kSuccess;
      }
      case GvcpCommand::kWriteRegister:
      case GvcpCommand::kWriteMemory: {
        if (!may_write) return GvcpStatus::kAccessDenied;
        const bool memory = request.command == static_cast<std::uint16_t>(GvcpCommand::kWriteMemory);
        std::uint32_t written = 0;
        while (!reader.rest().empty()) {
          const std::uint32_t address = reader.u32();
          const auto value = memory ? reader.rest() : reader.rest().first(std::min<std::size_t>(4, reader.rest().size()));
          if (!memory) reader.u32();
          if (!reader.good() || value.empty()) return GvcpStatus::kInvalidParameter;
          if (address >= ARV_FAKE_CAMERA_MEMORY_SIZE || value.size() >= ARV_FAKE_CAMERA_MEMORY_SIZE - address)
            return GvcpStatus::kInvalidAddress;
          arv_fake_camera_write_memory(camera_, address, static_cast<guint32>(value.size()), value.data());
          written += memory ? static_cast<std::uint32_t>(value.size()) : 1;
          if (memory) break;
        }
        answer = detail::ByteWriter().u16(0).u16(written).written();
        return GvcpStatus::kSuccess;
      }
      case GvcpCommand::kPacketResend: {
        reader.u16();
        const std::uint16_t block = reader.u16();
        const std::uint32_t first = reader.u32() & 0xffffffU;
        const std::uint32_t last = reader.u32() & 0xffffffU;
        if (reader.good() && buffer_ != nullptr && block == image_.block_id) send(first, last);
        return GvcpStatus::kSuccess;
      }
    }
    return GvcpStatus::kNotImplemented;
  }

  /// Registers, or the description behind them, after whose end zeros are read.
  bool read(std::uint32_t address, std::span<std::byte> bytes) const {
    const auto size = static_cast<guint32>(bytes.size());
    if (address < ARV_FAKE_CAMERA_MEMORY_SIZE) {
      return size < ARV_FAKE_CAMERA_MEMORY_SIZE - address &&
             arv_fake_camera_read_memory(camera_, address, size, bytes.data()) != FALSE;
    }
    std::size_t xml_size = 0;
    const char* xml = arv_fake_camera_get_genicam_xml(camera_, &xml_size);
    const std::size_t from = address - ARV_FAKE_CAMERA_MEMORY_SIZE;
    if (xml == nullptr || from >= xml_size) return false;
    const auto available = std::as_bytes(std::span(xml + from, std::min(bytes.size(), xml_size - from)));
    std::copy(available.begin(), available.end(), bytes.begin());
    return true;
  }

  void release() {
    controller_.reset();
    arv_fake_camera_set_control_channel_privilege(camera_, 0);
    arv_fake_camera_write_register(camera_, ARV_FAKE_CAMERA_REGISTER_ACQUISITION, 0);
  }
  void forget_silent_controller() {
    if (controller_ && seconds_between(heard_, host_now()) > 1e-3 * arv_fake_camera_get_heartbeat_timeout(camera_)) release();
  }

  void expose() {
    const std::size_t payload = arv_fake_camera_get_payload(camera_);
    if (buffer_ == nullptr || payload != payload_) {
      if (buffer_ != nullptr) g_object_unref(buffer_);
      buffer_ = arv_buffer_new(payload, nullptr);
      payload_ = payload;
    }
    arv_fake_camera_fill_buffer(camera_, buffer_, nullptr);
    image_ = {.block_id = static_cast<std::uint16_t>(arv_buffer_get_frame_id(buffer_)),
              .timestamp_ns = arv_buffer_get_timestamp(buffer_),
              .pixel_format = arv_buffer_get_image_pixel_format(buffer_),
              .width_px = static_cast<std::uint32_t>(arv_buffer_get_image_width(buffer_)),
              .height_px = static_cast<std::uint32_t>(arv_buffer_get_image_height(buffer_))};
  }

  [[nodiscard]] std::size_t data_bytes() const {
    return std::clamp<std::size_t>(reg(kStreamPacketSize) & 0xffffU, 576, 65'000) - kPacketOverhead;
  }

  void send() {
    const std::size_t size = data_bytes();
    send(0, static_cast<std::uint32_t>((payload_ + size - 1) / size + 1));
  }

  /// Packets of the latest frame: 0 is its leader, then its pixels, then its trailer.
  void send(std::uint32_t first, std::uint32_t last) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(reg(kStreamPort)));
    to.sin_addr.s_addr = htonl(reg(kStreamAddress));
    const std::size_t size = data_bytes();
    const auto pixels = static_cast<std::uint32_t>((payload_ + size - 1) / size);
    std::size_t unknown = 0;
    const auto* data = static_cast<const std::byte*>(arv_buffer_get_data(buffer_, &unknown));
    HostTime due = host_now();
    std::size_t burst_bytes = 0;
    for (std::uint32_t id = first; id <= std::min(last, pixels + 1); ++id) {
      Bytes packet;
      if (id == 0) {
        packet = gvsp_leader(image_);
      } else if (id <= pixels) {
        const std::size_t from = (id - 1) * size;
        packet = gvsp_packet(detail::GvspKind::kPayload, image_.block_id, id)
                     .bytes({data + from, std::min(size, payload_ - from)})
                     .written();
      } else {
        packet = gvsp_trailer(image_, id);
      }
      ::sendto(stream_.number(), packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
      burst_bytes += packet.size();
      if ((id - first) % kBurstPackets != kBurstPackets - 1) continue;
      due += to_nanoseconds(static_cast<double>(std::exchange(burst_bytes, 0)) / kLinkBytesPerSecond);
      std::this_thread::sleep_until(due);
    }
  }

  FillPixels fill_;
  ArvFakeCamera* camera_;
  FileDescriptor control_;
  FileDescriptor broadcast_;
  FileDescriptor stream_;
  std::optional<sockaddr_in> controller_;
  HostTime heard_;  ///< of the controller
  ArvBuffer* buffer_ = nullptr;
  std::size_t payload_ = 0;  ///< bytes of the buffer
  detail::GvspImage image_;  ///< in the buffer
  std::jthread thread_;
};

}  // namespace

base::Result<std::unique_ptr<GigeSimulator>> simulate_gige_camera(const std::string& address, const std::string& serial,
                                                                  FillPixels fill) {
  constexpr std::size_t kSerialBytes = 16;
  if (address.empty() || serial.empty() || serial.size() >= kSerialBytes)
    return base::fail(ErrorCode::kUsage, "simulated camera: it needs an address and a serial number of up to 15 bytes");
  in_addr place{};
  FileDescriptor control;
  if (::inet_pton(AF_INET, address.c_str(), &place) == 1) control = bound_to(place, detail::kGvcpPort);
  if (!control.valid()) {
    return base::fail(
        ErrorCode::kDevice,
        fmt::format("simulated camera {}: the port 3956 of {} is taken, or the address is none of this host", serial, address));
  }
  return std::make_unique<SimulatedGigeCamera>(place, serial, std::move(fill), std::move(control));
}

}  // namespace crosstie::devices
