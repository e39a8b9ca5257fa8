#include "report/detail/plot.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "report/detail/charts.h"
#include "report/detail/colour.h"
#include "report/detail/correlation.h"
#include "report/detail/heat_map.h"
#include "report/detail/image_plots.h"
#include "report/detail/plan_view.h"
#include "tests/report/markup.h"

namespace crosstie::report::detail {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using tests::attribute_values;
using tests::markup_error;

const double kNan = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

void expect_drawable(const std::string& svg) {
  EXPECT_EQ(markup_error(svg), std::nullopt);
  for (const char* name :
       {"x", "y", "x1", "x2", "y1", "y2", "cx", "cy", "r", "rx", "ry", "width", "height", "points", "d", "viewBox"}) {
    for (const std::string& value : attribute_values(svg, name)) {
      EXPECT_THAT(value, Not(HasSubstr("n"))) << name << "=" << value;  // nan, inf, n/a
    }
  }
}

TEST(Axis, TicksAreRound) {
  const Axis axis = make_axis(0.0, 97.0, 5);
  EXPECT_THAT(axis.ticks, ElementsAre(0.0, 20.0, 40.0, 60.0, 80.0, 100.0));
  EXPECT_EQ(axis.decimals, 0);
  const Axis small = make_axis(-0.013, 0.021, 4);
  EXPECT_EQ(small.low, -0.02);
  EXPECT_DOUBLE_EQ(small.high, 0.03);
  EXPECT_EQ(small.label(small.ticks[0]), "-0.02");
}

TEST(Axis, DegenerateRangesBecomeDrawable) {
  for (const auto& [low, high] :
       {std::pair(0.0, 0.0), std::pair(5.0, 5.0), std::pair(kNan, kNan), std::pair(-kInfinity, kInfinity), std::pair(3.0, -3.0),
        std::pair(1e12, 1e12), std::pair(1e-200, 2e-200), std::pair(-1e300, 1e300)}) {
    const Axis axis = make_axis(low, high);
    EXPECT_TRUE(std::isfinite(axis.low) && std::isfinite(axis.high)) << low << " " << high;
    EXPECT_LT(axis.low, axis.high) << low << " " << high;
    EXPECT_GE(axis.ticks.size(), 1u) << low << " " << high;
    EXPECT_LT(axis.ticks.size(), 40u) << low << " " << high;
  }
}

TEST(Plot, PlacesDataWhereTheAxesSay) {
  const Plot plot("t", "d", make_axis(0.0, 10.0), make_axis(0.0, 100.0), "x", "y");
  EXPECT_DOUBLE_EQ(plot.x_px(0.0), plot.left());
  EXPECT_DOUBLE_EQ(plot.x_px(10.0), plot.right());
  EXPECT_DOUBLE_EQ(plot.y_px(0.0), plot.bottom());
  EXPECT_DOUBLE_EQ(plot.y_px(100.0), plot.top());
  const Plot image("t", "d", make_axis(0.0, 2000.0), make_axis(0.0, 1000.0), "x", "y", {.equal_scale = true, .y_down = true});
  EXPECT_DOUBLE_EQ(image.y_px(0.0), image.top());
  EXPECT_NEAR(image.x_px(300.0) - image.x_px(200.0), image.y_px(300.0) - image.y_px(200.0), 1e-9);
}

TEST(Charts, NormalQuantiles) {  // Abramowitz & Stegun, table 26.5
  EXPECT_NEAR(normal_quantile(0.5), 0.0, 1e-12);
  EXPECT_NEAR(normal_quantile(0.975), 1.959963985, 1e-8);
  EXPECT_NEAR(normal_quantile(0.001), -3.090232306, 1e-8);
}

TEST(Charts, AnyValuesCanBeDrawn) {
  const std::vector<std::vector<double>> sets = {{}, {0.0}, {1.0}, {kNan, kInfinity}, {0.0, 0.0, 0.0}, {1e-9, 1e9, kNan, -3.0}};
  for (const auto& values : sets) {
    expect_drawable(histogram(values, "t", "x", {{1.0, "a"}, {0.0, "b"}, {kNan, "c"}}));
    expect_drawable(normal_quantile_plot(values, "t", "y"));
    expect_drawable(rms_along(values, values, 1.0, "t", "x", "y"));
  }
  for (const auto& values : {std::vector<int>{}, {0}, {3, 3, 3}, {0, 100000}, {-5, 5}})
    expect_drawable(count_bars(values, "t", "x", "y"));
}

TEST(Charts, HistogramCountsEveryValue) {
  const std::vector<double> values = {-1.0, -0.5, 0.0, 0.1, 0.2, 0.9, 50.0};
  const std::string svg = histogram(values, "t", "x", {{1.0, "a"}});
  int sum = 0;
  for (std::size_t at = svg.find("<title>"); at != std::string::npos; at = svg.find("<title>", at + 1)) {
    const std::string tip = svg.substr(at + 7, svg.find('<', at + 7) - at - 7);
    if (tip.find(": ") != std::string::npos) sum += std::stoi(tip.substr(tip.find(": ") + 2));
  }
  EXPECT_EQ(sum, 7);
  EXPECT_THAT(svg, HasSubstr("1 beyond the axis"));
}

TEST(PlanView, AnyPointsCanBeDrawn) {
  std::vector<PlanPoint> one(1);
  std::vector<PlanPoint> same(5);
  std::vector<PlanPoint> wild(3);
  wild[0].xyz_mm.setConstant(kNan);
  wild[1].cov_mm2.setConstant(kInfinity);
  wild[2].deviation_mm.setConstant(kNan);
  for (const auto& points : {std::vector<PlanPoint>{}, one, same, wild}) {
    EXPECT_EQ(plan_magnification(points, 0.01), 1.0);
    for (const bool arrows : {true, false})
      expect_drawable(plan_view(points, "t", {.arrows = arrows, .magnification = 1000.0}));
  }
}

TEST(PlanView, LooksAlongTheThinnestAxisFirst) {
  std::vector<PlanPoint> points(2);
  points[1].xyz_mm = {5.0, 100.0, 200.0};
  const auto axes = plan_axes(points);
  ASSERT_EQ(axes.size(), 2u);
  EXPECT_EQ(axes[0], std::pair(1, 2));
  EXPECT_EQ(axes[1], std::pair(1, 0));
}

TEST(ImagePlots, CoverageIsTheShareOfCellsWithPoints) {
  std::vector<ImagePoint> points(3);
  points[0].at_px = {10.0, 10.0};
  points[1].at_px = {12.0, 11.0};
  points[2].at_px = {1190.0, 590.0};
  EXPECT_NEAR(coverage(points, {1200, 600}), 2.0 / 72.0, 1e-12);
  for (const auto& list : {std::vector<ImagePoint>{}, points}) {
    for (const ImageSize size : {ImageSize{0, 0}, ImageSize{1200, 600}, ImageSize{1, 5000}}) {
      expect_drawable(residual_vectors(list, size, "t"));
      expect_drawable(residual_field(list, size, "t"));
      expect_drawable(coverage_map(list, size, "t"));
    }
  }
}

TEST(Correlation, OfAKnownCovariance) {
  Eigen::Matrix3d cov;
  cov << 4.0, 3.0, 0.0, 3.0, 9.0, 0.0, 0.0, 0.0, 0.0;
  const Eigen::MatrixXd r = correlation_matrix(cov);
  EXPECT_DOUBLE_EQ(r(0, 1), 0.5);
  EXPECT_DOUBLE_EQ(r(0, 0), 1.0);
  EXPECT_EQ(r(2, 2), 0.0);
  const std::string svg = correlation_map(r, {"a", "b", "c"}, "t", 0.45);
  expect_drawable(svg);
  EXPECT_THAT(svg, HasSubstr("class=\"flag\""));
  EXPECT_THAT(correlation_map(r, {"a", "b", "c"}, "t", 0.95), Not(HasSubstr("class=\"flag\"")));
}

TEST(Colour, EndsAndNonsense) {
  EXPECT_EQ(sequential_colour(0.0), "#2c7bb6");
  EXPECT_EQ(sequential_colour(7.0), "#d7301f");
  EXPECT_EQ(sequential_colour(kNan), "#2c7bb6");
  EXPECT_EQ(diverging_colour(0.0).substr(7), "00");
  EXPECT_EQ(diverging_colour(-1.0), "#2c7bb6b4");
}

TEST(HeatMap, ColoursCellsByTheirValueAndLeavesBlankWhatIsUnknown) {
  HeatGrid grid{make_axis(0.0, 400.0, 4, false), make_axis(0.0, 300.0, 3, false), Eigen::MatrixXd::Zero(3, 4), "U", "mm"};
  grid.values(0, 0) = 2.0;
  grid.values(2, 3) = kNan;
  const std::string svg = heat_map(grid, "Map", "x [mm]", "y [mm]", {{100.0, 100.0, "1"}});
  expect_drawable(svg);
  EXPECT_THAT(svg, HasSubstr("<title>U 2.00 mm</title>"));
  EXPECT_THAT(svg, HasSubstr(sequential_colour(1.0)));
  std::size_t cells = 0;
  for (std::size_t at = svg.find("<title>U "); at != std::string::npos; at = svg.find("<title>U ", at + 1)) ++cells;
  EXPECT_EQ(cells, 11u);
}

TEST(HeatMap, SurvivesWhatCannotBeDrawn) {
  const HeatGrid empty{make_axis(0.0, 0.0), make_axis(kNan, kNan), Eigen::MatrixXd(), "U", "mm"};
  expect_drawable(heat_map(empty, "Empty", "x", "y"));
  const HeatGrid wild{make_axis(0.0, 1.0), make_axis(0.0, 1.0), Eigen::MatrixXd::Constant(2, 2, kInfinity), "U", "mm"};
  expect_drawable(heat_map(wild, "Infinite", "x", "y"));
}

TEST(Plot, FillsTheBandBetweenTwoCurves) {
  Plot plot("Band", "", make_axis(0.0, 2.0), make_axis(-1.0, 1.0), "x", "y");
  const std::vector<double> x = {0.0, 1.0, 2.0};
  const std::vector<double> low = {-0.5, kNan, -0.5};
  const std::vector<double> high = {0.5, 9.0, 0.5};
  plot.band(x, low, high, "band");
  const std::string svg = plot.str();
  expect_drawable(svg);
  EXPECT_THAT(svg, HasSubstr("<polygon points="));
}

}  // namespace
}  // namespace crosstie::report::detail
