#include "app/live/devices_file.h"

#include <cmath>
#include <limits>
#include <utility>

#include <fmt/core.h>

#include "app/job_table.h"
#include "base/file.h"
#include "devices/aravis_camera.h"
#include "devices/axis_file.h"
#include "devices/axis_stream.h"
#include "devices/watch_folder.h"
#include "devices/window_sequencer.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

constexpr std::size_t kMaxDevicesBytes = std::size_t{1} << 20;
constexpr double kTypedMaxAge_s = 120.0;  // to type it in, look at both pictures and press Next

constexpr double kSoftwareSkew_s = 0.5;

/// What the file says, before anything is opened.
struct Wishes {
  fs::path folder;  ///< of the file; relative paths belong to it
  std::string left, right;
  bool watch = false;  ///< both are file patterns
  devices::CameraSettings settings;
  double timeout_s = 5.0;
  double preview_hz = 10.0;
  std::string axis = "typed";
  std::optional<fs::path> axis_path;
  std::string axis_host;
  int axis_port = 0;
  devices::SerialAxisOptions serial;
  devices::AxisDialogue dialogue;
  std::optional<double> axis_max_age_s;
  std::string projector = "none";
  devices::WindowSequencerOptions window;
  std::optional<fs::path> projector_folder;
  std::optional<fs::path> patterns;

  [[nodiscard]] fs::path resolve(const fs::path& path) const { return (folder / path).lexically_normal(); }
};

void whole(const JobTable& table, const char* key, int& value) {
  std::optional<double> number;
  table.number(key, number, Domain::kNotNegative);
  if (!number) return;
  if (*number != std::floor(*number) || *number > std::numeric_limits<int>::max()) {
    table.complain(key, "a whole number is needed");
  } else {
    value = static_cast<int>(*number);
  }
}

void read_cameras(const JobTable& table, Wishes& wishes) {
  table.check_keys("cameras", {"kind", "left", "right", "exposure_s", "gain", "format", "trigger", "trigger_line", "preview_hz",
                               "width_px", "height_px", "timeout_s"});
  std::string kind = "genicam";
  table.word("kind", {"genicam", "folders"}, kind);
  wishes.watch = kind == "folders";
  table.text("left", wishes.left);
  table.text("right", wishes.right);
  if (wishes.left.empty() || wishes.right.empty()) table.complain("", "[cameras] needs left and right");
  table.number("exposure_s", wishes.settings.exposure_s);
  table.number("gain", wishes.settings.gain, Domain::kNotNegative);
  std::string format = "Mono8";
  table.word("format", {"Mono8", "Mono12", "Mono16"}, format);
  for (const auto one : {devices::PixelFormat::kMono8, devices::PixelFormat::kMono12, devices::PixelFormat::kMono16}) {
    if (format == devices::pixel_format_name(one)) wishes.settings.format = one;
  }
  std::string trigger = wishes.watch ? "none" : "software";
  table.word("trigger", {"software", "hardware", "none"}, trigger);
  if (wishes.watch && trigger != "none")
    table.complain("trigger", "other software triggers the cameras whose files are watched: trigger = \"none\"");
  wishes.settings.trigger = trigger == "software"   ? devices::TriggerMode::kSoftware
                            : trigger == "hardware" ? devices::TriggerMode::kHardware
                                                    : devices::TriggerMode::kFreeRunning;
  table.text("trigger_line", wishes.settings.trigger_line);
  std::optional<double> preview_hz;
  table.number("preview_hz", preview_hz);
  if (preview_hz) wishes.preview_hz = *preview_hz;
  if (preview_hz && trigger != "software") wishes.settings.frame_rate_hz = *preview_hz;  // their own clock keeps the rate
  whole(table, "width_px", wishes.settings.width_px);
  whole(table, "height_px", wishes.settings.height_px);
  table.number("timeout_s", wishes.timeout_s);
}

void read_axis(const JobTable& table, Wishes& wishes) {
  table.check_keys("axis", {"kind", "path", "host", "port", "device", "baud", "data_bits", "stop_bits", "parity", "label",
                            "unit", "mm_per_unit", "zero_mm", "min_mm", "max_mm", "request", "period_s", "max_age_s"});
  table.word("kind", {"typed", "file", "tcp", "serial"}, wishes.axis);
  table.path("path", wishes.axis_path);
  table.text("host", wishes.axis_host);
  whole(table, "port", wishes.axis_port);
  constexpr int kMostPort = 65535;
  if (wishes.axis_port > kMostPort) table.complain("port", "a port is 1 to 65535");
  std::optional<fs::path> device;
  table.path("device", device);
  if (device) wishes.serial.device = *device;
  whole(table, "baud", wishes.serial.baud);
  whole(table, "data_bits", wishes.serial.data_bits);
  whole(table, "stop_bits", wishes.serial.stop_bits);
  std::string parity = "none";
  table.word("parity", {"none", "even", "odd"}, parity);
  wishes.serial.parity = parity == "even"  ? devices::Parity::kEven
                         : parity == "odd" ? devices::Parity::kOdd
                                           : devices::Parity::kNone;
  devices::AxisLineFormat& line = wishes.dialogue.line;
  table.text("label", line.label);
  table.text("unit", line.unit);
  table.number("mm_per_unit", line.mm_per_unit, Domain::kAny);
  table.number("zero_mm", line.zero_mm, Domain::kAny);
  table.number("min_mm", line.min_mm, Domain::kAny);
  table.number("max_mm", line.max_mm, Domain::kAny);
  table.text("request", wishes.dialogue.request);
  table.number("period_s", wishes.dialogue.period_s);
  table.number("max_age_s", wishes.axis_max_age_s);
  if (wishes.axis == "file" && !wishes.axis_path) table.complain("kind", "an axis that is a file needs path");
  if (wishes.axis == "tcp" && (wishes.axis_host.empty() || wishes.axis_port == 0))
    table.complain("kind", "an axis over TCP needs host and port");
  if (wishes.axis == "serial" && !device) table.complain("kind", "an axis on a serial port needs device");
}

void read_projector(const JobTable& table, Wishes& wishes) {
  table.check_keys("projector", {"kind", "screen", "settle_refreshes", "folder", "patterns"});
  table.word("kind", {"none", "window", "files"}, wishes.projector);
  whole(table, "screen", wishes.window.screen);
  whole(table, "settle_refreshes", wishes.window.settle_refreshes);
  table.path("folder", wishes.projector_folder);
  table.path("patterns", wishes.patterns);
  if (wishes.projector != "none" && !wishes.patterns)
    table.complain("kind", "a projector needs patterns, the folder that `crosstie patterns` wrote");
  if (wishes.projector == "files" && !wishes.projector_folder) table.complain("kind", "a projector of files needs folder");
}

Result<Wishes> read_wishes(const fs::path& file) {
  const auto text = base::read_file(file, kMaxDevicesBytes);
  if (!text) return tl::unexpected(text.error());
  const auto root = JobTable::parse(file, *text);
  if (!root) return tl::unexpected(root.error());
  Wishes wishes;
  wishes.folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  root->check_keys("", {"format", "cameras", "axis", "projector"});
  std::string format;
  root->text("format", format);
  if (format != "crosstie-devices/1") root->complain("format", "format = \"crosstie-devices/1\" is needed");
  const auto cameras = root->table("cameras");
  if (!cameras) root->complain("", "[cameras] is needed");
  if (cameras) read_cameras(*cameras, wishes);
  if (const auto axis = root->table("axis")) read_axis(*axis, wishes);
  if (const auto projector = root->table("projector")) read_projector(*projector, wishes);
  if (root->error()) return tl::unexpected(*root->error());
  return wishes;
}

Result<> open_cameras(const Wishes& wishes, OpenDevices& open) {
  if (wishes.watch) {
    auto pairs = devices::watch_folder_pair({.files = {.pattern = wishes.resolve(wishes.left)}},
                                            {.files = {.pattern = wishes.resolve(wishes.right)}});
    if (!pairs) return base::fail(std::move(pairs));
    open.pairs = *std::move(pairs);
    return {};
  }
  for (const auto& [side, id] : {std::pair{std::size_t{0}, wishes.left}, std::pair{std::size_t{1}, wishes.right}}) {
    auto camera = devices::open_aravis_camera(id);
    if (!camera) return base::fail(std::move(camera));
    open.cameras[side] = *std::move(camera);
  }
  devices::FramePairingOptions pairing;
  // Two software triggers are as far apart as the network wants.
  if (wishes.settings.trigger == devices::TriggerMode::kSoftware) pairing.max_device_skew_s = kSoftwareSkew_s;
  open.pairs = std::make_unique<devices::CameraPair>(*open.cameras[0], *open.cameras[1], pairing);
  return {};
}

Result<std::unique_ptr<devices::AxisReader>> open_axis(const Wishes& wishes) {
  if (wishes.axis == "file")
    return devices::read_axis_file({.path = wishes.resolve(*wishes.axis_path), .line = wishes.dialogue.line});
  if (wishes.axis == "tcp") {
    return devices::connect_tcp_axis({.host = wishes.axis_host, .port = wishes.axis_port, .dialogue = wishes.dialogue});
  }
  devices::SerialAxisOptions serial = wishes.serial;
  serial.dialogue = wishes.dialogue;
  return devices::open_serial_axis(serial);
}

Result<> open_projector(const Wishes& wishes, OpenDevices& open) {
  if (wishes.projector == "none") return {};
  if (wishes.projector == "files") {
    open.projector = std::make_unique<devices::FileSequencer>(wishes.resolve(*wishes.projector_folder));
  } else {
    auto window = devices::WindowSequencer::open(wishes.window);
    if (!window) return base::fail(std::move(window));
    open.projector = *std::move(window);
  }
  open.live.pattern_images = patterns_in(wishes.resolve(*wishes.patterns));
  return {};
}

/// Whether both are the same patterns; the names of images are a job's own.
bool same_patterns(const base::PatternSequence& a, const base::PatternSequence& b) {
  if (a.width_px != b.width_px || a.height_px != b.height_px || a.patterns.size() != b.patterns.size()) return false;
  for (const auto axis : {base::ProjectorAxis::kX, base::ProjectorAxis::kY}) {
    const base::AxisCode& one = a.code(axis);
    const base::AxisCode& other = b.code(axis);
    if (one.fringes != other.fringes || one.gray_bits != other.gray_bits || one.word_periods != other.word_periods ||
        one.word_offset != other.word_offset) {
      return false;
    }
  }
  for (std::size_t i = 0; i < a.patterns.size(); ++i) {
    const base::Pattern& one = a.patterns[i];
    const base::Pattern& other = b.patterns[i];
    if (one.kind != other.kind || one.axis != other.axis || one.bit != other.bit || one.frequency != other.frequency ||
        one.shift != other.shift || one.exposure != other.exposure || one.repeat != other.repeat) {
      return false;
    }
  }
  return true;
}

}  // namespace

PatternImages patterns_in(const fs::path& folder) {
  return [folder](const base::PatternSequence& wanted) -> Result<std::vector<base::Image>> {
    const auto sequence = base::read_pattern_manifest(folder / "patterns.json");
    if (!sequence) return tl::unexpected(sequence.error());
    if (!same_patterns(*sequence, wanted)) {
      return base::fail(ErrorCode::kBadInput, fmt::format("the patterns in {} are not those of the job's manifest: copy its "
                                                          "patterns.json into the job, or make them anew",
                                                          base::shown(folder)));
    }
    std::vector<base::Image> images;
    for (const base::Pattern& pattern : sequence->patterns) {
      auto image = base::read_image(folder / pattern.files[0]);
      if (!image) return base::fail(std::move(image));
      images.push_back(*std::move(image));
    }
    return images;
  };
}

Result<OpenDevices> open_devices(const fs::path& file) {
  const auto wishes = read_wishes(file);
  if (!wishes) return tl::unexpected(wishes.error());
  OpenDevices open;
  if (auto opened = open_cameras(*wishes, open); !opened) return base::fail(std::move(opened));
  if (wishes->axis == "typed") {
    auto typed = std::make_unique<devices::TypedAxis>();
    open.live.typed = typed.get();
    open.axis = std::move(typed);
    open.live.axis_max_age_s = kTypedMaxAge_s;
  } else {
    auto axis = open_axis(*wishes);
    if (!axis) return base::fail(std::move(axis));
    open.axis = *std::move(axis);
  }
  if (auto opened = open_projector(*wishes, open); !opened) return base::fail(std::move(opened));
  if (wishes->axis_max_age_s) open.live.axis_max_age_s = *wishes->axis_max_age_s;
  open.live.pairs = open.pairs.get();
  open.live.axis = open.axis.get();
  open.live.projector = open.projector.get();
  open.live.capture = {.settings = wishes->settings, .timeout_s = wishes->timeout_s};
  open.live.preview = wishes->settings;
  open.live.preview_hz = wishes->preview_hz;
  // The pulses of a hardware trigger come with the patterns.
  if (open.live.preview.trigger == devices::TriggerMode::kHardware)
    open.live.preview.trigger = devices::TriggerMode::kFreeRunning;
  return open;
}

}  // namespace crosstie::app
