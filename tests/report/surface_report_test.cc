#include "report/surface_report.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/table.h"
#include "tests/report/markup.h"
#include "tests/report/synthetic_network.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::report {
namespace {

using tests::markup_error;
using tests::synthetic_context;

/// A shell that is bulged by half a millimetre, its cone, and a rim with hairs.
base::SurfaceVerification some_verification() {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  base::SurfaceVerification all;
  base::SurfaceDeviations surface;
  surface.reference = "mesh";
  surface.tolerance_mm = 0.2;
  surface.gate_mm = 5.0;
  surface.best_fit = true;
  surface.held = {"shift along (1.00, 0.00, 0.00)"};
  for (int i = 0; i < 6000; ++i) {
    const double x = 1500.0 * std::abs(std::sin(0.37 * i));
    const double phi = 0.25 * std::cos(0.91 * i);
    surface.points.emplace_back(x, 2150.0 * std::sin(phi), 2150.0 * std::cos(phi));
    surface.deviations_mm.push_back(0.5 * std::sin(x / 300.0) * std::cos(6.0 * phi) + 0.03 * normal(random));
  }
  surface.count = surface.points.size();
  surface.beyond_border = 12;
  surface.mean_mm = 0.0123;
  surface.sigma_mm = 0.21;
  surface.rms_mm = 0.2104;
  surface.p95_mm = 0.44;
  surface.max_mm = 0.57;
  surface.in_tolerance = 0.617;
  all.surface = surface;
  base::ShapeDeviations shape;
  shape.shape = "cone";
  shape.diameter_mm = 4300.123;
  shape.diameter_sigma_mm = 0.045;
  shape.apex_angle_rad = 0.02;
  shape.apex_angle_sigma_rad = 1e-5;
  shape.low_mm = -750.0;
  shape.high_mm = 750.0;
  shape.low_diameter_mm = 4285.12;
  shape.high_diameter_mm = 4315.13;
  shape.low_diameter_sigma_mm = shape.high_diameter_sigma_mm = 0.09;
  shape.count = 5990;
  shape.difference = base::ShapeDeviations::Difference{0.001, 1e-5, 0.3, 0.1, 0.123, 0.045, 1e-5, 1e-5};
  all.shape = shape;
  base::EdgeVerification edge;
  for (int i = 0; i < 900; ++i) {
    edge.s_mm.push_back(5.2 * i);
    edge.u_mm.push_back(0.05 * std::sin(0.05 * i) + 0.01 * normal(random));
    edge.v_mm.push_back(0.02 * normal(random));
    edge.sigma_u_mm.push_back(0.02);
    edge.sigma_v_mm.push_back(0.02);
  }
  edge.count = 900;
  edge.rms_mm = 0.042;
  edge.p95_mm = 0.07;
  edge.max_mm = 0.081;
  edge.normalised_rms = 1.9;
  all.edge = edge;
  all.warnings = {{"far", "cloud", "a warning <of> its own"}};
  return all;
}

TEST(SurfaceReport, IsSoundAndSaysWhatMatters) {
  const std::string page = surface_report(some_verification(), synthetic_context("verify"));
  EXPECT_EQ(markup_error(page), std::nullopt);
  for (const char* text : {"61.7", "shift along (1.00, 0.00, 0.00)", "does not determine", "4300.123", "U\u00a0=\u00a00.090",
                           "0.123", "legend ends at", "0.042", "into the opening", "a warning &lt;of&gt; its own", "Cone"}) {
    EXPECT_TRUE(tests::contains(page, text)) << text;
  }
  EXPECT_EQ(page, surface_report(some_verification(), synthetic_context("verify")));
  if (const char* keep = std::getenv("CROSSTIE_KEEP_REPORTS")) {
    std::ofstream(std::filesystem::path(keep) / "surface_report.html") << page;
  }
}

TEST(SurfaceReport, TheLegendIsTheSameWhateverTheDeviationsAre) {
  base::SurfaceVerification small = some_verification();
  for (double& d : small.surface->deviations_mm) d *= 0.01;
  const std::string page = surface_report(small, synthetic_context("verify"));
  EXPECT_TRUE(tests::contains(page, "colours from -0.400 to 0.400 mm"));
  EXPECT_TRUE(
      tests::contains(surface_report(some_verification(), synthetic_context("verify")), "colours from -0.400 to 0.400 mm"));
}

TEST(SurfaceReport, TablesHoldEveryPoint) {
  const tests::TemporaryFolder folder;
  const base::SurfaceVerification all = some_verification();
  ASSERT_TRUE(write_surface_tables(folder.path(), all).has_value());
  const auto surface = base::read_table(folder / "surface.csv");
  ASSERT_TRUE(surface.has_value());
  ASSERT_EQ(surface->rows.size(), 6000U);
  EXPECT_EQ(*surface->number(77, 3), all.surface->deviations_mm[77]);
  const auto edge = base::read_table(folder / "edge_deviations.csv");
  ASSERT_TRUE(edge.has_value());
  ASSERT_EQ(edge->rows.size(), 900U);
  EXPECT_EQ(*edge->number(5, 1), all.edge->u_mm[5]);
}

}  // namespace
}  // namespace crosstie::report
