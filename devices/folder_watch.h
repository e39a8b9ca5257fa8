#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "base/image.h"
#include "base/result.h"
#include "devices/host_time.h"

namespace crosstie::devices {

struct FolderWatchOptions {
  /// Folder and name, `left/shot_*.png`: the one asterisk stands for any text, by which left and right belong together. Without
  /// an asterisk it is one file that is written again and again. The folder need not exist yet.
  std::filesystem::path pattern;
  /// A file is complete when its size and time have not changed for so long and it decodes. Default: many times the pause between two
  /// writes of a program that saves an image; over a slow network it needs more.
  double rest_s = 0.3;
  bool take_existing = false;  ///< true: files that are there at the first look are images, too; false: they are of another day

  [[nodiscard]] base::Result<> validate() const;
};

/// An image that another program wrote.
struct WatchedImage {
  std::filesystem::path path;          ///< when it was read; it may be gone by now
  std::string key;                     ///< the text that the asterisk stands for
  std::chrono::nanoseconds changed{};  ///< the file's time, since 1970
  base::Image image;
};

/// What one look found.
struct FolderLook {
  std::vector<WatchedImage> images;     ///< complete since the look before, by their files' times, then names
  std::vector<base::Warning> warnings;  ///< "unreadable_image": files that are complete and no images; told once
};

/// Watches a folder by looking into it.
///
/// An image is one file in one state (device, inode, size and time of change): a renamed file is no new image, a file that is written anew
/// is one. Files that vanish between two looks, or are changed while they are read, are left for the next look or forgotten. Never
/// waits; use from one thread at a time.
///
/// What is remembered is bounded by what the folder holds: an image whose file has been gone for kForget_s is forgotten. Not sooner, since a
/// listing may miss a file that is renamed meanwhile, and not while the folder itself is gone, since a share that comes back holds the
/// images of before.
class FolderWatch {
 public:
  explicit FolderWatch(FolderWatchOptions options, Clock clock = host_now);
  /// Error kFileSystem where the folder exists and cannot be listed.
  base::Result<FolderLook> look();

  static constexpr double kForget_s = 10.0;
  /// Files that are remembered.
  [[nodiscard]] std::size_t remembered() const { return done_.size() + at_rest_.size(); }

 private:
  /// Device, inode, size, seconds and nanoseconds of the change.
  using Identity = std::tuple<std::uint64_t, std::uint64_t, std::int64_t, std::int64_t, std::int64_t>;
  struct Candidate {
    std::filesystem::path path;
    std::string key;
    Identity identity;
  };

  struct Listing {
    bool there = false;  ///< the folder
    std::vector<Candidate> candidates;
  };

  [[nodiscard]] base::Result<Listing> list() const;
  void forget_vanished(HostTime now);
  [[nodiscard]] static std::optional<Identity> identify(const std::filesystem::path& path);
  [[nodiscard]] std::optional<std::string> key_of(const std::string& name) const;
  /// Whether the file has been dealt with: it is in `found`, as an image or a warning.
  [[nodiscard]] bool read(const Candidate& candidate, FolderLook& found);

  FolderWatchOptions options_;
  Clock clock_;
  std::filesystem::path folder_;
  std::string before_, after_;  ///< the asterisk
  bool any_ = false;            ///< there is one
  bool first_look_ = true;
  std::map<Identity, HostTime> done_;     ///< delivered or refused, and when the file was last there
  std::map<Identity, HostTime> at_rest_;  ///< since when a file has been as it is
};

}  // namespace crosstie::devices
