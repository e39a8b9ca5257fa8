// [board]

#include <algorithm>
#include <tuple>

#include <fmt/core.h>

#include "app/job_sections.h"

namespace crosstie::app {

void read_board(const JobTable& root, Job& job) {
  const auto table = root.table("board");
  if (!table) return;
  table->check_keys("board", {"pattern", "corners", "pitch_mm", "tag_mm", "first_id", "family", "shape", "sigma_mm",
                              "bend_sigma_mm", "pitch_sigma_ppm", "temperature_c", "cte_per_k", "detector", "certificate",
                              "certificate_date", "certificate_expires"});
  JobBoard read;
  base::Board& board = read.board;
  std::string pattern = "chessboard";
  table->word("pattern", {"chessboard", "circles", "asymmetric_circles", "aprilgrid"}, pattern);
  board.pattern = *base::pattern_from_name(pattern);
  std::optional<std::pair<int, int>> corners;
  table->pair("corners", corners);
  if (!corners) table->complain("corners", "[board] needs corners = [COLUMNS, ROWS], its inner corners or dots");
  std::tie(board.columns, board.rows) = corners.value_or(std::pair{2, 2});
  if (!table->has("pitch_mm")) table->complain("", "[board] needs pitch_mm, the distance of neighbouring corners");
  table->number("pitch_mm", board.pitch_mm);
  table->number("tag_mm", board.tag_mm);
  double first_id = 0.0;
  table->number("first_id", first_id, Domain::kNotNegative);
  board.first_id = static_cast<int>(std::min(first_id, 1e6));
  table->number("temperature_c", board.temperature_c, Domain::kAny);
  table->number("cte_per_k", board.cte_per_k, Domain::kAny);
  table->certificate("certificate", board.certificate);

  std::string shape = "free";
  table->word("shape", {"free", "rigid"}, shape);
  board.free = shape == "free";
  if (board.free) board = board.with_default_prior();
  for (const auto& [key, sigma] :
       {std::pair{"sigma_mm", &board.prior.sigma_mm}, std::pair{"bend_sigma_mm", &board.prior.bend_sigma_mm},
        std::pair{"pitch_sigma_ppm", &board.prior.pitch_sigma_ppm}}) {
    if (!board.free && table->has(key)) {
      table->complain(key,
                      fmt::format("{} tells how far the shape of a free board may go; this one has shape = \"rigid\"", key));
    }
    table->number(key, *sigma, Domain::kNotNegative);
  }
  const bool grid = board.pattern == base::BoardPattern::kAprilGrid;
  for (const char* key : {"tag_mm", "first_id", "family"}) {
    if (!grid && table->has(key)) table->complain(key, fmt::format("{} belongs to pattern = \"aprilgrid\"", key));
  }
  read.family = grid ? "apriltag:tag36h11" : "";
  table->text("family", read.family);
  table->word("detector", {"auto", "classic", "sb"}, read.detector);
  if (const auto valid = board.validate(); !valid) table->complain("", valid.error().message);
  job.board = std::move(read);
}

}  // namespace crosstie::app
