#pragma once

#include <memory>

#include "base/result.h"
#include "devices/camera_device.h"
#include "devices/camera_pair.h"
#include "devices/folder_watch.h"

namespace crosstie::devices {

struct WatchFolderOptions {
  FolderWatchOptions files = {};
  double period_s = 0.1;  ///< between two looks

  [[nodiscard]] base::Result<> validate() const;
};

/// The images that other capture software writes into a folder, as a camera (docs/devices.md). What that software sets is not known
/// here: start() takes free running only and hands the settings back; images come with the bits of their files. Ids count the images,
/// device times are the files' times, names their paths. A folder that cannot be read or a damaged image is told in `trouble` and
/// survived; damaged images count as incomplete. Error kUsage for options out of their domain.
base::Result<std::unique_ptr<CameraDevice>> watch_folder_camera(WatchFolderOptions options, Clock clock = host_now);

/// Pairs of a left and a right file whose asterisks stand for the same text; both patterns need one. Up to 16 files of each side wait for
/// their partners, those before are counted as unmatched, as is a file that is written anew before its partner came.
base::Result<std::unique_ptr<PairSource>> watch_folder_pair(WatchFolderOptions left, WatchFolderOptions right,
                                                            Clock clock = host_now);

}  // namespace crosstie::devices
