#include "base/board.h"

#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

namespace crosstie::base {
namespace {

constexpr std::array<std::pair<BoardPattern, std::string_view>, 4> kPatterns = {{
    {BoardPattern::kChessboard, "chessboard"},
    {BoardPattern::kCircles, "circles"},
    {BoardPattern::kAsymmetricCircles, "asymmetric_circles"},
    {BoardPattern::kAprilGrid, "aprilgrid"},
}};

constexpr int kMaxPointsPerSide = 1000;

/// Coordinates from -1 to 1 over the longer side.
Eigen::Matrix2Xd normalised(const Eigen::Matrix3Xd& points) {
  const double half = std::max(1e-12, points.cwiseAbs().maxCoeff());
  return points.topRows<2>() / half;
}

/// Monomials of second and third order made orthogonal to the plane and to each other over the points, each of rms 1.
std::vector<std::pair<std::string, Eigen::RowVectorXd>> bends(const Eigen::Matrix3Xd& points) {
  constexpr std::array<std::pair<int, int>, 10> kPowers = {
      {{0, 0}, {1, 0}, {0, 1}, {2, 0}, {1, 1}, {0, 2}, {3, 0}, {2, 1}, {1, 2}, {0, 3}}};
  constexpr double kDependent = 1e-6;  // of its length: what the points cannot tell from the others
  const Eigen::Matrix2Xd uv = normalised(points);
  std::vector<std::pair<std::string, Eigen::RowVectorXd>> basis;
  std::vector<std::pair<std::string, Eigen::RowVectorXd>> result;
  for (const auto& [i, j] : kPowers) {
    const Eigen::RowVectorXd monomial = uv.row(0).array().pow(i) * uv.row(1).array().pow(j);
    Eigen::RowVectorXd rest = monomial;
    for (int pass = 0; pass < 2; ++pass) {  // twice is enough (Kahan), for rounding
      for (const auto& [name, known] : basis) rest -= rest.dot(known) / known.squaredNorm() * known;
    }
    if (rest.norm() < kDependent * monomial.norm()) continue;
    rest *= std::sqrt(static_cast<double>(points.cols())) / rest.norm();
    basis.emplace_back(fmt::format("bend {}{}", i, j), rest);
    if (i + j > 1) result.push_back(basis.back());
  }
  return result;
}

}  // namespace

std::string_view pattern_name(BoardPattern pattern) {
  for (const auto& [value, name] : kPatterns) {
    if (value == pattern) return name;
  }
  return "";
}

std::optional<BoardPattern> pattern_from_name(std::string_view name) {
  for (const auto& [value, known] : kPatterns) {
    if (known == name) return value;
  }
  return {};
}

Eigen::Matrix3Xd Board::nominal_points() const {
  Eigen::Matrix3Xd points = Eigen::Matrix3Xd::Zero(3, count());
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      auto point = points.col(row * columns + column);
      switch (pattern) {
        case BoardPattern::kChessboard:
        case BoardPattern::kCircles:
          point.head<2>() << column * pitch_mm, row * pitch_mm;
          break;
        case BoardPattern::kAsymmetricCircles:
          point.head<2>() << (2 * column + row % 2) * pitch_mm, row * pitch_mm;
          break;
        case BoardPattern::kAprilGrid:
          point.head<2>() << (column / 2) * pitch_mm + (column % 2) * tag_mm, (row / 2) * pitch_mm + (row % 2) * tag_mm;
          break;
      }
    }
  }
  if (points.cols() == 0) return points;
  const Eigen::Vector3d middle = 0.5 * (points.rowwise().minCoeff() + points.rowwise().maxCoeff());
  points.colwise() -= middle;
  return points * (1.0 + cte_per_k * (temperature_c - 20.0));
}

std::vector<BoardMode> Board::modes() const {
  constexpr double kPpm = 1e-6;
  constexpr double kThirdOrder = 0.5;  // their sigma over that of the second order
  const Eigen::Matrix3Xd points = nominal_points();
  std::vector<BoardMode> result;
  if (prior.pitch_sigma_ppm > 0.0) {
    const auto add = [&](const char* name, const Eigen::Matrix2d& map) {
      Eigen::Matrix3Xd field = Eigen::Matrix3Xd::Zero(3, points.cols());
      field.topRows<2>() = kPpm * map * points.topRows<2>();
      result.push_back({name, "ppm", prior.pitch_sigma_ppm, std::move(field)});
    };
    add("scale", Eigen::Matrix2d{{1.0, 0.0}, {0.0, 1.0}});
    add("aspect", Eigen::Matrix2d{{1.0, 0.0}, {0.0, -1.0}});
    add("shear", Eigen::Matrix2d{{0.0, 1.0}, {1.0, 0.0}});
  }
  if (prior.bend_sigma_mm > 0.0) {
    for (auto& [name, heights] : bends(points)) {
      const bool third = name[5] - '0' + name[6] - '0' > 2;
      Eigen::Matrix3Xd field = Eigen::Matrix3Xd::Zero(3, points.cols());
      field.row(2) = heights;
      result.push_back({name, "mm", (third ? kThirdOrder : 1.0) * prior.bend_sigma_mm, std::move(field)});
    }
  }
  return result;
}

Board Board::with_default_prior() const {
  constexpr double kScatter = 1.0 / 250.0;
  constexpr double kBend = 1e-3;
  constexpr double kPitch_ppm = 1000.0;
  Board result = *this;
  const Eigen::Matrix3Xd points = nominal_points();
  const double diagonal_mm = points.cols() > 0 ? (points.col(points.cols() - 1) - points.col(0)).norm() : 0.0;
  result.prior = {kScatter * pitch_mm, kBend * diagonal_mm, kPitch_ppm};
  return result;
}

Result<> Board::validate() const {
  const auto refuse = [](std::string message) { return fail(ErrorCode::kBadInput, "board: " + std::move(message)); };
  if (columns < 2 || rows < 2 || columns > kMaxPointsPerSide || rows > kMaxPointsPerSide) {
    return refuse(
        fmt::format("{} x {} corners; there must be from 2 to {} in either direction", columns, rows, kMaxPointsPerSide));
  }
  if (!(pitch_mm > 0.0) || !std::isfinite(pitch_mm))
    return refuse(fmt::format("a pitch of {} mm; it must be positive", pitch_mm));
  if (pattern == BoardPattern::kAprilGrid) {
    if (columns % 2 != 0 || rows % 2 != 0) {
      return refuse(fmt::format("{} x {} corners of an AprilGrid; every tag has two in either direction", columns, rows));
    }
    if (!(tag_mm > 0.0 && tag_mm < pitch_mm)) {
      return refuse(fmt::format("tags of {} mm at a pitch of {} mm; a tag is smaller than the pitch", tag_mm, pitch_mm));
    }
  }
  const auto is_sigma = [](double sigma) { return sigma >= 0.0 && std::isfinite(sigma); };
  if (!is_sigma(prior.sigma_mm) || !is_sigma(prior.bend_sigma_mm) || !is_sigma(prior.pitch_sigma_ppm)) {
    return refuse("the sigmas of its shape must be finite and not negative");
  }
  if (free && !(prior.sigma_mm > 0.0)) return refuse("a free shape needs a sigma of its points (sigma_mm) above 0");
  constexpr double kLeast_c = -50.0;
  constexpr double kMost_c = 100.0;
  if (!(temperature_c > kLeast_c && temperature_c < kMost_c)) {
    return refuse(fmt::format("{} degrees C; between {} and {} is possible", temperature_c, kLeast_c, kMost_c));
  }
  constexpr double kMostExpansion_per_k = 1e-3;
  if (!(std::abs(cte_per_k) < kMostExpansion_per_k)) {
    return refuse(fmt::format("an expansion of {} per K; steel has 11.5e-6", cte_per_k));
  }
  return certificate.validate();
}

std::optional<int> tag_corner(const Board& board, int id, int corner) {
  const int tags_in_a_row = board.columns / 2;
  const int tag = id - board.first_id;
  if (tag < 0 || corner < 0 || corner > 3 || tags_in_a_row < 1 || tag >= tags_in_a_row * (board.rows / 2)) return {};
  const int right = corner == 1 || corner == 2 ? 1 : 0;
  const int down = corner >= 2 ? 1 : 0;
  return (2 * (tag / tags_in_a_row) + down) * board.columns + 2 * (tag % tags_in_a_row) + right;
}

}  // namespace crosstie::base
