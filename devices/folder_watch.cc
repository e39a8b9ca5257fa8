#include "devices/folder_watch.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <optional>
#include <system_error>
#include <utility>

#include <sys/stat.h>

#include <fmt/format.h>

#include "base/file.h"

namespace crosstie::devices {

namespace fs = std::filesystem;
using base::ErrorCode;

base::Result<> FolderWatchOptions::validate() const {
  const std::string name = pattern.filename().string();
  if (name.empty() || std::count(name.begin(), name.end(), '*') > 1 ||
      pattern.parent_path().string().find('*') != std::string::npos) {
    return base::fail(
        ErrorCode::kUsage,
        fmt::format("watch folder: \"{}\" must be a folder and a file's name with at most one *", base::shown(pattern)));
  }
  if (!std::isfinite(rest_s) || rest_s < 0.0) {
    return base::fail(ErrorCode::kUsage, fmt::format("watch folder: files at rest for {} s", rest_s));
  }
  return {};
}

FolderWatch::FolderWatch(FolderWatchOptions options, Clock clock)
    : options_(std::move(options)), clock_(std::move(clock)), folder_(options_.pattern.parent_path()) {
  if (folder_.empty()) folder_ = ".";
  const std::string name = options_.pattern.filename().string();
  const std::size_t asterisk = name.find('*');
  any_ = asterisk != std::string::npos;
  before_ = name.substr(0, asterisk);
  if (any_) after_ = name.substr(asterisk + 1);
}

base::Result<FolderLook> FolderWatch::look() {
  const auto listing = list();
  if (!listing) return tl::unexpected(listing.error());
  const HostTime now = clock_();
  const bool skip = std::exchange(first_look_, false) && !options_.take_existing;
  FolderLook found;
  std::map<Identity, HostTime> at_rest;
  for (const Candidate& candidate : listing->candidates) {
    const auto done = skip ? done_.emplace(candidate.identity, now).first : done_.find(candidate.identity);
    if (done != done_.end()) {
      done->second = now;
      continue;
    }
    const auto known = at_rest_.find(candidate.identity);
    const HostTime since = known == at_rest_.end() ? now : known->second;
    at_rest.emplace(candidate.identity, since);
    if (seconds_between(since, now) >= options_.rest_s && read(candidate, found)) {
      at_rest.erase(candidate.identity);
      done_.emplace(candidate.identity, now);
    }
  }
  at_rest_ = std::move(at_rest);
  if (listing->there) forget_vanished(now);
  return found;
}

void FolderWatch::forget_vanished(HostTime now) {
  std::erase_if(done_, [&](const auto& one) { return seconds_between(one.second, now) > kForget_s; });
}

base::Result<FolderWatch::Listing> FolderWatch::list() const {
  Listing listing;
  std::vector<Candidate>& candidates = listing.candidates;
  std::error_code error;
  fs::directory_iterator entry(folder_, error);
  listing.there = !error;
  for (; !error && entry != fs::directory_iterator(); entry.increment(error)) {
    const std::optional<std::string> key = key_of(entry->path().filename().string());
    if (!key) continue;
    if (const auto identity = identify(entry->path())) candidates.push_back({entry->path(), *key, *identity});
  }
  if (error && error != std::errc::no_such_file_or_directory) {
    return base::fail(ErrorCode::kFileSystem, fmt::format("watch folder {}: {}", base::shown(folder_), error.message()));
  }
  const auto time_of = [](const Candidate& one) { return std::pair(std::get<3>(one.identity), std::get<4>(one.identity)); };
  std::sort(candidates.begin(), candidates.end(), [&](const Candidate& a, const Candidate& b) {
    return std::pair(time_of(a), a.path) < std::pair(time_of(b), b.path);
  });
  return listing;
}

std::optional<FolderWatch::Identity> FolderWatch::identify(const fs::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode) || status.st_size == 0) return std::nullopt;
  return Identity{status.st_dev, status.st_ino, status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
}

std::optional<std::string> FolderWatch::key_of(const std::string& name) const {
  if (!any_) return name == before_ ? std::optional<std::string>("") : std::nullopt;
  if (name.front() == '.' && before_.empty()) return std::nullopt;  // hidden: what is being copied often is
  if (name.size() < before_.size() + after_.size() || !name.starts_with(before_) || !name.ends_with(after_))
    return std::nullopt;
  return name.substr(before_.size(), name.size() - before_.size() - after_.size());
}

bool FolderWatch::read(const Candidate& candidate, FolderLook& found) {
  auto image = base::read_image(candidate.path);
  // Renamed, removed or written again while it was read: not this image.
  if (identify(candidate.path) != candidate.identity) return false;
  if (!image) {
    found.warnings.push_back({"unreadable_image", base::shown(candidate.path), image.error().message});
    return true;
  }
  const auto changed =
      std::chrono::seconds(std::get<3>(candidate.identity)) + std::chrono::nanoseconds(std::get<4>(candidate.identity));
  found.images.push_back({candidate.path, candidate.key, changed, *std::move(image)});
  return true;
}

}  // namespace crosstie::devices
