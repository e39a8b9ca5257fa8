#include "report/detail/image_map.h"

#include "report/detail/heat_map.h"

namespace crosstie::report::detail {

std::string image_map(const base::ImageGrid& grid, const Eigen::VectorXd& values, const std::string& title,
                      const std::string& value_name, const ImageMapOptions& options) {
  HeatGrid heat{.x = make_axis(-0.5, grid.width_px - 0.5, 6, false),
                .y = make_axis(-0.5, grid.height_px - 0.5, 5, false),
                .values = {},
                .value_name = value_name,
                .unit = options.unit};
  heat.values = values.reshaped<Eigen::RowMajor>(grid.rows, grid.columns);
  return heat_map(heat, title, "x [px]", "y [px]", {}, {.y_down = true, .low = 0.0, .high = options.high});
}

}  // namespace crosstie::report::detail
