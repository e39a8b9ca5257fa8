#include "devices/pattern_sequencer.h"

#include <set>
#include <utility>

#include <fmt/format.h>

#include "base/file.h"

namespace crosstie::devices {
namespace {

using base::ErrorCode;

base::Result<> fit(const base::PatternSequence& sequence, const std::vector<base::Image>& images) {
  if (auto valid = sequence.validate(); !valid) return valid;
  if (images.size() != sequence.patterns.size() || images.empty()) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("projector: {} images for {} patterns", images.size(), sequence.patterns.size()));
  }
  for (std::size_t i = 0; i < images.size(); ++i) {
    const base::Image& image = images[i];
    if (image.bits() != 8 || image.width() != sequence.width_px || image.height() != sequence.height_px) {
      return base::fail(ErrorCode::kBadInput,
                        fmt::format("projector: image {} has {} x {} px of {} bits; its projector has {} x {} px of 8 bits", i,
                                    image.width(), image.height(), image.bits(), sequence.width_px, sequence.height_px));
    }
  }
  return {};
}

/// Names come from a manifest, which may be anybody's: they stay within the folder.
base::Result<> check_names(const base::PatternSequence& sequence) {
  std::set<std::string> names;
  for (const base::Pattern& pattern : sequence.patterns) {
    const std::filesystem::path name = pattern.files[0];
    if (name.extension() != ".png" || name != name.filename() || !names.insert(pattern.files[0]).second) {
      return base::fail(
          ErrorCode::kBadInput,
          fmt::format("projector: \"{}\" must be the name of a .png of one pattern, without a folder", base::shown(name)));
    }
  }
  return {};
}

}  // namespace

std::string_view sequencer_phase_name(SequencerPhase phase) {
  switch (phase) {
    case SequencerPhase::kEmpty:
      return "empty";
    case SequencerPhase::kUploaded:
      return "uploaded";
    case SequencerPhase::kArmed:
      return "armed";
    case SequencerPhase::kShowing:
      return "showing";
    case SequencerPhase::kFinished:
      return "finished";
  }
  return "";
}

base::Result<> PatternSequencer::upload(const base::PatternSequence& sequence, std::vector<base::Image> images) {
  const std::lock_guard lock(mutex_);
  status_ = {};
  auto stored = fit(sequence, images);
  if (stored) stored = store(sequence, images);
  if (!stored) {
    status_.trouble = stored.error().message;
    return stored;
  }
  sequence_ = sequence;
  images_ = std::move(images);
  status_ = {.phase = SequencerPhase::kUploaded, .patterns = images_.size()};
  return {};
}

base::Result<> PatternSequencer::arm() {
  const std::lock_guard lock(mutex_);
  if (status_.phase == SequencerPhase::kEmpty) return base::fail(ErrorCode::kUsage, "projector: no patterns are uploaded");
  status_.phase = SequencerPhase::kArmed;
  status_.shown = 0;
  status_.trouble.clear();
  return {};
}

base::Result<std::size_t> PatternSequencer::step() {
  const std::lock_guard lock(mutex_);
  if (status_.phase != SequencerPhase::kArmed && status_.phase != SequencerPhase::kShowing) {
    return base::fail(ErrorCode::kUsage, fmt::format("projector: the sequence is {}, no next pattern; arm it",
                                                     sequencer_phase_name(status_.phase)));
  }
  const std::size_t index = status_.shown;
  if (auto shown = show(index, sequence_.patterns[index], images_[index]); !shown) {
    status_.trouble = shown.error().message;
    return base::fail(std::move(shown));
  }
  status_.trouble.clear();
  status_.shown = index + 1;
  status_.phase = status_.shown == status_.patterns ? SequencerPhase::kFinished : SequencerPhase::kShowing;
  return index;
}

SequencerStatus PatternSequencer::status() {
  const std::lock_guard lock(mutex_);
  return status_;
}

base::Result<> FileSequencer::store(const base::PatternSequence& sequence, const std::vector<base::Image>& images) {
  if (auto names = check_names(sequence); !names) return names;
  if (auto made = base::make_folder(folder_); !made) return made;
  for (std::size_t i = 0; i < images.size(); ++i) {
    if (auto written = base::write_image(folder_ / sequence.patterns[i].files[0], images[i].view()); !written) return written;
  }
  return base::write_pattern_manifest(folder_ / "patterns.json", sequence);
}

}  // namespace crosstie::devices
