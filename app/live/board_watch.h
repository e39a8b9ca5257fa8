#pragma once

#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "app/job.h"
#include "app/live/live_status.h"
#include "app/live/shots.h"
#include "app/session.h"
#include "base/result.h"
#include "live/board_guide.h"

namespace crosstie::app {

/// The poses of the board that were taken, and which one is wanted next. Safe to call from any thread.
class BoardWatch {
 public:
  /// Looks at pairs of images that it does not know yet, or that are other files by now. Errors: those of the job's board and of its
  /// images, kBadInput also where none of them shows the board, kCancelled; what was seen before stays.
  base::Result<> look(const Job& job, const std::vector<PairOfFiles>& pairs, Session& session);
  void forget(const PairOfFiles& pair);

  /// How many of the pair's cameras see the board.
  [[nodiscard]] int seen_by(const PairOfFiles& pair) const;
  /// Nothing where no pair was looked at and no pose is wanted.
  [[nodiscard]] std::optional<BoardStatus> status() const;

 private:
  void guide();

  mutable std::mutex mutex_;  ///< of all below
  live::BoardGuideOptions options_;
  std::map<PairOfFiles, live::BoardSight> sights_;
  std::optional<live::BoardGuide> guide_;
};

}  // namespace crosstie::app
