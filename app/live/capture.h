#pragma once

#include <filesystem>

#include "app/live/shots.h"
#include "app/live/tapped_pairs.h"
#include "base/pattern_sequence.h"
#include "base/progress.h"
#include "base/result.h"
#include "devices/pattern_sequencer.h"

namespace crosstie::app {

/// How measuring images are taken.
struct CaptureOptions {
  devices::CameraSettings settings = {};  ///< exposure of the shortest patterns, and the trigger
  double timeout_s = 5.0;                 ///< for one pair; default: a second of exposure and a slow network
};

/// Where images are written before all of them are there: in a folder `.taking` beside their place, where no pattern of the job finds
/// them.
[[nodiscard]] PairOfFiles staged(const PairOfFiles& places);

/// One pair as it is now, into the staged() PNG files of `places`. The cameras go back to the preview afterwards.
/// Errors: those of the cameras and files, kCancelled.
base::Result<> take_pair(TappedPairs& pairs, const CaptureOptions& options, const PairOfFiles& places,
                         const base::Progress& progress = {});

/// All images of a sequence whose patterns are uploaded, into the staged() folders of `places` under the sequence's names: each pattern is
/// shown, then exposed by both cameras, which go back to the preview afterwards.
/// Errors: those of the projector, the cameras and files, kCancelled.
base::Result<> take_sequence(TappedPairs& pairs, devices::PatternSequencer& projector, const base::PatternSequence& sequence,
                             const CaptureOptions& options, const PairOfFiles& places, const base::Progress& progress = {});

/// Puts what was taken into its place, which must be free. A kill between the two leaves one of a pair, which is none.
base::Result<> place(const PairOfFiles& places);

}  // namespace crosstie::app
