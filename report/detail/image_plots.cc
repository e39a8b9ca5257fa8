#include "report/detail/image_plots.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/image_coverage.h"
#include "report/detail/number.h"
#include "report/detail/plot.h"

namespace crosstie::report::detail {
namespace {

constexpr int kFewestForMean = 3;
constexpr std::size_t kMaxArrows = 6000;

struct Grid {
  int columns = 1;
  int rows = 1;
  std::vector<int> count;
  std::vector<Eigen::Vector2d> sum;
  double cell_x = 1.0;
  double cell_y = 1.0;
};

Grid make_grid(const std::vector<ImagePoint>& points, const ImageSize& size) {
  const base::ImageCells cells(size.width_px, size.height_px);
  Grid grid{cells.columns(),
            cells.rows(),
            std::vector<int>(cells.size(), 0),
            std::vector<Eigen::Vector2d>(cells.size(), Eigen::Vector2d::Zero()),
            cells.cell_px().x(),
            cells.cell_px().y()};
  for (const ImagePoint& point : points) {
    if (!point.at_px.allFinite() || !point.residual_px.allFinite()) continue;
    const std::size_t cell = cells.cell_of(point.at_px);
    ++grid.count[cell];
    grid.sum[cell] += point.residual_px;
  }
  return grid;
}

Plot image_plot(const std::string& title, const std::string& description, const ImageSize& size) {
  const double width = std::max(1, size.width_px);
  const double height = std::max(1, size.height_px);
  return Plot(title, description, make_axis(-0.5, width - 0.5, 6, false), make_axis(-0.5, height - 0.5, 5, false), "x [px]",
              "y [px]", {.equal_scale = true, .y_down = true, .grid = false});
}

double round_to_125(double value) {
  if (!(value > 0.0) || !std::isfinite(value)) return 1.0;
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double mantissa : {5.0, 2.0}) {
    if (value >= mantissa * power) return mantissa * power;
  }
  return power;
}

/// The key of the arrows: a bar of so many px.
void draw_key(Plot& plot, double magnification) {
  const double length_px = round_to_125(80.0 / (plot.scale_x() * magnification));
  const double drawn = length_px * plot.scale_x() * magnification;
  plot.svg().line(plot.left(), 13.0, plot.left() + drawn, 13.0, "arrow");
  plot.svg().text(plot.left() + drawn + 6.0, 17.0,
                  fmt::format("{} px (magnified {} times)", significant(length_px, 1), significant(magnification, 2)), "start",
                  "tick");
}

double rms(const std::vector<Eigen::Vector2d>& vectors) {
  double sum = 0.0;
  for (const Eigen::Vector2d& vector : vectors) sum += vector.squaredNorm();
  return vectors.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(vectors.size()));
}

double magnification_for(double typical_px, const ImageSize& size, double wanted_fraction) {
  return round_to_125(wanted_fraction * std::max(1, size.width_px) / typical_px);
}

}  // namespace

std::string residual_vectors(const std::vector<ImagePoint>& points, const ImageSize& size, const std::string& title) {
  std::vector<Eigen::Vector2d> residuals;
  for (const ImagePoint& point : points) {
    if (point.residual_px.allFinite()) residuals.push_back(point.residual_px);
  }
  const double typical = rms(residuals);
  const double magnification = magnification_for(typical, size, 0.025);
  Plot plot = image_plot(title,
                         fmt::format("{} residual vectors over the image, root mean square {} px, magnified {} times",
                                     points.size(), significant(typical), significant(magnification, 2)),
                         size);
  draw_key(plot, magnification);
  const std::size_t stride = points.size() / kMaxArrows + 1;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    const double scale = magnification * plot.scale_x();
    const double x = plot.x_px(points[i].at_px.x());
    const double y = plot.y_px(points[i].at_px.y());
    plot.svg().arrow(x, y, x + scale * points[i].residual_px.x(), y + scale * points[i].residual_px.y(), "arrow");
  }
  return plot.str();
}

std::string residual_field(const std::vector<ImagePoint>& points, const ImageSize& size, const std::string& title) {
  const Grid grid = make_grid(points, size);
  std::vector<Eigen::Vector2d> means;
  for (std::size_t cell = 0; cell < grid.count.size(); ++cell) {
    if (grid.count[cell] >= kFewestForMean) means.emplace_back(grid.sum[cell] / grid.count[cell]);
  }
  const double magnification = magnification_for(rms(means), size, 0.035);
  Plot plot = image_plot(title,
                         fmt::format("Mean residual in {} cells, root mean square {} px, magnified {} times", means.size(),
                                     significant(rms(means)), significant(magnification, 2)),
                         size);
  draw_key(plot, magnification);
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const auto cell = static_cast<std::size_t>(row * grid.columns + column);
      const double x = plot.x_px((column + 0.5) * grid.cell_x - 0.5);
      const double y = plot.y_px((row + 0.5) * grid.cell_y - 0.5);
      if (grid.count[cell] < kFewestForMean) continue;
      const Eigen::Vector2d mean = grid.sum[cell] / grid.count[cell] * magnification * plot.scale_x();
      plot.svg().circle(
          x, y, 1.4, "dot", "",
          fmt::format("mean of {}: {}, {} px", grid.count[cell], significant(grid.sum[cell].x() / grid.count[cell]),
                      significant(grid.sum[cell].y() / grid.count[cell])));
      plot.svg().arrow(x, y, x + mean.x(), y + mean.y(), "arrow");
    }
  }
  return plot.str();
}

double coverage(const std::vector<ImagePoint>& points, const ImageSize& size) {
  const Grid grid = make_grid(points, size);
  const auto filled = std::count_if(grid.count.begin(), grid.count.end(), [](int count) { return count > 0; });
  return static_cast<double>(filled) / static_cast<double>(grid.count.size());
}

std::string coverage_map(const std::vector<ImagePoint>& points, const ImageSize& size, const std::string& title) {
  const Grid grid = make_grid(points, size);
  const int most = *std::max_element(grid.count.begin(), grid.count.end());
  Plot plot = image_plot(
      title, fmt::format("{} of the image's cells hold points", fixed(100.0 * coverage(points, size), 0) + " %"), size);
  plot.svg().text(plot.left(), 17.0, fmt::format("points per cell, at most {}; empty cells are tinted red", most), "start",
                  "tick");
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const int count = grid.count[static_cast<std::size_t>(row * grid.columns + column)];
      const int shade = count == 0 ? 0 : 1 + std::min(4, 5 * (count - 1) / std::max(1, most));
      const double x = plot.x_px(column * grid.cell_x - 0.5);
      const double y = plot.y_px(row * grid.cell_y - 0.5);
      const double width = plot.x_px((column + 1) * grid.cell_x - 0.5) - x;
      const double height = plot.y_px((row + 1) * grid.cell_y - 0.5) - y;
      plot.svg().rect(x + 0.5, y + 0.5, width - 1.0, height - 1.0, fmt::format("o{}", shade), "", std::to_string(count));
      if (count > 0) plot.svg().text(x + 0.5 * width, y + 0.5 * height + 3.0, std::to_string(count), "middle", "cell");
    }
  }
  return plot.str();
}

}  // namespace crosstie::report::detail
