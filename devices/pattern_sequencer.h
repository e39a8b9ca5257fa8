#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/image.h"
#include "base/pattern_sequence.h"
#include "base/result.h"

namespace crosstie::devices {

enum class SequencerPhase {
  kEmpty,     ///< nothing uploaded
  kUploaded,  ///< patterns are in the projector
  kArmed,     ///< the next step() shows the first pattern
  kShowing,   ///< a pattern is shown
  kFinished,  ///< the last one is shown
};

[[nodiscard]] std::string_view sequencer_phase_name(SequencerPhase phase);

struct SequencerStatus {
  SequencerPhase phase = SequencerPhase::kEmpty;
  std::size_t patterns = 0;  ///< uploaded
  std::size_t shown = 0;     ///< since arm(); the pattern shown now is shown - 1
  std::string trouble = {};  ///< what the projector said last, where it failed
};

/// Makes a projector show a sequence, one pattern for each exposure of the cameras:
///   upload() once, then for each capture arm() and step() until the phase is kFinished.
///
/// The order is kept for all projectors here; each kind says how patterns are stored and shown. Every call may come from any thread, one
/// at a time is at work.
class PatternSequencer {
 public:
  virtual ~PatternSequencer() = default;

  /// Takes the patterns and the image of each (scan::render_pattern): 8 bits and of the projector's size, in the sequence's order.
  /// Errors: kBadInput for a sequence or images that contradict each other, else the projector's; then nothing is uploaded.
  base::Result<> upload(const base::PatternSequence& sequence, std::vector<base::Image> images);
  /// Back to before the first pattern. Error kUsage where nothing is uploaded.
  base::Result<> arm();
  /// Shows the next pattern; returns its index. Error kUsage where it is not armed or the last one is shown already; the projector's error
  /// leaves the sequence where it was, so that step() may be tried again.
  base::Result<std::size_t> step();
  [[nodiscard]] SequencerStatus status();

 protected:
  virtual base::Result<> store(const base::PatternSequence& sequence, const std::vector<base::Image>& images) = 0;
  virtual base::Result<> show(std::size_t index, const base::Pattern& pattern, const base::Image& image) = 0;

 private:
  std::mutex mutex_;  ///< of all below
  base::PatternSequence sequence_;
  std::vector<base::Image> images_;
  SequencerStatus status_;
};

/// For projectors with software of their own: upload() writes the images under the sequence's file names and the manifest `patterns.json` into a
/// folder (made where it is missing), and step() keeps the count of what that software shows.
class FileSequencer : public PatternSequencer {
 public:
  explicit FileSequencer(std::filesystem::path folder) : folder_(std::move(folder)) {}

 protected:
  base::Result<> store(const base::PatternSequence& sequence, const std::vector<base::Image>& images) override;
  base::Result<> show(std::size_t, const base::Pattern&, const base::Image&) override { return {}; }

 private:
  std::filesystem::path folder_;
};

/// What a simulated projector throws onto the twin's scene. Its error is the projector's.
using ShowPattern = std::function<base::Result<>(std::size_t index, const base::Pattern& pattern, const base::Image& image)>;

/// A projector whose light is computed: the digital twin's.
class SimulatedSequencer : public PatternSequencer {
 public:
  explicit SimulatedSequencer(ShowPattern show_pattern) : show_pattern_(std::move(show_pattern)) {}

 protected:
  base::Result<> store(const base::PatternSequence&, const std::vector<base::Image>&) override { return {}; }
  base::Result<> show(std::size_t index, const base::Pattern& pattern, const base::Image& image) override {
    return show_pattern_(index, pattern, image);
  }

 private:
  ShowPattern show_pattern_;
};

}  // namespace crosstie::devices
