#include "devices/aravis_camera.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <string_view>
#include <thread>
#include <utility>

#include <arv.h>
#include <fmt/format.h>

#include "devices/detail/raw_pixels.h"
#include "devices/detail/shown_line.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;
using detail::RawFormat;

constexpr int kBuffers = 8;
constexpr guint64 kPopTimeout_us = 100'000;
constexpr gint kSocketBufferBytes = 16 << 20;  // a whole frame at least; the system's limit net.core.rmem_max may be lower
constexpr double kSettingTolerance = 0.05;
constexpr double kTemperaturePeriod_s =
    10.0;  // between two readings: a request takes a millisecond, and the buffers wait meanwhile

struct ObjectDeleter {
  void operator()(void* object) const { g_object_unref(object); }
};
struct GlibDeleter {
  void operator()(const void* memory) const { g_free(const_cast<void*>(memory)); }
};
template <typename T>
using Owned = std::unique_ptr<T, ObjectDeleter>;

/// Collects the error of one call of Aravis: `arv_camera_set_gain(camera, gain, error)`.
class AravisError {
 public:
  AravisError() = default;
  AravisError(const AravisError&) = delete;
  AravisError& operator=(const AravisError&) = delete;
  ~AravisError() { g_clear_error(&error_); }
  operator GError**() { return &error_; }  // NOLINT(google-explicit-constructor): it stands for the argument

  [[nodiscard]] bool failed() const { return error_ != nullptr; }
  [[nodiscard]] std::string message() const { return failed() ? error_->message : ""; }

 private:
  GError* error_ = nullptr;
};

struct NamedFormat {
  const char* name;
  PixelFormat wanted;
  RawFormat raw;
  ArvPixelFormat code;
};
/// In the order of preference; unpacked first.
constexpr std::array<NamedFormat, 5> kFormats = {{
    {"Mono8", PixelFormat::kMono8, RawFormat::kMono8, ARV_PIXEL_FORMAT_MONO_8},
    {"Mono12", PixelFormat::kMono12, RawFormat::kMono12, ARV_PIXEL_FORMAT_MONO_12},
    {"Mono12p", PixelFormat::kMono12, RawFormat::kMono12p, 0x010c0047},  // PFNC's value, which Aravis 0.8 does not name
    {"Mono12Packed", PixelFormat::kMono12, RawFormat::kMono12Packed, ARV_PIXEL_FORMAT_MONO_12_PACKED},
    {"Mono16", PixelFormat::kMono16, RawFormat::kMono16, ARV_PIXEL_FORMAT_MONO_16},
}};

/// Sets the features of one camera; what fails is named, and nothing is set after it.
class Configuration {
 public:
  explicit Configuration(ArvCamera* camera) : camera_(camera) {}

  base::Result<CameraSettings> apply(const CameraSettings& settings) {
    AravisError error;
    arv_camera_set_acquisition_mode(camera_, ARV_ACQUISITION_MODE_CONTINUOUS, error);
    if (error.failed()) return refused("AcquisitionMode = Continuous", error);
    if (settings.width_px > 0) arv_camera_set_region(camera_, 0, 0, settings.width_px, settings.height_px, error);
    if (error.failed()) return refused(fmt::format("a region of {} x {} px", settings.width_px, settings.height_px), error);
    for (const auto step : {&Configuration::set_format, &Configuration::switch_automatics_off, &Configuration::set_exposure,
                            &Configuration::set_trigger}) {
      if (auto done = (this->*step)(settings); !done) return base::fail(std::move(done));
    }
    return read_back(settings);
  }

 private:
  [[nodiscard]] static tl::unexpected<base::Error> refused(std::string_view what, const AravisError& error) {
    return base::fail(ErrorCode::kDevice, fmt::format("the camera refuses {}: {}", what, error.message()));
  }
  [[nodiscard]] bool has(const char* feature) const {
    AravisError ignored;
    return arv_camera_is_feature_available(camera_, feature, ignored) != FALSE && !ignored.failed();
  }

  base::Result<> set_format(const CameraSettings& settings) {
    AravisError error;
    guint count = 0;
    const std::unique_ptr<const char*, GlibDeleter> names(
        arv_camera_dup_available_pixel_formats_as_strings(camera_, &count, error));
    if (error.failed()) return refused("to name its pixel formats", error);
    const std::vector<std::string> offered(names.get(), names.get() + count);
    for (const NamedFormat& format : kFormats) {
      if (format.wanted != settings.format || std::find(offered.begin(), offered.end(), format.name) == offered.end()) continue;
      arv_camera_set_pixel_format_from_string(camera_, format.name, error);
      if (error.failed()) return refused(fmt::format("PixelFormat = {}", format.name), error);
      return {};
    }
    return base::fail(ErrorCode::kDevice, fmt::format("the camera has no {}; it offers {}", pixel_format_name(settings.format),
                                                      fmt::join(offered, ", ")));
  }

  base::Result<> switch_automatics_off(const CameraSettings&) {
    for (const char* feature : {"ExposureAuto", "GainAuto", "BlackLevelAuto"}) {
      AravisError error;
      if (has(feature)) arv_camera_set_string(camera_, feature, "Off", error);
      if (error.failed()) return refused(fmt::format("{} = Off", feature), error);
    }
    AravisError error;
    if (has("GammaEnable")) {
      arv_camera_set_boolean(camera_, "GammaEnable", FALSE, error);
    } else if (has("Gamma")) {
      arv_camera_set_float(camera_, "Gamma", 1.0, error);
    }
    if (error.failed()) return refused("to switch gamma off", error);
    return {};
  }

  base::Result<> set_exposure(const CameraSettings& settings) {
    AravisError error;
    if (has("ExposureMode")) arv_camera_set_string(camera_, "ExposureMode", "Timed", error);
    if (!error.failed()) arv_camera_set_exposure_time(camera_, 1e6 * settings.exposure_s, error);
    if (error.failed()) return refused(fmt::format("an exposure of {} s", settings.exposure_s), error);
    if (arv_camera_is_gain_available(camera_, nullptr) != FALSE) arv_camera_set_gain(camera_, settings.gain, error);
    if (error.failed()) return refused(fmt::format("a gain of {}", settings.gain), error);
    return {};
  }

  base::Result<> set_trigger(const CameraSettings& settings) {
    AravisError error;
    if (settings.trigger == TriggerMode::kFreeRunning) {
      if (has("TriggerMode")) arv_camera_clear_triggers(camera_, error);
      if (!error.failed() && settings.frame_rate_hz > 0.0) arv_camera_set_frame_rate(camera_, settings.frame_rate_hz, error);
      if (error.failed()) return refused(fmt::format("to run freely at {} Hz", settings.frame_rate_hz), error);
      return {};
    }
    const bool software = settings.trigger == TriggerMode::kSoftware;
    const std::string source = software ? "Software" : settings.trigger_line;
    arv_camera_set_trigger(camera_, source.c_str(), error);
    if (!error.failed() && !software) {
      arv_camera_set_string(camera_, "TriggerActivation", settings.rising_edge ? "RisingEdge" : "FallingEdge", error);
    }
    if (error.failed()) return refused(fmt::format("the trigger {}", detail::shown_line(source)), error);
    return {};
  }

  base::Result<CameraSettings> read_back(CameraSettings settings) {
    AravisError error;
    const CameraSettings wanted = settings;
    settings.exposure_s = 1e-6 * arv_camera_get_exposure_time(camera_, error);
    if (!error.failed() && arv_camera_is_gain_available(camera_, nullptr) != FALSE)
      settings.gain = arv_camera_get_gain(camera_, error);
    if (!error.failed()) arv_camera_get_region(camera_, nullptr, nullptr, &settings.width_px, &settings.height_px, error);
    if (error.failed()) return refused("to tell its settings", error);
    const bool other_region =
        wanted.width_px > 0 && (wanted.width_px != settings.width_px || wanted.height_px != settings.height_px);
    if (std::abs(settings.exposure_s - wanted.exposure_s) > kSettingTolerance * wanted.exposure_s ||
        std::abs(settings.gain - wanted.gain) > kSettingTolerance * std::max(1.0, std::abs(wanted.gain)) || other_region) {
      return base::fail(
          ErrorCode::kDevice,
          fmt::format("the camera took other settings: {} s, gain {}, {} x {} px in place of {} s, gain {}, {} x {} px",
                      settings.exposure_s, settings.gain, settings.width_px, settings.height_px, wanted.exposure_s, wanted.gain,
                      wanted.width_px, wanted.height_px));
    }
    return settings;
  }

  ArvCamera* camera_;
};

class AravisCamera : public CameraDevice {
 public:
  AravisCamera(std::string id, Clock clock) : id_(std::move(id)), clock_(std::move(clock)) { state_.name = "camera " + id_; }
  AravisCamera(const AravisCamera&) = delete;
  AravisCamera& operator=(const AravisCamera&) = delete;
  ~AravisCamera() override {
    stop();
    disconnect();
  }

  base::Result<> connect() {
    disconnect();
    AravisError error;
    camera_.reset(arv_camera_new(id_.c_str(), error));
    if (!camera_) return failed("no camera answers to this name or address: " + error.message());
    ArvDevice* device = arv_camera_get_device(camera_.get());
    if (ARV_IS_GV_DEVICE(device) && !arv_gv_device_is_controller(ARV_GV_DEVICE(device))) {
      camera_.reset();
      return failed("another program controls it");
    }
    arv_camera_set_range_check_policy(camera_.get(), ARV_RANGE_CHECK_POLICY_ENABLE);
    lost_ = false;
    lost_signal_ = g_signal_connect(device, "control-lost", G_CALLBACK(&AravisCamera::control_lost), this);
    return {};
  }

  base::Result<CameraSettings> start(const CameraSettings& settings, FrameSink sink) override {
    if (auto valid = settings.validate(); !valid) return base::fail(std::move(valid));
    if (state().running) return base::fail(ErrorCode::kUsage, state_.name + " is running already");
    stop();  // the thread of a run that ended by itself
    if (!camera_ || lost_) {
      if (auto connected = connect(); !connected) return base::fail(std::move(connected));
    }
    auto taken = Configuration(camera_.get()).apply(settings);
    if (!taken) return failed(taken.error().message);
    if (auto streams = open_stream(); !streams) return base::fail(std::move(streams));
    {
      const std::lock_guard lock(mutex_);
      state_ = {.name = state_.name, .running = true, .id_bits = id_bits()};
      settings_ = settings;
      broken_ = 0;
    }
    temperature_read_.reset();
    thread_ = std::jthread([this, sink = std::move(sink)](const std::stop_token& stop) { receive(stop, sink); });
    AravisError error;
    arv_camera_start_acquisition(camera_.get(), error);
    if (error.failed()) {
      stop();
      return failed("acquisition does not start: " + error.message());
    }
    return taken;
  }

  void stop() override {
    if (thread_.joinable()) {
      thread_.request_stop();
      thread_.join();
    }
    if (stream_ && !lost_) arv_camera_stop_acquisition(camera_.get(), nullptr);  // failing, it is lost
    stream_.reset();
    const std::lock_guard lock(mutex_);
    state_.running = false;
  }

  base::Result<> trigger() override {
    {
      const std::lock_guard lock(mutex_);
      if (!state_.running) return failed(state_.trouble.empty() ? "it is not running" : state_.trouble);
      if (settings_.trigger != TriggerMode::kSoftware)
        return base::fail(ErrorCode::kUsage, state_.name + ": no software trigger is set");
    }
    AravisError error;
    arv_camera_software_trigger(camera_.get(), error);
    if (error.failed()) return failed("the software trigger failed: " + error.message());
    return {};
  }

  CameraState state() override {
    const std::lock_guard lock(mutex_);
    return state_;
  }

 private:
  static void control_lost(ArvDevice*, void* self) { static_cast<AravisCamera*>(self)->lost_ = true; }

  [[nodiscard]] tl::unexpected<base::Error> failed(const std::string& why) const {
    return base::fail(ErrorCode::kDevice, fmt::format("camera {}: {}", id_, why));
  }

  void disconnect() {
    if (!camera_) return;
    g_signal_handler_disconnect(arv_camera_get_device(camera_.get()), lost_signal_);
    camera_.reset();
  }

  base::Result<> open_stream() {
    AravisError error;
    const guint payload_bytes = arv_camera_get_payload(camera_.get(), error);
    if (!error.failed()) stream_.reset(arv_camera_create_stream(camera_.get(), nullptr, nullptr, error));
    if (!stream_) return failed("no stream: " + error.message());
    if (ARV_IS_GV_STREAM(stream_.get())) {
      g_object_set(stream_.get(), "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size", kSocketBufferBytes,
                   nullptr);
    }
    for (int i = 0; i < kBuffers; ++i) arv_stream_push_buffer(stream_.get(), arv_buffer_new(payload_bytes, nullptr));
    return {};
  }

  /// GigE Vision counts in 16 bits, unless the camera was switched to extended ids.
  [[nodiscard]] int id_bits() const {
    if (arv_camera_is_gv_device(camera_.get()) == FALSE) return 64;
    AravisError absent;
    const char* mode = arv_camera_get_string(camera_.get(), "GevGVSPExtendedIDMode", absent);
    return !absent.failed() && mode != nullptr && std::string_view(mode) == "On" ? 64 : 16;
  }

  void receive(const std::stop_token& stop, const FrameSink& sink) {
    while (!stop.stop_requested()) {
      const Owned<ArvBuffer> buffer(arv_stream_timeout_pop_buffer(stream_.get(), kPopTimeout_us));
      if (buffer) {
        const HostTime arrived = clock_();
        base::Result<Frame> frame = to_frame(buffer.get(), arrived);
        arv_stream_push_buffer(stream_.get(), ARV_BUFFER(g_object_ref(buffer.get())));
        count(frame.has_value());
        if (frame) sink(std::move(frame));
      }
      if (!lost_) read_temperature();
      if (lost_) return end("the camera does not answer any more: cable, power or another program", sink);
    }
  }

  /// SFNC's DeviceTemperature, of the place that the camera's selector stands at. A camera that has none, or refuses, tells nothing.
  [[nodiscard]] std::optional<double> temperature_c() const {
    AravisError error;
    if (arv_camera_is_feature_available(camera_.get(), "DeviceTemperature", error) == FALSE || error.failed()) return {};
    const double value_c = arv_camera_get_float(camera_.get(), "DeviceTemperature", error);
    return error.failed() || !std::isfinite(value_c) ? std::nullopt : std::optional(value_c);
  }

  void read_temperature() {
    const HostTime now = host_now();
    if (temperature_read_ && seconds_between(*temperature_read_, now) < kTemperaturePeriod_s) return;
    temperature_read_ = now;
    const std::optional<double> value_c = temperature_c();
    const std::lock_guard lock(mutex_);
    state_.temperature_c = value_c;
  }

  [[nodiscard]] base::Result<Frame> to_frame(ArvBuffer* buffer, HostTime arrived) const {
    if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS) return failed("a frame is incomplete");
    const ArvPixelFormat code = arv_buffer_get_image_pixel_format(buffer);
    const auto* format =
        std::find_if(kFormats.begin(), kFormats.end(), [&](const NamedFormat& one) { return one.code == code; });
    if (format == kFormats.end()) return failed(fmt::format("a frame of pixel format {:#x}", code));
    std::size_t size = 0;
    const void* data = arv_buffer_get_image_data(buffer, &size);
    int padding_bytes = 0, rows_padding_bytes = 0;
    arv_buffer_get_image_padding(buffer, &padding_bytes, &rows_padding_bytes);
    auto image =
        detail::unpack_pixels({static_cast<const std::byte*>(data), size}, arv_buffer_get_image_width(buffer),
                              arv_buffer_get_image_height(buffer), static_cast<std::size_t>(padding_bytes), format->raw);
    if (!image) return base::fail(std::move(image));
    const auto device_time = std::chrono::nanoseconds(static_cast<std::int64_t>(arv_buffer_get_timestamp(buffer)));
    return Frame{{arv_buffer_get_frame_id(buffer), device_time, arrived}, *std::move(image), {}};
  }

  void count(bool complete) {
    guint64 completed = 0, failures = 0, underruns = 0;
    arv_stream_get_statistics(stream_.get(), &completed, &failures, &underruns);
    const std::lock_guard lock(mutex_);
    if (complete) {
      ++state_.frames;
    } else {
      ++broken_;
    }
    state_.incomplete = broken_ + underruns;
  }

  void end(const std::string& why, const FrameSink& sink) {
    {
      const std::lock_guard lock(mutex_);
      state_.running = false;
      state_.trouble = why;
    }
    sink(failed(why));
  }

  std::string id_;
  Clock clock_;
  Owned<ArvCamera> camera_;
  gulong lost_signal_ = 0;
  std::optional<HostTime> temperature_read_;  ///< by the receiving thread
  std::atomic<bool> lost_ = false;
  Owned<ArvStream> stream_;
  std::mutex mutex_;  ///< of the three below
  CameraState state_;
  CameraSettings settings_;
  std::uint64_t broken_ = 0;
  std::jthread thread_;
};

std::string text(const char* words) { return words == nullptr ? "" : words; }

}  // namespace

std::vector<FoundCamera> find_aravis_cameras() {
  arv_update_device_list();
  std::vector<FoundCamera> found;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    found.push_back({text(arv_get_device_id(i)), text(arv_get_device_vendor(i)), text(arv_get_device_model(i)),
                     text(arv_get_device_serial_nbr(i)), text(arv_get_device_address(i)), text(arv_get_device_protocol(i))});
  }
  return found;
}

base::Result<std::unique_ptr<CameraDevice>> open_aravis_camera(const std::string& id, Clock clock) {
  if (id.empty()) return base::fail(ErrorCode::kUsage, "camera: no name and no address");
  auto camera = std::make_unique<AravisCamera>(id, std::move(clock));
  if (auto connected = camera->connect(); !connected) return base::fail(std::move(connected));
  return camera;
}

}  // namespace crosstie::devices
