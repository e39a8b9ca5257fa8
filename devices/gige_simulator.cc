#include "devices/gige_simulator.h"

#include <cstdint>
#include <utility>

#include <arpa/inet.h>
#include <arv.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include "base/file_descriptor.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;

/// Whether a camera can be had at the address. Aravis shares its port (SO_REUSEADDR), so that a second camera would not fail but take the
/// first one's requests.
bool port_is_free(const std::string& address) {
  constexpr std::uint16_t kControlPort = 3956;  // GVCP
  sockaddr_in place{};
  place.sin_family = AF_INET;
  place.sin_port = htons(kControlPort);
  if (::inet_pton(AF_INET, address.c_str(), &place.sin_addr) != 1) return false;
  const base::FileDescriptor probe(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  return probe.valid() && ::bind(probe.number(), reinterpret_cast<const sockaddr*>(&place), sizeof place) == 0;
}

class AravisSimulator : public GigeSimulator {
 public:
  AravisSimulator(const std::string& address, const std::string& serial, FillPixels fill)
      : fill_(std::move(fill)), camera_(arv_gv_fake_camera_new(address.c_str(), serial.c_str())) {
    arv_fake_camera_set_fill_pattern(arv_gv_fake_camera_get_fake_camera(camera_), &AravisSimulator::fill, this);
  }
  AravisSimulator(const AravisSimulator&) = delete;
  AravisSimulator& operator=(const AravisSimulator&) = delete;
  ~AravisSimulator() override { g_object_unref(camera_); }  // waits for its thread

  [[nodiscard]] bool answers() const { return arv_gv_fake_camera_is_running(camera_) != FALSE; }

 private:
  /// The buffer tells its size only once it is filled: its region and format tell it before.
  static void fill(ArvBuffer* buffer, void* self, guint32 exposure_us, guint32 gain, ArvPixelFormat code) {
    const GigeExposure exposure{arv_buffer_get_image_width(buffer), arv_buffer_get_image_height(buffer),
                                code == ARV_PIXEL_FORMAT_MONO_16 ? PixelFormat::kMono16 : PixelFormat::kMono8,
                                1e-6 * exposure_us, static_cast<double>(gain)};
    std::size_t unknown = 0;
    auto* data = static_cast<std::byte*>(const_cast<void*>(arv_buffer_get_data(buffer, &unknown)));
    const auto pixels = static_cast<std::size_t>(exposure.width_px) * static_cast<std::size_t>(exposure.height_px);
    static_cast<AravisSimulator*>(self)->fill_(exposure,
                                               {data, pixels * static_cast<std::size_t>(storage_bits(exposure.format)) / 8});
  }

  FillPixels fill_;
  ArvGvFakeCamera* camera_;
};

}  // namespace

base::Result<std::unique_ptr<GigeSimulator>> simulate_gige_camera(const std::string& address, const std::string& serial,
                                                                  FillPixels fill) {
  if (address.empty() || serial.empty())
    return base::fail(ErrorCode::kUsage, "simulated camera: it needs an address and a serial number");
  std::unique_ptr<AravisSimulator> simulator;
  if (port_is_free(address)) simulator = std::make_unique<AravisSimulator>(address, serial, std::move(fill));
  if (!simulator || !simulator->answers()) {
    return base::fail(
        ErrorCode::kDevice,
        fmt::format("simulated camera {}: the port 3956 of {} is taken, or the address is none of this host", serial, address));
  }
  return simulator;
}

}  // namespace crosstie::devices
