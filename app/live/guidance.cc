#include "app/live/guidance.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

namespace crosstie::app {
namespace {

bool is_scanned(const Situation& now, const std::string& station) {
  return std::find(now.scanned.begin(), now.scanned.end(), station) != now.scanned.end();
}

bool wanted(LiveStage stage, const StationShots& station) {
  return stage == LiveStage::kCommission ? station.wants_cross : station.wants_scan;
}

bool taken(LiveStage stage, const StationShots& station) {
  return stage == LiveStage::kCommission ? station.cross_taken : station.scan_taken;
}

const StationShots* find(const std::vector<StationShots>& stations, LiveStage stage, const std::string& name) {
  const auto found = std::find_if(stations.begin(), stations.end(),
                                  [&](const StationShots& one) { return wanted(stage, one) && one.name == name; });
  return found == stations.end() ? nullptr : &*found;
}

/// The chosen station, else the first that lacks what the stage takes.
const StationShots* next_station(const Situation& now) {
  if (const StationShots* chosen = find(*now.stations, now.stage, now.selected)) return chosen;
  const auto found = std::find_if(now.stations->begin(), now.stations->end(),
                                  [&](const StationShots& one) { return wanted(now.stage, one) && !taken(now.stage, one); });
  return found == now.stations->end() ? nullptr : &*found;
}

/// Why the beam does not stand where this station is; empty: it does.
std::string off_station(const Situation& now, const StationShots& station) {
  if (!now.axis) return now.axis.error().message;
  const double off_mm = now.axis->position_mm - station.axis_mm;
  const bool other_shot_there = now.stage == LiveStage::kCommission ? station.scan_taken : station.cross_taken;
  if (other_shot_there && std::abs(off_mm) > same_stop_mm(now.axis_sigma_mm)) {
    return fmt::format("the beam stands at X = {:.3f} mm, {:.3f} mm from where station {} was photographed already ({:.3f} mm)",
                       now.axis->position_mm, std::abs(off_mm), station.name, station.axis_mm);
  }
  if (std::abs(off_mm) <= kStationReach_mm) return {};
  return fmt::format("the beam stands at X = {:.1f} mm, station {} is at {:.1f} mm", now.axis->position_mm, station.name,
                     station.axis_mm);
}

/// What keeps any picture from being taken; empty: nothing.
std::string no_picture(const Situation& now) {
  if (!now.taking.empty()) return fmt::format("{} is being taken", now.taking);
  return now.cameras_trouble;
}

std::string no_shot(const Situation& now, const StationShots& station) {
  if (now.stage == LiveStage::kScan) {
    if (!now.has_projector) return "there is no projector";
    if (!now.calibrated) return "the cameras are not calibrated yet";
    if (now.needs_commissioning && !now.commissioned) return "the machine is not commissioned yet";
  }
  if (std::string trouble = no_picture(now); !trouble.empty()) return trouble;
  return off_station(now, station);
}

std::string no_change(const Situation& now, const std::string& what) {
  if (!now.taking.empty()) return fmt::format("{} is being taken", now.taking);
  if (!now.computing.empty()) return fmt::format("{} is being computed; wait, or cancel it", now.computing);
  return now.last.empty() ? fmt::format("nothing was taken yet that could be {}", what) : std::string();
}

std::string no_finish(const Situation& now, const Guidance& guidance) {
  if (!now.taking.empty()) return fmt::format("{} is being taken", now.taking);
  if (!now.computing.empty()) return fmt::format("{} is being computed", now.computing);
  if (now.stage == LiveStage::kCalibrate)
    return guidance.have >= kLeastPoses ? std::string() : fmt::format("{} pairs of the board are too few", guidance.have);
  if (now.stage == LiveStage::kCommission && !now.calibrated) return "the cameras are not calibrated yet";
  if (now.stage == LiveStage::kScan && now.needs_commissioning && !now.commissioned)
    return "the machine is not commissioned yet";
  if (guidance.want == 0) return "the job has no station for this";
  const int left = guidance.want - guidance.have;
  return left == 0 ? std::string() : fmt::format("{} of {} stations {} missing", left, guidance.want, left == 1 ? "is" : "are");
}

std::string no_check(const Situation& now) {
  if (!now.commissioned) return "the machine is not commissioned yet";
  if (!now.computing.empty()) return fmt::format("{} is being computed", now.computing);
  if (std::string trouble = no_picture(now); !trouble.empty()) return trouble;
  return now.axis ? std::string() : now.axis.error().message;
}

std::string sentence(std::string words) {
  if (!words.empty() && words[0] >= 'a' && words[0] <= 'z') words[0] = static_cast<char>(words[0] - 'a' + 'A');
  return words + ".";
}

void guide_board(const Situation& now, Guidance& guidance, std::string& next) {
  if (!now.board) {
    guidance.instruction = next = now.board.error().message;
    return;
  }
  guidance.have = static_cast<int>(now.board->taken.size());
  guidance.want = kWantedPoses;
  next = no_picture(now);
  if (now.wanted_pose.empty() && guidance.have >= kWantedPoses) {
    guidance.instruction =
        now.calibrated ? "The cameras are calibrated. Go on with the machine." : "Enough. Press Finish to calibrate.";
  } else {
    guidance.instruction =
        fmt::format("{} Hold it still and press Next.",
                    now.wanted_pose.empty() ? "Hold the board before both cameras, tilted as never before." : now.wanted_pose);
  }
}

std::string all_photographed(const Situation& now) {
  return now.commissioned ? "The machine is commissioned. Go on with the hole."
                          : "All stations are taken. Press Finish to commission the machine.";
}

std::string all_scanned(const Situation& now) {
  return now.measured ? "The hole is measured: its report shows edge and path."
                      : "All stations are taken. Press Finish for the hole's edge and the torch's path.";
}

void guide_station(const Situation& now, Guidance& guidance, std::string& next) {
  if (!now.stations) {
    guidance.instruction = next = now.stations.error().message;
    return;
  }
  for (const StationShots& one : *now.stations) {
    if (!wanted(now.stage, one)) continue;
    ++guidance.want;
    if (taken(now.stage, one)) ++guidance.have;
  }
  const bool commission = now.stage == LiveStage::kCommission;
  const StationShots* station = next_station(now);
  if (station == nullptr) {
    next = guidance.want == 0 ? "the job has no station for this" : "all stations are taken; choose one to take it again";
    guidance.instruction = guidance.want == 0
                               ? fmt::format("The job has no station {}.", commission ? "with a cross" : "to scan")
                           : commission ? all_photographed(now)
                                        : all_scanned(now);
    return;
  }
  guidance.station = *station;
  next = no_shot(now, *station);
  if (next.empty()) {
    guidance.instruction =
        fmt::format("Station {}: {} Press Next.", station->name,
                    commission ? "do both cameras see the cross, and does it stand still?" : "does everything stand still?");
  } else if (!now.taking.empty()) {
    guidance.instruction = fmt::format("Do not move: {} is being taken.", now.taking);
  } else if (next == off_station(now, *station)) {
    guidance.instruction = fmt::format("Move the beam to X = {:.1f} mm for station {}.", station->axis_mm, station->name);
  } else {
    guidance.instruction = sentence(next);
  }
  if (!commission && is_scanned(now, station->name)) guidance.instruction += " It is scanned already.";
}

}  // namespace

double same_stop_mm(double axis_sigma_mm) {
  // The difference of two readings has sqrt(2) of their sigma; 4.5 sigma are never passed by chance.
  return std::max(0.02, 4.5 * std::sqrt(2.0) * axis_sigma_mm);
}

const std::string& Guidance::why_not(const std::string& command) const {
  static const std::string unknown = "there is no such command";
  const auto found =
      std::find_if(permissions.begin(), permissions.end(), [&](const Permission& one) { return one.command == command; });
  return found == permissions.end() ? unknown : found->why_not;
}

Guidance guide(const Situation& now) {
  Guidance guidance;
  std::string next;
  if (now.stage == LiveStage::kCalibrate) {
    guide_board(now, guidance, next);
  } else {
    guide_station(now, guidance, next);
  }
  std::string repeat = no_change(now, "repeated");
  if (repeat.empty()) repeat = now.cameras_trouble;
  if (repeat.empty() && now.stage != LiveStage::kCalibrate && now.stations) {
    if (const StationShots* last = find(*now.stations, now.stage, now.last_station)) repeat = no_shot(now, *last);
  }
  const bool idle = now.taking.empty() && now.computing.empty();
  guidance.permissions = {{"next", next},
                          {"repeat", repeat},
                          {"undo", no_change(now, "undone")},
                          {"finish", no_finish(now, guidance)},
                          {"cancel", idle ? "nothing is running" : ""},
                          {"check", no_check(now)}};
  return guidance;
}

}  // namespace crosstie::app
