#include "calib/detail/crossing.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include <Eigen/Cholesky>

#include "math/edge_profile.h"

namespace crosstie::calib::detail {
namespace {

using Eigen::Vector2d;

constexpr int kUnknowns = 9;
// Corner x, y, both directions, ln blur; then those in which the levels are linear.
enum Unknown { kX, kY, kFirst, kSecond, kBlur, kContrast, kMean, kGradientX, kGradientY };
using Vector = Eigen::Matrix<double, kUnknowns, 1>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;

constexpr double kStartBlur_px = 0.8;
constexpr double kLeastBlur_px = 0.2;
constexpr double kMostCosine = 0.95;  // of the angle between the lines

struct Pixel {
  Vector2d from_start_px;
  double level;
};

double level_at(const base::ImageView& image, int x, int y) {
  return image.bits == 8 ? image.row<std::uint8_t>(y)[x] : image.row<std::uint16_t>(y)[x];
}

std::vector<Pixel> disc(const base::ImageView& image, const Vector2d& centre_px, double radius_px) {
  std::vector<Pixel> pixels;
  const int left = static_cast<int>(std::ceil(centre_px.x() - radius_px));
  const int top = static_cast<int>(std::ceil(centre_px.y() - radius_px));
  const int right = static_cast<int>(std::floor(centre_px.x() + radius_px));
  const int bottom = static_cast<int>(std::floor(centre_px.y() + radius_px));
  if (left < 0 || top < 0 || right >= image.width || bottom >= image.height) return pixels;
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const Vector2d from_start = Vector2d(x, y) - centre_px;
      if (from_start.squaredNorm() <= radius_px * radius_px) pixels.push_back({from_start, level_at(image, x, y)});
    }
  }
  return pixels;
}

/// Density of two standard normal variables of correlation r.
double density(double a, double b, double r) {
  const double rest = 1.0 - r * r;
  return std::exp(-0.5 * (a * a - 2.0 * r * a * b + b * b) / rest) / (2.0 * std::numbers::pi * std::sqrt(rest));
}

/// s = E[sign(a + e1) sign(b + e2)] for e of correlation r, with its derivatives. dE[.]/dr is four times the density (Plackett, Biometrika 41,
/// 1954), which is integrated from 0 to r.
struct BlurredSign {
  double value, by_a, by_b, by_correlation;
};
BlurredSign blurred_sign(double a, double b, double r) {
  constexpr std::array<double, 3> kNodes = {0.1127016653792583, 0.5, 0.8872983346207417};  // Gauss-Legendre on [0, 1]
  constexpr std::array<double, 3> kWeights = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};
  constexpr double kFar = 30.0;      // of the exponent: nothing is left of the density
  constexpr double kNothing = 1e-7;  // 5.5 sigmas from a line
  const auto of_a = math::edge_profile(a);
  const auto of_b = math::edge_profile(b);
  if (of_a.density < kNothing && of_b.density < kNothing) return {a * b > 0.0 ? 1.0 : -1.0, 0.0, 0.0, 0.0};
  const double width = std::sqrt(1.0 - r * r);
  BlurredSign s = {(2.0 * of_a.distribution - 1.0) * (2.0 * of_b.distribution - 1.0),
                   2.0 * of_a.density * (2.0 * math::edge_profile((b - r * a) / width).distribution - 1.0),
                   2.0 * of_b.density * (2.0 * math::edge_profile((a - r * b) / width).distribution - 1.0), 0.0};
  if (0.5 * (a * a + b * b) / (1.0 + std::abs(r)) > kFar) return s;
  s.by_correlation = 4.0 * density(a, b, r);
  for (std::size_t k = 0; k < kNodes.size(); ++k) s.value += 4.0 * r * kWeights[k] * density(a, b, kNodes[k] * r);
  return s;
}

/// Distance from a line in units of the blur, and its derivatives.
struct BlurDistance {
  double value;
  Vector2d by_corner;
  double by_direction;
};

/// A line at the present values.
class PlacedLine {
 public:
  PlacedLine(double direction_rad, double curvature_per_px, double blur_px)
      : along_(std::cos(direction_rad), std::sin(direction_rad)), curvature_per_px_(curvature_per_px), blur_px_(blur_px) {}

  [[nodiscard]] BlurDistance distance(const Vector2d& from_corner_px) const {
    const Vector2d across(-along_.y(), along_.x());
    const double s = along_.dot(from_corner_px);
    const double d = across.dot(from_corner_px);
    const double bend = curvature_per_px_ * s;
    return {(d - 0.5 * bend * s) / blur_px_, (bend * along_ - across) / blur_px_, (-s - bend * d) / blur_px_};
  }

 private:
  Vector2d along_;
  double curvature_per_px_;
  double blur_px_;
};

/// Normal equations at the present values; returns the sum of squares.
double accumulate(const std::vector<Pixel>& pixels, const CrossingSearch& search, const Vector& at, Normal& normal,
                  Vector& right) {
  normal.setZero();
  right.setZero();
  double squares = 0.0;
  const double blur = std::exp(at(kBlur));
  const double correlation = std::cos(at(kFirst) - at(kSecond));
  const double turned = std::sin(at(kFirst) - at(kSecond));
  const double contrast = at(kContrast);
  const PlacedLine first(at(kFirst), search.first.curvature_per_px, blur);
  const PlacedLine second(at(kSecond), search.second.curvature_per_px, blur);
  for (const Pixel& pixel : pixels) {
    const Vector2d from_corner = pixel.from_start_px - at.head<2>();
    const BlurDistance a = first.distance(from_corner);
    const BlurDistance b = second.distance(from_corner);
    const BlurredSign s = blurred_sign(a.value, b.value, correlation);
    Vector row;
    row.head<2>() = contrast * (s.by_a * a.by_corner + s.by_b * b.by_corner);
    row(kFirst) = contrast * (s.by_a * a.by_direction - s.by_correlation * turned);
    row(kSecond) = contrast * (s.by_b * b.by_direction + s.by_correlation * turned);
    row(kBlur) = -contrast * (s.by_a * a.value + s.by_b * b.value);
    row(kContrast) = s.value;
    row(kMean) = 1.0;
    row.tail<2>() = pixel.from_start_px;
    const double off = pixel.level - contrast * s.value - at(kMean) - at.tail<2>().dot(pixel.from_start_px);
    normal.noalias() += row * row.transpose();
    right += off * row;
    squares += off * off;
  }
  return squares;
}

/// The linear unknowns at the start; the others do not move.
void solve_levels(const std::vector<Pixel>& pixels, const CrossingSearch& search, Vector& at) {
  Normal normal;
  Vector right;
  at(kContrast) = 0.0;
  accumulate(pixels, search, at, normal, right);
  at.tail<4>() += normal.bottomRightCorner<4, 4>().ldlt().solve(right.tail<4>());
}

}  // namespace

std::optional<Crossing> find_crossing(const base::ImageView& image, const CrossingSearch& search) {
  constexpr int kMostSteps = 30;
  constexpr double kSettled_px = 3e-4;  // of a step: what the next one would do is its square
  constexpr double kLeastDamping = 1e-9;
  constexpr double kMostDamping = 1e6;
  const std::vector<Pixel> pixels = disc(image, search.start_px, search.radius_px);
  if (pixels.size() < 2 * kUnknowns) return std::nullopt;
  Vector at = Vector::Zero();
  at(kFirst) = search.first.direction_rad;
  at(kSecond) = search.second.direction_rad;
  at(kBlur) = std::log(kStartBlur_px);
  const auto parallel = [](const Vector& x) { return std::abs(std::cos(x(kFirst) - x(kSecond))) > kMostCosine; };
  if (parallel(at)) return std::nullopt;
  solve_levels(pixels, search, at);
  Normal normal;
  Vector right;
  double squares = accumulate(pixels, search, at, normal, right);
  const double farthest = std::max(1.0, search.radius_px / 3.0);
  double damping = 1e-3;
  bool settled = false;
  for (int step = 0; step < kMostSteps && !settled; ++step) {
    Normal damped = normal;
    damped.diagonal() *= 1.0 + damping;
    const Vector move = damped.ldlt().solve(right);
    const Vector there = at + move;
    if (!there.allFinite()) return std::nullopt;
    Normal normal_there;
    Vector right_there;
    const bool inside = there.head<2>().norm() < farthest && !parallel(there) && there(kBlur) > std::log(kLeastBlur_px) &&
                        there(kBlur) < std::log(search.radius_px);
    const double squares_there = inside ? accumulate(pixels, search, there, normal_there, right_there) : 2.0 * squares + 1.0;
    if (squares_there <= squares) {
      settled = move.head<2>().norm() < kSettled_px;
      at = there;
      squares = squares_there;
      normal = normal_there;
      right = right_there;
      damping = std::max(kLeastDamping, 0.1 * damping);
    } else {
      settled = move.head<2>().norm() < kSettled_px;
      damping *= 10.0;
      if (damping > kMostDamping) break;
    }
  }
  if (!settled) return std::nullopt;
  const double blur = std::exp(at(kBlur));
  const double variance = squares / static_cast<double>(pixels.size() - kUnknowns);
  if (blur > 0.5 * search.radius_px || !(std::abs(at(kContrast)) > 4.0 * std::sqrt(variance))) return std::nullopt;
  const Eigen::LDLT<Normal> factor(normal);
  if (factor.info() != Eigen::Success || !factor.isPositive()) return std::nullopt;
  const Normal inverse = factor.solve(Normal::Identity());
  return Crossing{.centre_px = search.start_px + at.head<2>(),
                  .sigma_px = std::sqrt(0.5 * variance * inverse.topLeftCorner<2, 2>().trace()),
                  .blur_px = blur,
                  .contrast = at(kContrast),
                  .residual = std::sqrt(variance)};
}

}  // namespace crosstie::calib::detail
