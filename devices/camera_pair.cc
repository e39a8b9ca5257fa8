#include "devices/camera_pair.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include <fmt/format.h>

namespace crosstie::devices {
namespace {

using base::ErrorCode;

constexpr std::size_t kMaxWaiting = 4;       // frames of one side without a partner
constexpr std::size_t kRememberedPairs = 9;  // whose clocks are compared
constexpr int kContradictionsForANewBegin = 3;

double median(std::deque<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

base::Result<> FramePairingOptions::validate() const {
  if (!(max_host_skew_s > 0.0) || !(max_device_skew_s > 0.0) || !std::isfinite(max_host_skew_s + max_device_skew_s)) {
    return base::fail(ErrorCode::kUsage,
                      fmt::format("pairs: skews of {} s (host) and {} s (device) must be positive and finite", max_host_skew_s,
                                  max_device_skew_s));
  }
  return {};
}

std::optional<FramePair> FramePairing::add(Side side, Frame frame) {
  const auto own = static_cast<std::size_t>(side);
  auto& partners = waiting_[1 - own];
  while (!partners.empty()) {
    const double skew_s = seconds_between(partners.front().header.host_time, frame.header.host_time);
    if (skew_s < -options_.max_host_skew_s) break;
    Frame partner = std::move(partners.front());
    partners.pop_front();
    if (skew_s > options_.max_host_skew_s) {
      ++counts_.unmatched[1 - own];
      continue;
    }
    // What waits on this side is older than both and has lost its partner.
    counts_.unmatched[own] += waiting_[own].size();
    waiting_[own].clear();
    FramePair pair =
        side == Side::kLeft ? FramePair{std::move(frame), std::move(partner)} : FramePair{std::move(partner), std::move(frame)};
    if (!agrees(pair)) return std::nullopt;
    ++counts_.pairs;
    return pair;
  }
  waiting_[own].push_back(std::move(frame));
  if (waiting_[own].size() > kMaxWaiting) {
    waiting_[own].pop_front();
    ++counts_.unmatched[own];
  }
  return std::nullopt;
}

bool FramePairing::agrees(const FramePair& pair) {
  const auto left = pair.left.header.device_time, right = pair.right.header.device_time;
  if (left.count() == 0 || right.count() == 0) return true;
  const double difference_s = std::chrono::duration<double>(left - right).count();
  if (!device_differences_s_.empty() && std::abs(difference_s - median(device_differences_s_)) > options_.max_device_skew_s) {
    ++counts_.contradicted;
    if (++contradictions_in_a_row_ < kContradictionsForANewBegin) return false;
    device_differences_s_.clear();
  }
  contradictions_in_a_row_ = 0;
  if (device_differences_s_.size() == kRememberedPairs) device_differences_s_.pop_front();
  device_differences_s_.push_back(difference_s);
  return true;
}

CameraPair::CameraPair(CameraDevice& left, CameraDevice& right, const FramePairingOptions& options)
    : cameras_{&left, &right}, options_(options) {}

CameraPair::~CameraPair() { stop(); }

base::Result<CameraSettings> CameraPair::start(const CameraSettings& settings, PairSink sink) {
  if (auto valid = options_.validate(); !valid) return base::fail(std::move(valid));
  {
    const std::lock_guard lock(mutex_);
    pairing_ = FramePairing(options_);
    sink_ = std::move(sink);
  }
  std::vector<CameraSettings> taken;
  for (const Side side : {Side::kLeft, Side::kRight}) {
    auto started = cameras_[static_cast<std::size_t>(side)]->start(
        settings, [this, side](base::Result<Frame> frame) { take(side, std::move(frame)); });
    if (!started) {
      stop();
      return base::fail(std::move(started));
    }
    taken.push_back(*started);
  }
  if (taken[0].exposure_s != taken[1].exposure_s || taken[0].gain != taken[1].gain) {
    stop();
    return base::fail(ErrorCode::kDevice,
                      fmt::format("the cameras took different settings: exposures of {} and {} s, gains of {} and {}",
                                  taken[0].exposure_s, taken[1].exposure_s, taken[0].gain, taken[1].gain));
  }
  return taken[0];
}

void CameraPair::stop() {
  for (CameraDevice* camera : cameras_) camera->stop();
  const std::lock_guard lock(mutex_);
  sink_ = nullptr;
}

base::Result<> CameraPair::trigger() {
  for (CameraDevice* camera : cameras_) {
    if (auto triggered = camera->trigger(); !triggered) return triggered;
  }
  return {};
}

std::array<CameraState, 2> CameraPair::states() { return {cameras_[0]->state(), cameras_[1]->state()}; }

FramePairingCounts CameraPair::counts() {
  const std::lock_guard lock(mutex_);
  return pairing_.counts();
}

void CameraPair::take(Side side, base::Result<Frame> frame) {
  const std::lock_guard lock(mutex_);
  if (!sink_) return;
  if (!frame) {
    std::exchange(sink_, nullptr)(base::fail(std::move(frame)));
    return;
  }
  if (auto pair = pairing_.add(side, *std::move(frame))) sink_(*std::move(pair));
}

}  // namespace crosstie::devices
