#include "markers/detail/whole_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/LU>

#include "markers/detail/cover_image.h"
#include "markers/detail/dot_noise.h"
#include "markers/detail/dot_pixels.h"
#include "markers/detail/edge_harmonics.h"
#include "markers/detail/light_prior.h"
#include "markers/detail/small_cholesky.h"

namespace crosstie::markers::detail {
namespace {

/// The unknowns: first those of the dot and the levels around it, then those of the ring. Lengths in px, shapes as the symmetric
/// (dot) or any (ring) matrix E that moves the points of the figure by E e.
enum Unknown : int {
  kCx,
  kCy,
  kExx,
  kExy,
  kEyy,
  kBlur,
  kO,
  kI = kO + 3,
  kW = kI + 3,
  kRx = kW + 3,
  kRy,
  kFxx,
  kFxy,
  kFyx,
  kFyy,
  kPx,
  kPy,
  kUnknowns
};
constexpr int kAll = kUnknowns + kEdgeHarmonics;

constexpr double kSmallestBlurPx = 0.29;
constexpr double kSagittaPx = 0.01;    // between an arc and its chord
constexpr double kFirstStepPx = 0.1;   // taken for the one before the first
constexpr double kConvergedPx = 1e-3;  // what remains after the last step, as in dot_fit.cc
constexpr double kConvergedSigmas = 0.05;
constexpr double kShrinking = 0.3;
constexpr int kMaxSteps = 10;
constexpr double kReach = 5.0;              // blurs from the dot's edge to where its light ends
constexpr double kLargestStep = 0.25;       // of the semi-minor axis
constexpr double kRingLevelSigma = 0.3;     // a priori: of the ring's level, in contrasts of the dot
constexpr double kPerspectiveSigma = 0.05;  // the same: of the change of scale from the centre to the ring's outer edge

struct Figure {
  Eigen::Vector2d centre_px;
  Eigen::Matrix2d pixel_from_unit;
  Eigen::Vector2d perspective = Eigen::Vector2d::Zero();  ///< per px: what would lie at e lies at e / (1 + perspective . e)

  [[nodiscard]] Eigen::Vector2d at(double rho, double phi) const {
    const Eigen::Vector2d e = rho * (pixel_from_unit * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
    return centre_px + e / (1.0 + perspective.dot(e));
  }
  void move(const Eigen::Vector2d& by, const Eigen::Matrix2d& shape) {
    centre_px += by;
    const Eigen::Matrix2d moved = Eigen::Matrix2d::Identity() + shape;
    pixel_from_unit = moved * pixel_from_unit;
    perspective = moved.transpose().inverse() * perspective;
  }
};

struct State {
  Figure dot, ring;
  double blur_px = 0.0;
  std::array<Eigen::Vector3d, 3> levels;  ///< O, I, W: at the origin, per px along x, per px along y
};

/// Corners of an arc; its chords enclose the area of the arc itself.
void add_arc(const Figure& figure, double rho, double from_rad, double to_rad, double semi_major_px,
             std::vector<Eigen::Vector2d>& corners) {
  const double turn = std::abs(to_rad - from_rad);
  const double finest = std::sqrt(8.0 * kSagittaPx / (rho * semi_major_px));
  const int steps = std::max(2, static_cast<int>(std::ceil(turn / finest)));
  const double step = turn / steps;
  const double enlarged = rho * std::sqrt(step / std::sin(step));
  for (int k = 0; k <= steps; ++k) {
    corners.push_back(figure.at(enlarged, from_rad + (to_rad - from_rad) * k / steps));
  }
}

void add_annulus(const Figure& figure, double inner, double outer, double semi_major_px, CoverImage& image) {
  std::vector<Eigen::Vector2d> corners;
  add_arc(figure, outer, 0.0, 2.0 * std::numbers::pi, semi_major_px, corners);
  image.add(corners);
  if (inner <= 0.0) return;
  corners.clear();
  add_arc(figure, inner, 2.0 * std::numbers::pi, 0.0, semi_major_px, corners);
  image.add(corners);
}

/// The runs of ones and the border.
void add_ring(const Figure& figure, const ReadRing& ring, const MarkerFamily& family, double semi_major_px, CoverImage& image) {
  const int bits = family.bits;
  const auto bit = [&](int s) { return (ring.ring >> (bits - 1 - s % bits) & 1U) != 0; };
  if (family.border_outer > family.disc_outer)
    add_annulus(figure, family.disc_outer, family.border_outer, semi_major_px, image);
  int begin = 0;
  while (begin < bits && bit(begin)) ++begin;
  if (begin == bits) return add_annulus(figure, family.ring_inner, family.ring_outer, semi_major_px, image);
  const double per_segment = 2.0 * std::numbers::pi / bits;
  std::vector<Eigen::Vector2d> corners;
  for (int s = begin; s < begin + bits; ++s) {
    if (!bit(s) || bit(s + bits - 1)) continue;
    int end = s + 1;
    while (bit(end)) ++end;
    const double from_rad = ring.first_rad + s * per_segment;
    const double to_rad = ring.first_rad + end * per_segment;
    corners.clear();
    add_arc(figure, family.ring_outer, from_rad, to_rad, semi_major_px, corners);
    add_arc(figure, family.ring_inner, to_rad, from_rad, semi_major_px, corners);
    image.add(corners);
  }
}

/// Of the pixels within `rho` of the ellipse.
Window window_of(const Ellipse& ellipse, double rho, const base::ImageView& image) {
  const Eigen::Vector2d half = rho * ellipse.half_extent_px();
  const auto low = [](double at) { return std::max(0, static_cast<int>(std::floor(at))); };
  Window window{low(ellipse.centre_px.x() - half.x()), low(ellipse.centre_px.y() - half.y()), 0, 0};
  window.width = std::min(image.width - 1, static_cast<int>(std::ceil(ellipse.centre_px.x() + half.x()))) - window.left + 1;
  window.height = std::min(image.height - 1, static_cast<int>(std::ceil(ellipse.centre_px.y() + half.y()))) - window.top + 1;
  return window;
}

/// Normal equations of one step.
struct Sums {
  Eigen::Matrix<double, kAll, kAll> normal;  ///< lower triangle
  Eigen::Matrix<double, kAll, 1> right;
  double squares = 0.0, edge = 0.0, edge_lost = 0.0;
};

/// The lower triangle of the first N unknowns, as SmallCholesky takes it.
template <std::size_t N>
std::array<double, N * N> lower_of(const Sums& sums) {
  std::array<double, N * N> lower{};
  for (std::size_t column = 0; column < N; ++column) {
    for (std::size_t row = column; row < N; ++row) {
      lower[column * N + row] = sums.normal(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column));
    }
  }
  return lower;
}

template <std::size_t N>
std::array<double, N> right_of(const Sums& sums) {
  std::array<double, N> right;
  std::copy_n(sums.right.data(), N, right.begin());
  return right;
}

class Fitting {
 public:
  Fitting(const base::ImageView& image, const DotFit& earlier, const ReadRing& ring, const MarkerFamily& family,
          const DotFitOptions& options);

  std::optional<WholeFit> fit();

 private:
  using Step = Eigen::Matrix<double, kUnknowns, 1>;
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, kAll + 1, Eigen::RowMajor>;

  void linearise();
  [[nodiscard]] Sums sum_up();
  void add_prior(Sums& sums) const;
  void step_by(const Step& step);
  [[nodiscard]] std::optional<WholeFit> result(const Sums& sums, const Eigen::Matrix2d& cov_px2) const;
  [[nodiscard]] double segment_misfit() const;

  const ReadRing& ring_;
  const MarkerFamily& family_;
  const DotFitOptions& options_;
  double semi_major_px_;
  double contrast_;
  Eigen::Matrix3d slopes_;  ///< inverse covariance of the slopes of O, I, W along one axis
  PixelSet pixels_;
  Window window_, dot_window_;
  State state_;
  Rows rows_;  ///< derivatives and, last, the residual of each pixel
};

Fitting::Fitting(const base::ImageView& image, const DotFit& earlier, const ReadRing& ring, const MarkerFamily& family,
                 const DotFitOptions& options)
    : ring_(ring),
      family_(family),
      options_(options),
      semi_major_px_(earlier.ellipse.semi_major_px),
      contrast_(std::max(std::abs(earlier.inner_level - earlier.outer_level), 1.0)) {
  const Ellipse& ellipse = earlier.ellipse;
  pixels_.origin_px = ellipse.centre_px.array().round().matrix();
  pixels_.collect(image, ellipse, 0.0, family.ring_outer);
  window_ = window_of(ellipse, family.ring_outer, image);
  const double dot_end = 1.0 + kReach * earlier.blur_px / ellipse.semi_minor_px;
  dot_window_ = window_of(ellipse, std::min(dot_end, family.ring_outer), image);
  state_.dot = {ellipse.centre_px, ellipse.pixel_from_unit(), Eigen::Vector2d::Zero()};
  state_.ring = {ring.dot.centre_px, ring.dot.pixel_from_unit(), Eigen::Vector2d::Zero()};
  state_.blur_px = std::max(earlier.blur_px, kSmallestBlurPx);
  const auto level = [&](double at_centre, const Eigen::Vector2d& slope) {
    return Eigen::Vector3d(at_centre - slope.dot(ellipse.centre_px - pixels_.origin_px), slope.x(), slope.y());
  };
  const Eigen::Vector3d bright = level(earlier.inner_level, earlier.inner_slope);
  state_.levels = {level(earlier.outer_level, earlier.outer_slope), bright, bright};
  const bool known = std::max(earlier.inner_level, earlier.outer_level) < options.saturated_level;
  const Eigen::Vector3d light(earlier.outer_level, earlier.inner_level, earlier.inner_level);
  Eigen::Matrix3d covariance = std::pow(kLightSlopeSigma, 2) * light * light.transpose();
  covariance.diagonal().array() += std::pow((known ? kOtherSlopeSigma : kUnknownSlopeSigma) * contrast_, 2);
  slopes_ = covariance.inverse() * (ellipse.semi_major_px * ellipse.semi_minor_px);
}

/// Derivatives and residuals at the pixels, and what their weights depend on.
void Fitting::linearise() {
  CoverImage dot_image(dot_window_, state_.blur_px);
  CoverImage ring_image(window_, state_.blur_px);
  add_annulus(state_.dot, 0.0, 1.0, semi_major_px_, dot_image);
  add_ring(state_.ring, ring_, family_, semi_major_px_, ring_image);
  const BlurredCover dot = dot_image.blurred();
  const BlurredCover ring = ring_image.blurred();
  const Eigen::Matrix2f unit_from_pixel = state_.dot.pixel_from_unit.inverse().cast<float>();
  const Eigen::Matrix2f shape = unit_from_pixel.transpose() * unit_from_pixel;
  const auto blur = static_cast<float>(state_.blur_px);
  const float blur2 = blur * blur;
  const auto saturated = static_cast<float>(options_.saturated_level);
  const auto left = static_cast<int>(pixels_.origin_px.x());
  const auto top = static_cast<int>(pixels_.origin_px.y());
  const Eigen::Vector2f dot_centre = (state_.dot.centre_px - pixels_.origin_px).cast<float>();
  const Eigen::Vector2f ring_centre = (state_.ring.centre_px - pixels_.origin_px).cast<float>();
  std::array<Eigen::Vector3f, 3> levels;
  for (std::size_t of = 0; of < 3; ++of) levels[of] = state_.levels[of].cast<float>();
  rows_.resize(static_cast<Eigen::Index>(pixels_.used), kAll + 1);
  for (std::size_t i = 0; i < pixels_.used; ++i) {
    const Eigen::Vector2f o(pixels_.x[i], pixels_.y[i]);
    const int x = left + static_cast<int>(o.x());
    const int y = top + static_cast<int>(o.y());
    const auto level = [&](const Eigen::Vector3f& l) { return l[0] + l[1] * o.x() + l[2] * o.y(); };
    const float ground = level(levels[0]);
    const float dot_contrast = level(levels[1]) - ground;
    const float ring_contrast = level(levels[2]) - ground;
    float d = 0.0F, r = 0.0F;
    Eigen::Vector2f dot_slope(0.0F, 0.0F), ring_slope(0.0F, 0.0F);
    Eigen::Vector3f dot_bend(0.0F, 0.0F, 0.0F), ring_bend(0.0F, 0.0F, 0.0F);  // xx, xy, yy; times the blur's square
    if (const auto k = dot.index(x, y)) {
      d = dot.value[*k];
      dot_slope = dot_contrast * Eigen::Vector2f(dot.x[*k], dot.y[*k]);
      dot_bend = dot_contrast * blur2 * Eigen::Vector3f(dot.xx[*k], dot.xy[*k], dot.yy[*k]);
    }
    if (const auto k = ring.index(x, y)) {
      r = ring.value[*k];
      ring_slope = ring_contrast * Eigen::Vector2f(ring.x[*k], ring.y[*k]);
      ring_bend = ring_contrast * blur2 * Eigen::Vector3f(ring.xx[*k], ring.xy[*k], ring.yy[*k]);
    }
    const float grey = ground + dot_contrast * d + ring_contrast * r;
    pixels_.residual[i] = std::min(pixels_.grey[i], saturated) - std::min(grey, saturated);
    pixels_.inside[i] = d + r;
    auto row = rows_.row(static_cast<Eigen::Index>(i));
    if (grey >= saturated) {  // such pixels say nothing of the unknowns
      pixels_.slope[i] = 0.0F;
      row.setZero();
      continue;
    }
    pixels_.slope[i] = (dot_slope + ring_slope).norm();
    const Eigen::Vector2f e = o - dot_centre;
    const Eigen::Vector2f f = o - ring_centre;
    row[kCx] = -dot_slope.x();
    row[kCy] = -dot_slope.y();
    row[kExx] = -(e.x() * dot_slope.x() + dot_bend[0]);
    row[kExy] = -(e.y() * dot_slope.x() + e.x() * dot_slope.y() + 2.0F * dot_bend[1]);
    row[kEyy] = -(e.y() * dot_slope.y() + dot_bend[2]);
    row[kBlur] = (dot_bend[0] + dot_bend[2] + ring_bend[0] + ring_bend[2]) / blur;
    const std::array<float, 3> shares{1.0F - d - r, d, r};
    for (int of = 0; of < 3; ++of) {
      const float share = shares[static_cast<std::size_t>(of)];
      row[kO + 3 * of] = share;
      row[kO + 3 * of + 1] = share * o.x();
      row[kO + 3 * of + 2] = share * o.y();
    }
    row[kRx] = -ring_slope.x();
    row[kRy] = -ring_slope.y();
    row[kFxx] = -(f.x() * ring_slope.x() + ring_bend[0]);
    row[kFxy] = -(f.y() * ring_slope.x() + ring_bend[1]);
    row[kFyx] = -(f.x() * ring_slope.y() + ring_bend[1]);
    row[kFyy] = -(f.y() * ring_slope.y() + ring_bend[2]);
    const float bulge = ring_bend[0] + ring_bend[2];
    const float outwards = f.dot(ring_slope) + bulge;
    row[kPx] = f.x() * outwards + f.x() * ring_bend[0] + f.y() * ring_bend[1] + blur2 * ring_slope.x();
    row[kPy] = f.y() * outwards + f.x() * ring_bend[1] + f.y() * ring_bend[2] + blur2 * ring_slope.y();
    // Harmonics move the edge along its normal.
    const Eigen::Vector2f across = shape * e;
    const Eigen::Vector2f u = unit_from_pixel * e;
    const float slope = dot_slope.dot(across) / std::max(across.norm(), 1e-9F);
    const float rho = std::max(u.norm(), 1e-9F);
    const float cosine = u.x() / rho;
    const float sine = u.y() / rho;
    float re = cosine * cosine - sine * sine;
    float im = 2.0F * cosine * sine;
    for (int h = 0; h < kEdgeHarmonics; h += 2) {
      const float turned = re * cosine - im * sine;
      im = re * sine + im * cosine;
      re = turned;
      row[kUnknowns + h] = slope * re;
      row[kUnknowns + h + 1] = slope * im;
    }
    row[kAll] = pixels_.residual[i];
  }
}

/// Weighs the rows and multiplies them.
Sums Fitting::sum_up() {
  Sums sums;
  for (std::size_t i = 0; i < pixels_.used; ++i) {
    const float squared = pixels_.residual[i] * pixels_.residual[i];
    const float robust = std::min(pixels_.limit2[i] / std::max(squared, 1e-12F), 1.0F);
    auto row = rows_.row(static_cast<Eigen::Index>(i));
    const auto edge = static_cast<double>(row.head<2>().squaredNorm());
    sums.squares += static_cast<double>(squared);
    sums.edge += edge;
    sums.edge_lost += edge * (1.0 - static_cast<double>(robust));
    row *= std::sqrt(pixels_.weight[i] * robust);
  }
  Eigen::Matrix<float, kAll + 1, kAll + 1> products = Eigen::Matrix<float, kAll + 1, kAll + 1>::Zero();
  products.selfadjointView<Eigen::Lower>().rankUpdate(rows_.transpose());
  sums.normal = products.topLeftCorner<kAll, kAll>().cast<double>();
  sums.right = products.row(kAll).head<kAll>().cast<double>();
  add_prior(sums);
  return sums;
}

/// The slopes of all levels follow the light's; the ring's level is roughly the dot's.
void Fitting::add_prior(Sums& sums) const {
  const double weight = std::pow(1.0 / (kRingLevelSigma * contrast_), 2);
  const double difference = state_.levels[2][0] - state_.levels[1][0];
  sums.normal(kW, kW) += weight;
  sums.normal(kI, kI) += weight;
  sums.normal(kW, kI) -= weight;
  sums.right[kW] -= weight * difference;
  sums.right[kI] += weight * difference;
  const double perspective = std::pow(family_.ring_outer * semi_major_px_ / kPerspectiveSigma, 2);
  for (const int axis : {0, 1}) {
    sums.normal(kPx + axis, kPx + axis) += perspective;
    sums.right[kPx + axis] -= perspective * state_.ring.perspective[axis];
  }
  for (const int axis : {1, 2}) {
    const Eigen::Vector3d slopes(state_.levels[0][axis], state_.levels[1][axis], state_.levels[2][axis]);
    const Eigen::Vector3d pull = -slopes_ * slopes;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b <= a; ++b) sums.normal(kO + 3 * a + axis, kO + 3 * b + axis) += slopes_(a, b);
      sums.right[kO + 3 * a + axis] += pull[a];
    }
  }
}

void Fitting::step_by(const Step& step) {
  Eigen::Matrix2d shape;
  shape << step[kExx], step[kExy], step[kExy], step[kEyy];
  state_.dot.move(step.segment<2>(kCx), shape);
  shape << step[kFxx], step[kFxy], step[kFyx], step[kFyy];
  state_.ring.move(step.segment<2>(kRx), shape);
  state_.ring.perspective += step.segment<2>(kPx);
  state_.blur_px = std::max(state_.blur_px + step[kBlur], kSmallestBlurPx);
  for (int of = 0; of < 3; ++of) state_.levels[static_cast<std::size_t>(of)] += step.segment<3>(kO + 3 * of);
}

std::optional<WholeFit> Fitting::result(const Sums& sums, const Eigen::Matrix2d& cov_px2) const {
  const Eigen::Matrix2d& m = state_.dot.pixel_from_unit;
  const auto ellipse = Ellipse::from_shape(state_.dot.centre_px, (m * m.transpose()).inverse());
  const SmallCholesky<kAll> root(lower_of<kAll>(sums));
  if (!ellipse || !root.definite()) return std::nullopt;
  DotFit fit;
  fit.ellipse = *ellipse;
  fit.cov_px2 = cov_px2;
  fit.blur_px = state_.blur_px;
  const Eigen::Vector2d e = state_.dot.centre_px - pixels_.origin_px;
  fit.outer_slope = state_.levels[0].tail<2>();
  fit.inner_slope = state_.levels[1].tail<2>();
  fit.outer_level = state_.levels[0][0] + fit.outer_slope.dot(e);
  fit.inner_level = state_.levels[1][0] + fit.inner_slope.dot(e);
  fit.residual = std::sqrt(sums.squares / static_cast<double>(pixels_.used));
  fit.outlier_fraction = sums.edge > 0.0 ? sums.edge_lost / sums.edge : 1.0;
  const EdgeHarmonics harmonics = edge_harmonics(root, right_of<kAll>(sums));
  fit.harmonic_power = harmonics.power;
  fit.deviation_px = harmonics.amplitude;
  return WholeFit{fit, segment_misfit()};
}

double Fitting::segment_misfit() const {
  const Eigen::Matrix2d unit_from_pixel = state_.ring.pixel_from_unit.inverse();
  const Eigen::Vector2d centre = state_.ring.centre_px - pixels_.origin_px;
  const auto bits = static_cast<std::size_t>(family_.bits);
  std::vector<double> sums(bits, 0.0), contrasts(bits, 0.0);
  for (std::size_t i = 0; i < pixels_.used; ++i) {
    const Eigen::Vector3d o(1.0, static_cast<double>(pixels_.x[i]), static_cast<double>(pixels_.y[i]));
    const Eigen::Vector2d f = o.tail<2>() - centre;
    const Eigen::Vector2d u = unit_from_pixel * f / (1.0 - state_.ring.perspective.dot(f));
    if (u.norm() < family_.ring_inner || u.norm() > family_.ring_outer) continue;
    double turns = (std::atan2(u.y(), u.x()) - ring_.first_rad) / (2.0 * std::numbers::pi);
    turns -= std::floor(turns);
    const std::size_t segment = static_cast<std::size_t>(turns * family_.bits) % bits;
    sums[segment] += static_cast<double>(pixels_.residual[i]);
    contrasts[segment] += o.dot(state_.levels[2] - state_.levels[0]);
  }
  double largest = 0.0;
  for (std::size_t s = 0; s < bits; ++s) {
    if (contrasts[s] != 0.0) largest = std::max(largest, std::abs(sums[s] / contrasts[s]));
  }
  return largest;
}

std::optional<WholeFit> Fitting::fit() {
  if (pixels_.used < 2 * kAll) return std::nullopt;
  const double radius_px = std::sqrt(std::abs(state_.dot.pixel_from_unit.determinant()));
  const double allowed_px = kLargestStep * radius_px;
  double previous_px = kFirstStepPx;
  for (int count = 0; count < kMaxSteps; ++count) {
    linearise();
    weigh(noise_of(pixels_, options_.saturated_level), pixels_);
    const Sums sums = sum_up();
    const SmallCholesky<kUnknowns> root(lower_of<kUnknowns>(sums));
    if (!root.definite()) return std::nullopt;
    Step step = Eigen::Map<const Step>(root.solve(right_of<kUnknowns>(sums)).data());
    if (!step.allFinite()) return std::nullopt;
    const auto moved_px = [&](int x, int first, int last) {
      return step.segment<2>(x).norm() + radius_px * std::max(std::abs(step[first]), std::abs(step[last]));
    };
    const double step_px = moved_px(kCx, kExx, kEyy) + std::abs(step[kBlur]);
    const double largest_px = std::max(step_px, moved_px(kRx, kFxx, kFyy));
    if (largest_px > allowed_px) step *= allowed_px / largest_px;
    step_by(step);
    const auto cx = root.solve({1.0});
    const auto cy = root.solve({0.0, 1.0});
    const double sigma_px = std::sqrt(0.5 * (cx[0] + cy[1]));
    const double remaining_px = step_px * std::min(step_px / std::max(previous_px, 1e-12), kShrinking);
    previous_px = step_px;
    if (largest_px > allowed_px || remaining_px > std::max(kConvergedPx, kConvergedSigmas * sigma_px)) continue;
    Eigen::Matrix2d cov_px2;
    cov_px2 << cx[0], cx[1], cx[1], cy[1];
    return result(sums, cov_px2);
  }
  return std::nullopt;
}

}  // namespace

std::optional<WholeFit> fit_whole_marker(const Sampler& image, const DotFit& earlier, const ReadRing& ring,
                                         const MarkerFamily& family, const DotFitOptions& options) {
  const Eigen::Vector2d reach = family.ring_outer * earlier.ellipse.half_extent_px();
  const Eigen::Vector2d& centre = earlier.ellipse.centre_px;
  if (!image.inside(centre.x() - reach.x(), centre.y() - reach.y()) ||
      !image.inside(centre.x() + reach.x(), centre.y() + reach.y())) {
    return std::nullopt;
  }
  return Fitting(image.image(), earlier, ring, family, options).fit();
}

}  // namespace crosstie::markers::detail
