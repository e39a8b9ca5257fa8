#include "devices/axis_file.h"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>

#include "base/file.h"
#include "base/file_descriptor.h"
#include "base/text.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;

constexpr std::size_t kTailBytes = 4096;
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

/// The end of a file and when the file changed, by the wall clock.
struct Tail {
  std::string text;
  bool whole = false;  ///< it begins where the file does
  std::chrono::nanoseconds changed{};
};

std::chrono::nanoseconds change_of(const struct stat& status) {
  return std::chrono::seconds(status.st_mtim.tv_sec) + std::chrono::nanoseconds(status.st_mtim.tv_nsec);
}

/// Not negative, whatever the clock of a file server says.
std::chrono::nanoseconds age_of(std::chrono::nanoseconds changed) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::max(std::chrono::nanoseconds(0), std::chrono::nanoseconds(now) - changed);
}

base::Result<Tail> read_tail(const std::filesystem::path& path) {
  const base::FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status {};
  if (!file.valid() || ::fstat(file.number(), &status) != 0)
    return base::fail(ErrorCode::kFileSystem, base::last_system_error());
  if (!S_ISREG(status.st_mode)) return base::fail(ErrorCode::kFileSystem, "it is no regular file");
  // The time is taken before the text: a line that is written in between counts as older than it is, never as newer.
  Tail tail{std::string(kTailBytes, '\0'), status.st_size <= static_cast<off_t>(kTailBytes), change_of(status)};
  const off_t begin = tail.whole ? 0 : status.st_size - static_cast<off_t>(kTailBytes);
  const ssize_t count = ::pread(file.number(), tail.text.data(), tail.text.size(), begin);
  if (count < 0) return base::fail(ErrorCode::kFileSystem, base::last_system_error());
  tail.text.resize(static_cast<std::size_t>(count));
  return tail;
}

/// The last line that is not blank, where all that follows it is complete.
base::Result<std::string_view> last_line(const Tail& tail) {
  std::string_view text = tail.text;
  if (tail.whole && text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  if (text.empty()) return base::fail(ErrorCode::kBadInput, "it is empty");
  if (text.back() != '\n') return base::fail(ErrorCode::kBadInput, "its last line has no line end yet");
  text = text.substr(0, text.find_last_not_of(" \t\r\n") + 1);
  if (text.empty()) return base::fail(ErrorCode::kBadInput, "its last lines are blank");
  const std::size_t before = text.rfind('\n');
  if (before == std::string_view::npos && !tail.whole) return base::fail(ErrorCode::kBadInput, "its last line is too long");
  return before == std::string_view::npos ? text : text.substr(before + 1);
}

class AxisFile : public AxisReader {
 public:
  AxisFile(AxisFileOptions options, Clock clock) : options_(std::move(options)), clock_(std::move(clock)) {}

  AxisState state() override {
    const std::lock_guard lock(mutex_);
    const base::Result<> read = look();
    return {"axis file " + base::shown(options_.path), latest_, read ? std::string() : "now: " + read.error().message};
  }

 private:
  base::Result<> look() {
    const HostTime now = clock_();
    const base::Result<Tail> tail = read_tail(options_.path);
    if (!tail) return tl::unexpected(tail.error());
    const base::Result<std::string_view> line = last_line(*tail);
    if (!line) return tl::unexpected(line.error());
    const base::Result<double> position_mm = parse_axis_line(*line, options_.line);
    if (!position_mm) return tl::unexpected(position_mm.error());
    // What has not changed keeps its time: the wall clock may be set in between.
    if (latest_ && latest_->position_mm == *position_mm && changed_ == tail->changed) return {};
    latest_ = AxisReading{*position_mm, now - age_of(tail->changed)};
    changed_ = tail->changed;
    return {};
  }

  AxisFileOptions options_;
  Clock clock_;
  std::mutex mutex_;
  std::optional<AxisReading> latest_;
  std::chrono::nanoseconds changed_{};
};

}  // namespace

base::Result<std::unique_ptr<AxisReader>> read_axis_file(AxisFileOptions options, Clock clock) {
  if (auto valid = options.line.validate(); !valid) return base::fail(std::move(valid));
  return std::make_unique<AxisFile>(std::move(options), std::move(clock));
}

}  // namespace crosstie::devices
