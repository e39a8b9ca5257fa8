#include "base/board.h"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "base/calibrated_area.h"
#include "base/certificate.h"

namespace crosstie::base {
namespace {

TEST(Board, NominalPointsOfAChessboard) {
  const Board board{.columns = 3, .rows = 2, .pitch_mm = 10.0};
  const Eigen::Matrix3Xd points = board.nominal_points();
  ASSERT_EQ(points.cols(), 6);
  EXPECT_EQ(points.col(0), Eigen::Vector3d(-10.0, -5.0, 0.0));
  EXPECT_EQ(points.col(1), Eigen::Vector3d(0.0, -5.0, 0.0));
  EXPECT_EQ(points.col(5), Eigen::Vector3d(10.0, 5.0, 0.0));
}

TEST(Board, GrowsWithTemperature) {
  Board board{.columns = 101, .rows = 2, .pitch_mm = 10.0};
  board.cte_per_k = 20e-6;
  board.temperature_c = 30.0;
  const Eigen::Matrix3Xd points = board.nominal_points();
  EXPECT_NEAR((points.col(100) - points.col(0)).norm(), 1000.2, 1e-9);
}

TEST(Board, AsymmetricCirclesLieTwoPitchesApartInARow) {
  const Board board{.pattern = BoardPattern::kAsymmetricCircles, .columns = 4, .rows = 3, .pitch_mm = 5.0};
  const Eigen::Matrix3Xd points = board.nominal_points();
  EXPECT_NEAR((points.col(1) - points.col(0)).x(), 10.0, 1e-12);
  EXPECT_NEAR((points.col(4) - points.col(0)).x(), 5.0, 1e-12);
  EXPECT_NEAR((points.col(4) - points.col(0)).y(), 5.0, 1e-12);
  EXPECT_NEAR((points.col(8) - points.col(0)).x(), 0.0, 1e-12);
}

TEST(Board, CornersOfTagsInAGrid) {
  const Board board{
      .pattern = BoardPattern::kAprilGrid, .columns = 6, .rows = 4, .pitch_mm = 13.0, .tag_mm = 10.0, .first_id = 7};
  const Eigen::Matrix3Xd points = board.nominal_points();
  const auto place = [&](int id, int corner) { return Eigen::Vector3d(points.col(*tag_corner(board, id, corner))); };
  EXPECT_NEAR((place(7, 1) - place(7, 0)).x(), 10.0, 1e-12);   // upper right from upper left
  EXPECT_NEAR((place(7, 2) - place(7, 1)).y(), 10.0, 1e-12);   // lower right from upper right
  EXPECT_NEAR((place(7, 3) - place(7, 0)).y(), 10.0, 1e-12);   // lower left from upper left
  EXPECT_NEAR((place(8, 0) - place(7, 0)).x(), 13.0, 1e-12);   // the next tag
  EXPECT_NEAR((place(10, 0) - place(7, 0)).y(), 13.0, 1e-12);  // the next row
  EXPECT_FALSE(tag_corner(board, 6, 0));
  EXPECT_FALSE(tag_corner(board, 13, 0));
  EXPECT_FALSE(tag_corner(board, 7, 4));
}

TEST(Board, ModesAreOrthonormalAndFreeOfShiftAndTurn) {
  Board board{.columns = 9, .rows = 6, .pitch_mm = 25.0};
  board.prior = {0.1, 0.2, 500.0};
  const auto modes = board.modes();
  ASSERT_EQ(modes.size(), 10U);  // scale, aspect, shear, three bends of second and four of third order
  const Eigen::Matrix3Xd points = board.nominal_points();
  for (std::size_t a = 0; a < modes.size(); ++a) {
    EXPECT_NEAR(modes[a].displacement.rowwise().sum().norm(), 0.0, 1e-9) << modes[a].name;
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();
    for (Eigen::Index i = 0; i < points.cols(); ++i) turn += points.col(i).cross(modes[a].displacement.col(i));
    if (modes[a].unit == "mm") {
      EXPECT_NEAR(turn.norm(), 0.0, 1e-9) << modes[a].name;
      EXPECT_NEAR(modes[a].displacement.norm(), std::sqrt(54.0), 1e-9);
    }
    for (std::size_t b = 0; b < a; ++b) {
      const double product = (modes[a].displacement.array() * modes[b].displacement.array()).sum();
      if (modes[a].unit == "mm") {
        EXPECT_NEAR(product, 0.0, 1e-9) << modes[a].name << " " << modes[b].name;
      }
    }
  }
  EXPECT_EQ(modes[3].sigma, 0.2);
  EXPECT_EQ(modes[9].sigma, 0.1);
  EXPECT_NEAR(modes[0].displacement(0, 8) * 500.0, 100.0 * 500e-6, 1e-12);  // 500 ppm of 100 mm
}

TEST(Board, SmallGridsHaveTheBendsThatTheyCanTell) {
  Board board{.columns = 2, .rows = 2, .pitch_mm = 25.0};
  board.prior = {0.1, 0.2, 0.0};
  ASSERT_EQ(board.modes().size(), 1U);
  EXPECT_EQ(board.modes().front().name, "bend 11");
}

TEST(Board, RefusesWhatNoBoardIs) {
  const Board good{.columns = 9, .rows = 6, .pitch_mm = 25.0, .prior = {0.1, 0.2, 500.0}};
  EXPECT_TRUE(good.validate());
  const auto refused = [&](auto change) {
    Board board = good;
    change(board);
    return !board.validate();
  };
  EXPECT_TRUE(refused([](Board& b) { b.columns = 1; }));
  EXPECT_TRUE(refused([](Board& b) { b.rows = 5000; }));
  EXPECT_TRUE(refused([](Board& b) { b.pitch_mm = 0.0; }));
  EXPECT_TRUE(refused([](Board& b) { b.pitch_mm = std::nan(""); }));
  EXPECT_TRUE(refused([](Board& b) { b.prior.sigma_mm = 0.0; }));
  EXPECT_TRUE(refused([](Board& b) { b.prior.bend_sigma_mm = -1.0; }));
  EXPECT_TRUE(refused([](Board& b) { b.temperature_c = 300.0; }));
  EXPECT_TRUE(refused([](Board& b) { b.cte_per_k = 11.5; }));
  EXPECT_TRUE(refused([](Board& b) { b.pattern = BoardPattern::kAprilGrid; }));  // nine columns, no tag
}

TEST(CalibratedArea, CellsFollowTheBorder) {
  CalibratedArea area(1000, 500);  // a border of 20 px
  area.add({10.0, 250.0});
  area.add({500.0, 250.0});
  area.add({5000.0, 250.0});
  area.add({std::nan(""), 250.0});
  EXPECT_TRUE(area.contains({0.0, 260.0}));
  EXPECT_FALSE(area.contains({21.0, 250.0}));
  EXPECT_TRUE(area.contains({505.0, 255.0}));
  EXPECT_FALSE(area.contains({-1.0, 250.0}));
  EXPECT_NEAR(area.inner_share(), 0.01, 1e-12);
  EXPECT_NEAR(area.border_share(), 1.0 / 44.0, 1e-12);
  EXPECT_NEAR(area.column_px(0)[1], 19.5, 1e-12);
  EXPECT_NEAR(area.column_px(11)[1], 999.5, 1e-12);
  EXPECT_NEAR(area.row_px(1)[1], 19.5 + 46.0, 1e-12);
}

TEST(Certificate, ReadsDates) {
  const auto day = parse_date("2026-02-28");
  ASSERT_TRUE(day);
  EXPECT_EQ(format_date(*day), "2026-02-28");
  for (const char* wrong :
       {"2026-02-29", "2026-2-8", "28.02.2026", "", "2026-13-01", "2026-00-10", "2026-01-0x", "+026-01-01"}) {
    EXPECT_FALSE(parse_date(wrong)) << wrong;
  }
}

TEST(Certificate, ExpiresAfterItsLastDay) {
  Certificate certificate{"K 1234", parse_date("2025-06-01").value(), parse_date("2026-05-31").value()};
  EXPECT_TRUE(certificate.validate());
  EXPECT_FALSE(certificate.expired_on(parse_date("2026-05-31").value()));
  EXPECT_TRUE(certificate.expired_on(parse_date("2026-06-01").value()));
  std::swap(certificate.issued, certificate.valid_until);
  EXPECT_FALSE(certificate.validate());
}

}  // namespace
}  // namespace crosstie::base
