#include "app/live/live_watch.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/core.h>

#include "app/live/machine_tie.h"

namespace crosstie::app {
namespace {

using base::Result;

constexpr std::array<const char*, 2> kSides = {"left", "right"};
constexpr double kTemperaturePeriod_s = 5.0;
constexpr int kMarkersOfAStation = 6;       // that both cameras see: four tell a pose, and two of them may be wrong
constexpr std::size_t kTemperatures = 240;  // twenty minutes

std::array<live::PreviewOptions, 2> preview_options(const std::optional<MarkerChoice>& markers) {
  live::PreviewOptions options;
  if (markers) {
    options.family = markers->family;
    options.detect = markers->options;
  }
  return {options, options};
}

int count(const base::ImageObservations& seen, base::ObservationStatus status) {
  return static_cast<int>(std::count_if(seen.observations.begin(), seen.observations.end(),
                                        [&](const base::Observation& one) { return one.status == status; }));
}

Eigen::Vector3d sigmas_of(const Eigen::Matrix3d& cov) { return cov.diagonal().cwiseMax(0.0).cwiseSqrt(); }

}  // namespace

LiveWatch::LiveWatch(TappedPairs& pairs, live::Feed& feed, const std::optional<MarkerChoice>& markers)
    : loop_(std::make_unique<live::PreviewLoop>(
          pairs, feed, [this](Result<live::PreviewPair> pair) { take(std::move(pair)); }, preview_options(markers))) {}

Result<> LiveWatch::start(const devices::CameraSettings& settings) {
  auto took = loop_->start(settings);
  const std::lock_guard lock(mutex_);
  trouble_ = took ? std::string() : took.error().message;
  if (took) settings_ = *took;
  return took ? Result<>() : base::fail(std::move(took));
}

std::string LiveWatch::trouble() const {
  const std::lock_guard lock(mutex_);
  return trouble_;
}

void LiveWatch::set_place(const std::shared_ptr<const KnownHead>& head, const Result<devices::AxisReading>& axis) {
  const std::optional<double> axis_mm = axis ? std::optional(axis->position_mm) : std::nullopt;
  {
    const std::lock_guard lock(mutex_);
    if (place_->head == head && place_->axis_mm == axis_mm) return;
  }
  auto place = std::make_shared<Place>(Place{.head = head, .axis_mm = axis_mm, .tie = {}});
  if (head->commissioning && axis_mm) {
    if (auto tie = machine_tie(*head->commissioning, *axis_mm)) place->tie = *std::move(tie);
  }
  const std::lock_guard lock(mutex_);
  place_ = std::move(place);
}

void LiveWatch::take(Result<live::PreviewPair> pair) {
  std::shared_ptr<const Place> place;
  {
    const std::lock_guard lock(mutex_);
    if (!pair) {
      trouble_ = pair.error().message;
      markers_.clear();
      return;
    }
    place = place_;
  }
  std::vector<live::SpatialMarker> markers;
  // Without a head every marker is told of, too: by locate_markers with none, it would have no place.
  if (place->head->head) {
    auto located =
        live::locate_markers(*place->head->head, pair->pictures[0].observations, pair->pictures[1].observations, place->tie);
    if (located) markers = *std::move(located);
  }
  const std::lock_guard lock(mutex_);
  for (const std::size_t side : {std::size_t{0}, std::size_t{1}}) {
    pair->pictures[side].jpeg.clear();
    pictures_[side] = std::move(pair->pictures[side]);
  }
  markers_ = std::move(markers);
  frame_ = !place->head->head ? "" : place->tie ? "machine" : "rig";
}

/// Call with the mutex held.
CameraStatus LiveWatch::camera_status(std::size_t side, const live::PreviewCamera& camera) {
  CameraStatus status{
      .side = kSides[side], .name = camera.camera.name, .running = camera.camera.running, .trouble = camera.camera.trouble};
  if (status.trouble.empty() && !camera.camera.running) status.trouble = trouble_;
  status.frames = camera.camera.frames;
  status.dropped = camera.dropped;
  status.lost = camera.lost;
  status.swapped = camera.swapped;
  status.incomplete = camera.camera.incomplete;
  status.rate_hz = camera.rate_hz;
  if (camera.shown > 0) status.latency_ms = camera.latency_ms;
  status.exposure_s = settings_.exposure_s;
  status.gain = settings_.gain;
  std::deque<live::TemperatureReading>& temperatures = temperatures_[side];
  if (camera.camera.temperature_c) {
    const devices::HostTime now = devices::host_now();
    if (temperatures.empty() || devices::seconds_between(temperatures.back().time, now) > kTemperaturePeriod_s) {
      temperatures.push_back({now, *camera.camera.temperature_c});
      if (temperatures.size() > kTemperatures) temperatures.pop_front();
    }
    status.temperature_c = camera.camera.temperature_c;
    const std::vector<live::TemperatureReading> readings(temperatures.begin(), temperatures.end());
    if (const auto judged = live::judge_warm_up(readings)) status.warming = judged->warming;
  }
  if (const auto& picture = pictures_[side]) {
    status.width_px = picture->width_px;
    status.height_px = picture->height_px;
    status.histogram = picture->histogram;
    status.saturated = picture->saturated;
    status.dark = picture->dark;
    status.focus = picture->focus;
    status.blur_px = picture->blur_px;
    status.coded = count(picture->observations, base::ObservationStatus::kCoded);
    status.uncoded = count(picture->observations, base::ObservationStatus::kUncoded);
    status.doubtful = static_cast<int>(picture->observations.observations.size()) - status.coded - status.uncoded;
  }
  return status;
}

/// Call with the mutex held.
void LiveWatch::describe_markers(LiveStatus& status) const {
  status.frame = frame_;
  for (const live::SpatialMarker& marker : markers_) {
    MarkerStatus shown{.id = marker.id, .doubtful = marker.doubtful, .left = marker.left, .right = marker.right};
    shown.xyz_mm = marker.xyz_mm;
    if (marker.xyz_mm) shown.sigma_mm = sigmas_of(marker.cov_mm2());
    shown.w = marker.w();
    status.markers.push_back(std::move(shown));
  }
  if (status.stage != LiveStage::kCommission || frame_.empty()) return;
  const auto seen_by_both = [&](int id) {
    return std::any_of(markers_.begin(), markers_.end(), [&](const live::SpatialMarker& marker) {
      return marker.id == id && !marker.doubtful && marker.left && marker.right;
    });
  };
  NeededMarkers needed{.want = kMarkersOfAStation};
  for (const live::SpatialMarker& marker : markers_) needed.seen += seen_by_both(marker.id) ? 1 : 0;
  if (needed.seen < needed.want && place_->tie) {
    for (const live::KnownPoint& known : place_->tie->known) {
      if (!seen_by_both(known.id)) needed.missing.push_back(known.id);
    }
  }
  status.needed = std::move(needed);
}

void LiveWatch::describe(LiveStatus& status) {
  const live::PreviewStatistics statistics = loop_->statistics();
  const std::lock_guard lock(mutex_);
  for (const std::size_t side : {std::size_t{0}, std::size_t{1}})
    status.cameras[side] = camera_status(side, statistics.cameras[side]);
  status.pairs = statistics.pairs.pairs;
  status.unmatched = statistics.pairs.unmatched[0] + statistics.pairs.unmatched[1];
  status.contradicted = statistics.pairs.contradicted;
  describe_markers(status);
}

std::optional<base::Pose> LiveWatch::machine_from_rig() const {
  const std::lock_guard lock(mutex_);
  return place_->tie ? std::optional(place_->tie->machine_from_rig) : std::nullopt;
}

bool LiveWatch::markers_moved() const {
  constexpr double kMoved = 4.0;  // sigmas of both places in a coordinate
  const std::lock_guard lock(mutex_);
  return !std::equal(markers_.begin(), markers_.end(), shown_.begin(), shown_.end(), [&](const auto& a, const auto& b) {
    if (a.id != b.id || a.xyz_mm.has_value() != b.xyz_mm.has_value()) return false;
    if (!a.xyz_mm) return true;
    const Eigen::Vector3d sigma = sigmas_of(a.image_cov_mm2 + b.image_cov_mm2);
    return ((*a.xyz_mm - *b.xyz_mm).cwiseAbs().array() <= kMoved * sigma.array()).all();
  });
}

void LiveWatch::markers_shown() {
  const std::lock_guard lock(mutex_);
  shown_ = markers_;
}

}  // namespace crosstie::app
