#include <cmath>

#include <fmt/format.h>

#include "report/detail/calibration_sections.h"
#include "report/detail/heat_map.h"
#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

using base::CalibratedBoard;

std::string certificate_text(const base::Certificate& certificate) {
  if (!certificate.known()) return "none was named";
  std::string text = certificate.number.empty() ? "without a number" : certificate.number;
  if (certificate.issued) text += ", of " + base::format_date(*certificate.issued);
  if (certificate.valid_until) text += ", valid until " + base::format_date(*certificate.valid_until);
  return text;
}

/// Height of each point over the nominal plane, in micrometres.
std::string height_map(const CalibratedBoard& found) {
  const base::Board& board = found.board;
  const bool grid = board.pattern == base::BoardPattern::kChessboard || board.pattern == base::BoardPattern::kCircles;
  if (!grid || found.points.cols() != board.count()) return "";
  constexpr double kMicrometres = 1000.0;
  HeatGrid heat;
  const double half_x = 0.5 * board.columns * board.pitch_mm;
  const double half_y = 0.5 * board.rows * board.pitch_mm;
  heat.x = make_axis(-half_x, half_x, 6, false);
  heat.y = make_axis(-half_y, half_y, 5, false);
  heat.values.resize(board.rows, board.columns);
  for (int row = 0; row < board.rows; ++row) {
    for (int column = 0; column < board.columns; ++column) {
      heat.values(row, column) = kMicrometres * found.points(2, row * board.columns + column);
    }
  }
  heat.value_name = "height";
  heat.unit = "\u00b5m";
  HeatOptions options;
  options.y_down = true;
  options.low = heat.values.minCoeff();
  options.high = heat.values.maxCoeff();
  return figure(heat_map(heat, "Height of the board's points", "x on the board [mm]", "y on the board [mm]", {}, options),
                "Height over the nominal plane as the images tell it; z points away from the viewer.");
}

}  // namespace

std::string calibration_board_section(const CalibratedBoard& found) {
  const base::Board& board = found.board;
  std::vector<std::pair<std::string, std::string>> list = {
      {"Pattern", fmt::format("{}, {} x {} points, {} mm apart", base::pattern_name(board.pattern), board.columns, board.rows,
                              plain(board.pitch_mm, 8))},
      {"Certificate", certificate_text(board.certificate)},
      {"Temperature", fmt::format("{} \u00b0C, expansion {} per K", plain(board.temperature_c), plain(board.cte_per_k))}};
  if (!board.free) {
    list.emplace_back("Shape", "taken as nominal");
    return definition_list(list) +
           paragraph(
               "Boards are seldom the rigid planes that they are taken for. A free board predicts better wherever we "
               "looked; the sigmas here hold only if this one is as flat and true as its numbers.");
  }
  list.emplace_back("Prior of the shape", fmt::format("scatter {} mm, bending {} mm, pitch {} ppm", plain(board.prior.sigma_mm),
                                                      plain(board.prior.bend_sigma_mm), plain(board.prior.pitch_sigma_ppm)));
  list.emplace_back("Out of the plane", fmt::format("{} mm rms", significant(found.bend_rms_mm)));
  list.emplace_back("In the plane, after scale", fmt::format("{} mm rms", significant(found.in_plane_rms_mm)));
  list.emplace_back("Squares over the prior's",
                    fmt::format("{} (1 where the prior is true, above it the board is worse)", significant(found.prior_ratio)));
  HtmlTable table("Smooth deviations of the board, with what was known of them beforehand.", {{"Mode", "", "", false},
                                                                                              {"Prior sigma", ""},
                                                                                              {"Found", ""},
                                                                                              {"Sigma", ""},
                                                                                              {"U", "", "k = 2"},
                                                                                              {"Unit", "", "", false}});
  for (const CalibratedBoard::Mode& mode : found.modes) {
    const int decimals = decimals_for_sigma(mode.sigma, 3);
    table.add_row({text_cell(mode.name), number_cell(plain(mode.prior_sigma), mode.prior_sigma),
                   number_cell(fixed(mode.value, decimals), mode.value), number_cell(fixed(mode.sigma, decimals), mode.sigma),
                   number_cell(fixed(2.0 * mode.sigma, decimals), 2.0 * mode.sigma), text_cell(mode.unit)});
  }
  return definition_list(list) + (table.empty() ? "" : table.html()) + height_map(found);
}

}  // namespace crosstie::report::detail
