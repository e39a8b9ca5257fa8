#include "devices/watch_folder.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "base/file.h"
#include "devices/detail/poller.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;

constexpr std::size_t kMaxWaiting = 16;  // images of one side without a partner

base::Result<> takes_part(const CameraSettings& settings) {
  if (auto valid = settings.validate(); !valid) return valid;
  if (settings.trigger == TriggerMode::kFreeRunning) return {};
  return base::fail(ErrorCode::kUsage, "watch folder: other software takes the images, there is nothing to trigger");
}

base::Result<> no_trigger() { return base::fail(ErrorCode::kUsage, "watch folder: there is nothing to trigger"); }

/// One folder with its count and state, which other threads read.
class WatchedSide {
 public:
  WatchedSide(const WatchFolderOptions& options, const Clock& clock)
      : watch_(options.files, clock), clock_(clock), state_{.name = "watch folder " + base::shown(options.files.pattern)} {}

  struct Found {
    std::string key;
    Frame frame;
  };
  std::vector<Found> look() {
    auto looked = watch_.look();
    const HostTime now = clock_();
    const std::lock_guard lock(mutex_);
    if (!looked) {
      state_.trouble = looked.error().message;
      return {};
    }
    state_.trouble.clear();
    state_.incomplete += looked->warnings.size();
    if (!looked->warnings.empty()) damaged_ = looked->warnings.back().message;
    std::vector<Found> found;
    for (WatchedImage& one : looked->images) {
      damaged_.clear();
      found.push_back({one.key, {{++state_.frames, one.changed, now}, std::move(one.image), one.path.string()}});
    }
    return found;
  }
  void set_running(bool running) {
    const std::lock_guard lock(mutex_);
    state_.running = running;
  }
  CameraState state() {
    const std::lock_guard lock(mutex_);
    CameraState state = state_;
    if (state.trouble.empty()) state.trouble = damaged_;
    return state;
  }

 private:
  FolderWatch watch_;
  Clock clock_;
  std::mutex mutex_;  ///< of the two below
  CameraState state_;
  std::string damaged_;  ///< the latest image, where it could not be read
};

class WatchFolderCamera : public CameraDevice {
 public:
  WatchFolderCamera(WatchFolderOptions options, const Clock& clock) : period_s_(options.period_s), side_(options, clock) {}

  base::Result<CameraSettings> start(const CameraSettings& settings, FrameSink sink) override {
    if (auto fits = takes_part(settings); !fits) return base::fail(std::move(fits));
    if (poller_) return base::fail(ErrorCode::kUsage, side_.state().name + " is running already");
    side_.set_running(true);
    const auto deliver = [this, sink = std::move(sink)] {
      for (auto& found : side_.look()) sink(std::move(found.frame));
    };
    poller_.emplace(deliver, period_s_);
    return settings;
  }
  void stop() override {
    poller_.reset();
    side_.set_running(false);
  }
  base::Result<> trigger() override { return no_trigger(); }
  CameraState state() override { return side_.state(); }

 private:
  double period_s_;
  WatchedSide side_;
  std::optional<detail::Poller> poller_;  ///< last: it ends before what it uses
};

class WatchFolderPair : public PairSource {
 public:
  WatchFolderPair(const WatchFolderOptions& left, const WatchFolderOptions& right, const Clock& clock)
      : period_s_(std::min(left.period_s, right.period_s)), sides_{{{left, clock}, {right, clock}}} {}

  base::Result<CameraSettings> start(const CameraSettings& settings, PairSink sink) override {
    if (auto fits = takes_part(settings); !fits) return base::fail(std::move(fits));
    if (poller_) return base::fail(ErrorCode::kUsage, "watch folders: running already");
    for (WatchedSide& side : sides_) side.set_running(true);
    poller_.emplace([this, sink = std::move(sink)] { look(sink); }, period_s_);
    return settings;
  }
  void stop() override {
    poller_.reset();
    for (WatchedSide& side : sides_) side.set_running(false);
  }
  base::Result<> trigger() override { return no_trigger(); }
  std::array<CameraState, 2> states() override { return {sides_[0].state(), sides_[1].state()}; }
  FramePairingCounts counts() override {
    const std::lock_guard lock(mutex_);
    return counts_;
  }

 private:
  void look(const PairSink& sink) {
    for (std::size_t side = 0; side < sides_.size(); ++side) {
      for (auto& found : sides_[side].look()) {
        if (auto pair = match(side, std::move(found))) sink(*std::move(pair));
      }
    }
  }

  std::optional<FramePair> match(std::size_t side, WatchedSide::Found found) {
    const std::lock_guard lock(mutex_);
    const auto has_key = [&](const WatchedSide::Found& other) { return other.key == found.key; };
    auto& partners = waiting_[1 - side];
    const auto partner = std::find_if(partners.begin(), partners.end(), has_key);
    if (partner != partners.end()) {
      FramePair pair{std::move(found.frame), std::move(partner->frame)};
      if (side == 1) std::swap(pair.left, pair.right);
      partners.erase(partner);
      ++counts_.pairs;
      return pair;
    }
    auto& own = waiting_[side];
    counts_.unmatched[side] += own.remove_if(has_key);  // written anew
    own.push_back(std::move(found));
    if (own.size() > kMaxWaiting) {
      own.pop_front();
      ++counts_.unmatched[side];
    }
    return std::nullopt;
  }

  double period_s_;
  std::array<WatchedSide, 2> sides_;
  std::mutex mutex_;  ///< of the two below
  std::array<std::list<WatchedSide::Found>, 2> waiting_;
  FramePairingCounts counts_;
  std::optional<detail::Poller> poller_;  ///< last: it ends before what it uses
};

}  // namespace

base::Result<> WatchFolderOptions::validate() const {
  if (auto valid = files.validate(); !valid) return valid;
  if (!(period_s > 0.0) || period_s > 60.0) {
    return base::fail(ErrorCode::kUsage, fmt::format("watch folder: looks every {} s; above 0 and up to 60 s", period_s));
  }
  return {};
}

base::Result<std::unique_ptr<CameraDevice>> watch_folder_camera(WatchFolderOptions options, Clock clock) {
  if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
  return std::make_unique<WatchFolderCamera>(std::move(options), clock);
}

base::Result<std::unique_ptr<PairSource>> watch_folder_pair(WatchFolderOptions left, WatchFolderOptions right, Clock clock) {
  for (const WatchFolderOptions& options : {left, right}) {
    if (auto valid = options.validate(); !valid) return base::fail(std::move(valid));
    if (options.files.pattern.filename().string().find('*') == std::string::npos) {
      return base::fail(ErrorCode::kUsage,
                        fmt::format("watch folder: \"{}\" needs a * by which left and right files belong together",
                                    base::shown(options.files.pattern)));
    }
  }
  return std::make_unique<WatchFolderPair>(left, right, clock);
}

}  // namespace crosstie::devices
