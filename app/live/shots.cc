#include "app/live/shots.h"

#include <algorithm>
#include <map>
#include <system_error>

#include <fmt/core.h>

#include "app/commission_input.h"
#include "app/image_files.h"
#include "base/file.h"
#include "base/pattern_sequence.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

bool is_there(const fs::path& path) {
  std::error_code none;
  return fs::exists(path, none);
}

bool is_file(const fs::path& path) {
  std::error_code none;
  return fs::is_regular_file(path, none);
}

/// A file pattern with one asterisk in the name.
struct Pattern {
  fs::path folder;
  std::string before, after;

  [[nodiscard]] fs::path with(const std::string& text) const { return folder / (before + text + after); }
};

Result<Pattern> board_pattern(const Job& job, const std::string& camera) {
  const auto found = job.cameras.find(camera);
  if (!job.board || found == job.cameras.end() || !found->second.board_images) {
    return base::fail(ErrorCode::kBadInput, fmt::format("{}: [board] and board_images of the camera {} are needed to calibrate",
                                                        job.file.string(), camera));
  }
  const fs::path pattern = job.resolve(*found->second.board_images);
  const std::string name = pattern.filename().string();
  const std::size_t star = name.find('*');
  if (star == std::string::npos || name.find_first_of("*?", star + 1) != std::string::npos ||
      pattern.parent_path().string().find_first_of("*?") != std::string::npos || pattern.extension() != ".png") {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("{}: board_images of {} must be a folder and a name such as *.png, with one "
                                  "asterisk, for images to be put there; it is '{}'",
                                  job.file.string(), camera, *found->second.board_images));
  }
  return Pattern{pattern.parent_path(), name.substr(0, star), name.substr(star + 1)};
}

/// What lies in the folder by what stands for the asterisk; nothing where the folder is not there yet.
std::map<std::string, fs::path> files_of(const Pattern& pattern) {
  std::map<std::string, fs::path> files;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(pattern.folder, none)) {
    const std::string name = entry.path().filename().string();
    if (name.size() < pattern.before.size() + pattern.after.size() || !name.starts_with(pattern.before) ||
        !name.ends_with(pattern.after)) {
      continue;
    }
    files.emplace(name.substr(pattern.before.size(), name.size() - pattern.before.size() - pattern.after.size()), entry.path());
  }
  return files;
}

bool all_taken(const fs::path& folder, const base::PatternSequence& sequence, std::size_t side) {
  return std::all_of(sequence.patterns.begin(), sequence.patterns.end(),
                     [&](const base::Pattern& pattern) { return is_there(folder / pattern.files[side]); });
}

}  // namespace

Result<BoardShots> board_shots(const Job& job) {
  const auto [left_name, right_name] = head_cameras(job);
  const auto left = board_pattern(job, left_name);
  if (!left) return tl::unexpected(left.error());
  const auto right = board_pattern(job, right_name);
  if (!right) return tl::unexpected(right.error());
  const auto lefts = files_of(*left);
  const auto rights = files_of(*right);
  BoardShots shots;
  for (const auto& [text, path] : lefts) {
    const auto other = rights.find(text);
    if (other != rights.end() && is_file(path) && is_file(other->second)) shots.taken.push_back({path, other->second});
  }
  for (int number = 1; shots.next[0].empty(); ++number) {
    const std::string text = fmt::format("{:02}", number);
    if (!lefts.contains(text) && !rights.contains(text)) shots.next = {left->with(text), right->with(text)};
  }
  return shots;
}

Result<std::vector<StationShots>> station_shots(const Job& job) {
  const auto [left, right] = head_cameras(job);
  std::vector<StationShots> stations;
  for (const JobStation& one : job.stations) {
    StationShots shots{.name = one.name, .axis_mm = one.axis_mm, .manifest = {}};
    if (!one.cross.empty()) {
      shots.wants_cross = true;
      for (const auto& [camera, path] : one.cross) {
        if (camera == left) shots.cross[0] = job.resolve(path);
        if (camera == right) shots.cross[1] = job.resolve(path);
      }
      if (shots.cross[0].empty() || shots.cross[1].empty()) {
        return base::fail(ErrorCode::kBadInput, fmt::format("{}: station {}: cross = {{ ... }} needs the cameras {} and {}",
                                                            job.file.string(), one.name, left, right));
      }
      shots.cross_taken = is_there(shots.cross[0]) && is_there(shots.cross[1]);
    }
    if (one.scan) {
      shots.wants_scan = true;
      shots.scan = {job.resolve(one.scan->left), job.resolve(one.scan->right)};
      shots.manifest = job.resolve(one.scan->manifest);
      const auto sequence = base::read_pattern_manifest(shots.manifest);
      if (!sequence) return tl::unexpected(sequence.error());
      shots.scan_taken = all_taken(shots.scan[0], *sequence, 0) && all_taken(shots.scan[1], *sequence, 1);
    }
    stations.push_back(std::move(shots));
  }
  return stations;
}

Result<fs::path> put_aside(const fs::path& job_folder, const std::vector<fs::path>& paths) {
  fs::path aside;
  for (int number = 1; aside.empty() || is_there(aside); ++number) aside = job_folder / "undone" / fmt::format("{:03}", number);
  // All are looked at before one of them is moved.
  std::vector<fs::path> inside;  // as the job's folder sees them
  for (const fs::path& path : paths) {
    inside.push_back(path.lexically_normal().lexically_relative(job_folder.lexically_normal()));
    if (inside.back().empty() || inside.back() == "." || *inside.back().begin() == "..") {
      return base::fail(ErrorCode::kUsage, fmt::format("{} is not in the job's folder {}; all stays where it is",
                                                       base::shown(path), base::shown(job_folder)));
    }
  }
  for (std::size_t i = 0; i < paths.size(); ++i) {
    const fs::path to = aside / inside[i];
    std::error_code failed;
    if (fs::is_directory(paths[i], failed)) fs::remove(paths[i], failed);  // an empty one
    if (!is_there(paths[i])) continue;
    if (auto made = base::make_folder(to.parent_path()); !made) return tl::unexpected(made.error());
    failed.clear();
    fs::rename(paths[i], to, failed);
    if (failed) {
      return base::fail(ErrorCode::kFileSystem,
                        fmt::format("cannot move {} to {}: {}", base::shown(paths[i]), base::shown(to), failed.message()));
    }
  }
  return aside;
}

}  // namespace crosstie::app
