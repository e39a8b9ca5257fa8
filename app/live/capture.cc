#include "app/live/capture.h"

#include <array>
#include <cstddef>
#include <deque>
#include <future>
#include <memory>
#include <system_error>
#include <utility>

#include <fmt/core.h>

#include "base/file.h"
#include "base/image.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Progress;
using base::Result;
using devices::CameraSettings;
using devices::FramePair;

constexpr std::array<std::size_t, 2> kSides = {0, 1};

/// Pairs on their way to the disk while the next ones are exposed; few of them, since images are large.
class PairWriter {
 public:
  Result<> write(FramePair pair, PairOfFiles files) {
    if (waiting_.size() >= kMostAtOnce) {
      if (auto written = finish_one(); !written) return written;
    }
    auto shared = std::make_shared<FramePair>(std::move(pair));
    for (const std::size_t side : kSides) {
      waiting_.push_back(std::async(std::launch::async, [shared, side, file = files[side]] {
        return base::write_image(file, (side == 0 ? shared->left : shared->right).image.view());
      }));
    }
    return {};
  }
  Result<> finish() {
    Result<> outcome;
    while (!waiting_.empty()) {
      if (auto written = finish_one(); !written && outcome) outcome = std::move(written);
    }
    return outcome;
  }

 private:
  static constexpr std::size_t kMostAtOnce = 6;

  Result<> finish_one() {
    auto written = waiting_.front().get();
    waiting_.pop_front();
    return written;
  }

  std::deque<std::future<Result<>>> waiting_;
};

/// Puts the cameras back to the preview, whatever happened.
class BackToPreview {
 public:
  explicit BackToPreview(TappedPairs& pairs) : pairs_(&pairs) {}
  BackToPreview(const BackToPreview&) = delete;
  BackToPreview& operator=(const BackToPreview&) = delete;
  ~BackToPreview() { (void)pairs_->preview(); }  // a camera that is lost tells so through its sink

 private:
  TappedPairs* pairs_;
};

/// Staged paths that are free, in a folder that exists; what an attempt before left there is removed.
Result<PairOfFiles> cleared(const PairOfFiles& places) {
  PairOfFiles files = staged(places);
  for (const fs::path& file : files) {
    std::error_code failed;
    fs::remove_all(file, failed);
    if (failed)
      return base::fail(ErrorCode::kFileSystem, fmt::format("cannot remove {}: {}", base::shown(file), failed.message()));
    if (auto made = base::make_folder(file.parent_path()); !made) return base::fail(std::move(made));
  }
  return files;
}

Result<> expose_all(TappedPairs& pairs, devices::PatternSequencer& projector, const base::PatternSequence& sequence,
                    const CaptureOptions& options, const PairOfFiles& staging, const Progress& progress) {
  if (auto armed = projector.arm(); !armed) return armed;
  PairWriter writer;
  double exposure = 0.0;  // relative, of the pattern before
  for (std::size_t i = 0; i < sequence.patterns.size(); ++i) {
    const base::Pattern& pattern = sequence.patterns[i];
    if (pattern.exposure != exposure) {
      CameraSettings settings = options.settings;
      settings.exposure_s *= pattern.exposure;
      if (auto set = pairs.measure(settings); !set) return set;
      exposure = pattern.exposure;
    }
    const devices::HostTime before = devices::host_now();
    if (auto shown = projector.step(); !shown) return base::fail(std::move(shown));
    auto pair = pairs.take(before, options.timeout_s + options.settings.exposure_s * pattern.exposure, progress);
    if (!pair) {
      return base::fail(pair.error().code,
                        fmt::format("pattern {} of {}: {}", i + 1, sequence.patterns.size(), pair.error().message));
    }
    auto written = writer.write(*std::move(pair), {staging[0] / pattern.files[0], staging[1] / pattern.files[1]});
    if (!written) return written;
    progress("photograph", i + 1, sequence.patterns.size());
  }
  return writer.finish();
}

}  // namespace

PairOfFiles staged(const PairOfFiles& places) {
  PairOfFiles files;
  for (const std::size_t side : kSides) files[side] = places[side].parent_path() / ".taking" / places[side].filename();
  return files;
}

Result<> take_pair(TappedPairs& pairs, const CaptureOptions& options, const PairOfFiles& places, const Progress& progress) {
  const auto files = cleared(places);
  if (!files) return tl::unexpected(files.error());
  const BackToPreview afterwards(pairs);
  if (auto set = pairs.measure(options.settings); !set) return set;
  auto pair = pairs.take(devices::host_now(), options.timeout_s + options.settings.exposure_s, progress);
  if (!pair) return base::fail(std::move(pair));
  PairWriter writer;
  if (auto written = writer.write(*std::move(pair), *files); !written) return written;
  return writer.finish();
}

Result<> take_sequence(TappedPairs& pairs, devices::PatternSequencer& projector, const base::PatternSequence& sequence,
                       const CaptureOptions& options, const PairOfFiles& places, const Progress& progress) {
  const auto folders = cleared(places);
  if (!folders) return tl::unexpected(folders.error());
  for (const fs::path& folder : *folders) {
    if (auto made = base::make_folder(folder); !made) return made;
  }
  const BackToPreview afterwards(pairs);
  return expose_all(pairs, projector, sequence, options, *folders, progress);
}

Result<> place(const PairOfFiles& places) {
  const PairOfFiles files = staged(places);
  const auto cannot = [&](std::size_t side, const std::error_code& why) {
    return base::fail(ErrorCode::kFileSystem, fmt::format("cannot put {} to {}: {}", base::shown(files[side]),
                                                          base::shown(places[side]), why.message()));
  };
  // Both are looked at before one of them is moved.
  for (const std::size_t side : kSides) {
    std::error_code none;
    if (!fs::exists(files[side], none)) return cannot(side, std::make_error_code(std::errc::no_such_file_or_directory));
    if (fs::is_directory(places[side], none)) fs::remove(places[side], none);  // an empty one
    if (fs::exists(places[side], none)) return cannot(side, std::make_error_code(std::errc::file_exists));
  }
  for (const std::size_t side : kSides) {
    std::error_code failed;
    fs::rename(files[side], places[side], failed);
    if (failed) return cannot(side, failed);
  }
  std::error_code none;
  for (const fs::path& file : files) fs::remove(file.parent_path(), none);  // where nothing else is being taken
  return {};
}

}  // namespace crosstie::app
