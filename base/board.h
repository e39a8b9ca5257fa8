#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/certificate.h"
#include "base/result.h"

namespace crosstie::base {

enum class BoardPattern {
  kChessboard,         ///< inner corners of a chessboard
  kCircles,            ///< dots in a rectangular grid
  kAsymmetricCircles,  ///< dots of which every second row is shifted by one pitch; two pitches apart within a row
  kAprilGrid,          ///< corners of tags in a grid (Kalibr's board), four to a tag
};

/// "chessboard", "circles", "asymmetric_circles", "aprilgrid".
[[nodiscard]] std::string_view pattern_name(BoardPattern pattern);
[[nodiscard]] std::optional<BoardPattern> pattern_from_name(std::string_view name);

/// One way in which a board may deviate smoothly from its nominal shape: a field of displacements times an amplitude, of which
/// N(0, sigma^2) is known beforehand.
struct BoardMode {
  std::string name;               ///< "scale", "aspect", "shear", "bend 20", "bend 11", ...
  std::string unit;               ///< of amplitude and sigma: "ppm" in the plane, "mm" out of it
  double sigma = 0.0;             ///< > 0
  Eigen::Matrix3Xd displacement;  ///< [mm] of each point for an amplitude of 1
};

/// What is known of a board's shape before anything is measured. All of it is one Gaussian distribution:
///
///     X_i = N_i + sum over modes m (a_m F_m,i) + e_i,    a_m ~ N(0, sigma_m^2),   e_i ~ N(0, sigma_mm^2 I_3),
///
/// all independent, N the nominal points (Board::nominal_points), F the fields of Board::modes. A scale without sigma, a plane
/// without bending or points without scatter are written as sigmas of 0.
struct BoardPrior {
  /// [mm] Scatter of each coordinate of each point, independent of its neighbours; > 0 where the board is free
  double sigma_mm = 0.0;
  /// [mm] Each of the three bends of second order has this rms over the points, those of third order half of it.
  double bend_sigma_mm = 0.0;
  /// [ppm] Of the pitch common to both directions, of its difference (half of it), and of the shear (half of the grid's angle).
  double pitch_sigma_ppm = 0.0;
};

/// A flat pattern of known points. Board frame: the origin in the middle of the grid's rectangle, x along the rows (with growing
/// column), y along the columns (with growing row), z = x cross y; seen from the front with x to the right and y down, z points
/// away from the viewer. Points are counted row by row, index = row * columns + column.
struct Board {
  BoardPattern pattern = BoardPattern::kChessboard;
  int columns = 0;  ///< points in a row; of an AprilGrid twice its tags
  int rows = 0;
  double pitch_mm =
      0.0;  ///< between neighbouring rows, at 20 degrees C; of an AprilGrid from a tag's edge to the next tag's same edge
  double tag_mm = 0.0;          ///< AprilGrid only: length of a tag's edge
  int first_id = 0;             ///< AprilGrid only: of the tag in row 0, column 0 (see tag_corner)
  bool free = true;             ///< true: its shape is estimated under the prior; false: it is taken as nominal
  BoardPrior prior = {};        ///< where free
  double temperature_c = 20.0;  ///< at which it was photographed
  double cte_per_k = 0.0;       ///< coefficient of thermal expansion
  Certificate certificate = {};

  [[nodiscard]] int count() const { return columns * rows; }
  /// Nominal coordinates of all points in the board frame at temperature_c [mm].
  [[nodiscard]] Eigen::Matrix3Xd nominal_points() const;
  /// The modes of the prior that have a sigma: "scale", "aspect", "shear" [ppm], then the bends [mm], polynomials of second and third
  /// order in the plane's coordinates that are orthogonal over the points to the plane and to each other, each of rms 1 mm.
  [[nodiscard]] std::vector<BoardMode> modes() const;
  /// The same board with the prior of one that nobody measured: scatter pitch / 250, bends 1/1000 of the diagonal, pitch 1000 ppm.
  /// These cover the prints on plates of five public calibration sets.
  [[nodiscard]] Board with_default_prior() const;
  /// An Error (kBadInput) that names the member which is out of its domain.
  [[nodiscard]] Result<> validate() const;
};

/// Where a corner of a tag of an AprilGrid lies. Ids grow along the rows, then with the row; corners 0..3 are upper left, upper
/// right, lower right, lower left of the tag as it stands upright on the board (x right, y down). Nothing for ids of no tag.
[[nodiscard]] std::optional<int> tag_corner(const Board& board, int id, int corner);

/// A point of the board in an image.
struct BoardCorner {
  int index = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  /// [px] Of either coordinate as far as the detector knows; only the ratios between corners count, their common level is
  /// estimated. All 0: equal weights.
  double sigma_px = 0.0;
};

/// The corners seen in one image.
struct BoardImage {
  std::string image;   ///< its name, unique in the job
  std::string camera;  ///< which camera took it
  int width_px = 0;
  int height_px = 0;
  std::vector<BoardCorner> corners;  ///< by index, each at most once
};

/// The images of one moment, at most one of each camera: indices into a list of BoardImage.
struct BoardStation {
  std::string name;
  std::vector<int> images;
};

}  // namespace crosstie::base
