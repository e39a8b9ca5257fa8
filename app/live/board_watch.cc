#include "app/live/board_watch.h"

#include <algorithm>
#include <utility>

#include "app/commission_input.h"
#include "app/steps_calibrate.h"

namespace crosstie::app {
namespace {

using base::Result;

constexpr std::array<std::size_t, 2> kSides = {0, 1};

std::string name_in(const PairOfFiles& pair, std::size_t side) { return pair[side].string(); }

}  // namespace

Result<> BoardWatch::look(const Job& job, const std::vector<PairOfFiles>& pairs, Session& session) {
  if (!job.board) return base::fail(base::ErrorCode::kBadInput, "the job has no [board]");
  if (pairs.empty()) {
    const std::lock_guard lock(mutex_);
    options_.board = job.board->board;
    guide();
    return {};
  }
  auto task = calibration_task(job);
  if (!task) return base::fail(std::move(task));
  const auto [left, right] = head_cameras(job);
  task->images.clear();
  task->board.detector = "classic";
  for (const PairOfFiles& pair : pairs) {
    {
      const std::lock_guard lock(mutex_);
      if (sights_.contains(pair)) continue;
    }
    task->images.push_back({name_in(pair, 0), left, pair[0]});
    task->images.push_back({name_in(pair, 1), right, pair[1]});
  }
  std::map<std::string, base::BoardImage> found;
  const auto keep = [&](std::vector<base::BoardImage>& images) {
    for (base::BoardImage& image : images) found.insert_or_assign(image.image, std::move(image));
  };
  Result<> trouble;
  if (!task->images.empty()) {
    auto corners = find_board(*task, session);
    if (corners) {
      keep(corners->front().images);
    } else if (corners.error().code == base::ErrorCode::kCancelled) {
      return base::fail(std::move(corners));
    } else {  // one image that cannot be read does not hide the others
      trouble = base::fail(std::move(corners));
      const std::vector<ImageFile> all = std::move(task->images);
      for (std::size_t i = 0; i + 1 < all.size() && all.size() > 2; i += 2) {
        task->images = {all[i], all[i + 1]};
        if (auto alone = find_board(*task, session)) keep(alone->front().images);
      }
    }
  }
  const std::lock_guard lock(mutex_);
  options_.board = job.board->board;
  for (const PairOfFiles& pair : pairs) {
    if (!found.contains(name_in(pair, 0))) continue;
    live::BoardSight sight;
    for (const std::size_t side : kSides) sight.views[side] = std::move(found[name_in(pair, side)]);
    sights_.insert_or_assign(pair, std::move(sight));
  }
  guide();
  return trouble;
}

void BoardWatch::forget(const PairOfFiles& pair) {
  const std::lock_guard lock(mutex_);
  if (sights_.erase(pair) > 0) guide();
}

int BoardWatch::seen_by(const PairOfFiles& pair) const {
  const std::lock_guard lock(mutex_);
  const auto found = sights_.find(pair);
  if (found == sights_.end()) return 0;
  return static_cast<int>(std::count_if(found->second.views.begin(), found->second.views.end(),
                                        [](const base::BoardImage& view) { return !view.corners.empty(); }));
}

/// Call with the mutex held.
void BoardWatch::guide() {
  std::vector<live::BoardSight> sights;
  for (const auto& [pair, sight] : sights_) sights.push_back(sight);
  auto guided = live::guide_board(sights, options_);
  guide_ = guided ? std::optional(*std::move(guided)) : std::nullopt;
}

std::optional<BoardStatus> BoardWatch::status() const {
  const std::lock_guard lock(mutex_);
  if (!guide_) return std::nullopt;
  BoardStatus status{
      .columns = live::BoardGuide::kColumns, .rows = live::BoardGuide::kRows, .counts = {}, .wanted = {}, .cell = {}};
  for (const std::size_t side : kSides)
    status.counts[side].assign(guide_->coverage[side].begin(), guide_->coverage[side].end());
  status.poses = guide_->poses;
  status.tilted_left = guide_->tilts[0];
  status.tilted_right = guide_->tilts[1];
  status.tilted_up = guide_->tilts[2];
  status.tilted_down = guide_->tilts[3];
  status.rolled = guide_->rolled;
  if (guide_->wanted) {
    status.wanted = guide_->wanted->words;
    status.cell = guide_->wanted->cell;
    status.cell_side = guide_->wanted->camera == devices::Side::kLeft ? "left" : "right";
  }
  return status;
}

}  // namespace crosstie::app
