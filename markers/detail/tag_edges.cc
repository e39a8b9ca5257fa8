#include "markers/detail/tag_edges.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "markers/detail/tag_light.h"
#include "math/edge_profile.h"
#include "math/median.h"

namespace crosstie::markers::detail {
namespace {

constexpr int kRounds = 3;               // lines, corners, light of the neighbours: each round with what the last one found
constexpr int kMaxIterations = 12;       // of one line
constexpr double kConvergedPx = 1e-5;    // step of offset and direction
constexpr double kReachInCells = 0.8;    // on both sides of an edge; the next cell's light is taken off
constexpr double kReachToUnknown = 0.6;  // outwards where nobody knows what comes after the next cell
constexpr double kLeftOutInCells = 0.7;  // at both ends
constexpr double kSmallestBlurPx = 0.25;
constexpr double kLargestBlur = 0.6;    // of a cell
constexpr double kQuantisation = 0.29;  // of a grey level
constexpr double kMaxResidual = 0.15;   // RMS over the contrast

enum LineParameter { kOffset, kTurn, kBlur, kOut, kOutSlope, kIn, kInSlope, kLineParameters };
using LineState = Eigen::Matrix<double, kLineParameters, 1>;
using ExtendedState = Eigen::Matrix<double, kLineParameters + 2, 1>;
using ExtendedNormal = Eigen::Matrix<double, kLineParameters + 2, kLineParameters + 2>;

/// A pixel beside an edge: `along` in -1..1, `distance` outwards, and its grey level without the neighbours' light.
struct EdgePixel {
  double along, distance, grey;
  bool saturated;
};

/// One edge of the square as it is known so far.
struct Edge {
  Eigen::Vector2d middle, along, outward;  // unit vectors
  double half_length = 0.0;
  double reach_in = 0.0, reach_out = 0.0;  // px
  double left_out = 0.0;                   // px at each end
  double cell_out = 0.0;                   // width of the cells outside, px
  double tone_in = 0.0, tone_out = 0.0;

  LineState state = LineState::Zero();
  Eigen::Matrix2d cov = Eigen::Matrix2d::Zero();  // of offset and turn
  double deviation = 0.0;                         // sum of two squared normalised amplitudes
};

/// Places edge `k` (0 top, 1 right, 2 bottom, 3 left) and the strip of pixels that belong to it.
void place(const TagPattern& pattern, const TagFrame& frame, const Corners& corners, std::size_t k, Edge& edge) {
  const Eigen::Vector2d& from = corners[k];
  const Eigen::Vector2d& to = corners[(k + 1) % 4];
  edge.middle = 0.5 * (from + to);
  edge.half_length = 0.5 * (to - from).norm();
  edge.along = (to - from).normalized();
  edge.outward = {edge.along.y(), -edge.along.x()};
  const int first = pattern.layout.offset();
  const int last = first + pattern.layout.border_cells;
  const std::array<Eigen::Vector2d, 4> cell = {Eigen::Vector2d(first, first), Eigen::Vector2d(last, first),
                                               Eigen::Vector2d(last, last), Eigen::Vector2d(first, last)};
  const std::array<Eigen::Vector2d, 4> out = {Eigen::Vector2d(0, -1), Eigen::Vector2d(1, 0), Eigen::Vector2d(0, 1),
                                              Eigen::Vector2d(-1, 0)};
  const auto width = [&](double cells) {
    const double at_from = std::abs(edge.outward.dot(frame.pixel(cell[k] + cells * out[k]) - from));
    const double at_to = std::abs(edge.outward.dot(frame.pixel(cell[(k + 1) % 4] + cells * out[k]) - to));
    return std::min(at_from, at_to);
  };
  const double blur = edge.state[kBlur];
  const double enough = 4.0 * blur + 1.5;
  const bool known_outside = pattern.layout.white_inside;
  edge.cell_out = width(1.0);
  edge.reach_in = std::min(kReachInCells * width(-1.0), enough);
  edge.reach_out = std::min((known_outside ? kReachInCells : kReachToUnknown) * edge.cell_out, enough);
  const double cell_along = 2.0 * edge.half_length / pattern.layout.border_cells;
  edge.left_out = std::min(kLeftOutInCells * cell_along, enough);
  edge.tone_in = pattern.layout.white_inside != pattern.inverted ? 1.0 : 0.0;
  edge.tone_out = 1.0 - edge.tone_in;
}

/// What the cells beyond the two beside the edge add to the grey level, and where nobody knows them, what is seen there.
double neighbours_light(const Sampler& image, const TagPattern& pattern, const TagFrame& frame, const Edge& edge,
                        const Eigen::Vector2d& pixel, double distance, double contrast) {
  const double blur = edge.state[kBlur];
  const double step = edge.tone_in + (edge.tone_out - edge.tone_in) * math::edge_profile(distance / blur).distribution;
  double light = contrast * (blurred_tone(pattern, frame, blur, pixel) - step);
  if (!pattern.layout.white_inside) {
    const double share = math::edge_profile((distance - edge.cell_out) / blur).distribution;
    const Eigen::Vector2d beyond = pixel + (1.5 * edge.cell_out - distance) * edge.outward;
    if (share > 1e-4 && image.inside(beyond.x(), beyond.y())) {
      light += share * (image.bilinear(beyond.x(), beyond.y()) - edge.state[kOut]);
    }
  }
  return light;
}

std::vector<EdgePixel> strip(const Sampler& image, const TagPattern& pattern, const TagFrame& frame, const Edge& edge,
                             double contrast, double saturated_level) {
  std::vector<EdgePixel> pixels;
  const double half = edge.half_length - edge.left_out;
  const Eigen::Vector2d extent =
      half * edge.along.cwiseAbs() + std::max(edge.reach_in, edge.reach_out) * edge.outward.cwiseAbs();
  const int x0 = std::max(0, static_cast<int>(std::ceil(edge.middle.x() - extent.x())));
  const int x1 = std::min(image.image().width - 1, static_cast<int>(std::floor(edge.middle.x() + extent.x())));
  const int y0 = std::max(0, static_cast<int>(std::ceil(edge.middle.y() - extent.y())));
  const int y1 = std::min(image.image().height - 1, static_cast<int>(std::floor(edge.middle.y() + extent.y())));
  for (int y = y0; y <= y1; ++y) {
    // Along a row both coordinates change linearly: only the pixels of the strip are visited.
    double from = x0, to = x1;
    const auto keep = [&](double slope, double at_zero, double low, double high) {
      if (std::abs(slope) < 1e-9) {
        if (at_zero < low || at_zero > high) to = from - 1.0;
        return;
      }
      const double a = (low - at_zero) / slope;
      const double b = (high - at_zero) / slope;
      from = std::max(from, std::min(a, b));
      to = std::min(to, std::max(a, b));
    };
    const Eigen::Vector2d e0 = Eigen::Vector2d(0.0, y) - edge.middle;
    keep(edge.along.x(), edge.along.dot(e0), -half, half);
    keep(edge.outward.x(), edge.outward.dot(e0), -edge.reach_in, edge.reach_out);
    for (int x = static_cast<int>(std::ceil(from)); x <= to; ++x) {
      const Eigen::Vector2d p(x, y);
      const double along = edge.along.dot(p - edge.middle);
      const double distance = edge.outward.dot(p - edge.middle);
      const double grey = image.at(x, y);
      const double light = neighbours_light(image, pattern, frame, edge, p, distance, contrast);
      pixels.push_back({along / half, distance, grey - light, grey >= saturated_level});
    }
  }
  return pixels;
}

/// The model at one pixel with its derivatives; `j` of any size from kLineParameters on.
template <typename Vector>
double predicted(const LineState& s, const EdgePixel& pixel, Vector& j) {
  const double t = (pixel.distance - s[kOffset] - s[kTurn] * pixel.along) / s[kBlur];
  const math::EdgeProfile profile = math::edge_profile(t);
  const double out = s[kOut] + s[kOutSlope] * pixel.along;
  const double in = s[kIn] + s[kInSlope] * pixel.along;
  const double slope = (out - in) * profile.density / s[kBlur];
  j[kOffset] = -slope;
  j[kTurn] = -slope * pixel.along;
  j[kBlur] = -slope * t;
  j[kOut] = profile.distribution;
  j[kOutSlope] = profile.distribution * pixel.along;
  j[kIn] = 1.0 - profile.distribution;
  j[kInSlope] = (1.0 - profile.distribution) * pixel.along;
  return in + (out - in) * profile.distribution;
}

/// Standard deviations of the pixels outside and inside.
struct Noise {
  double out = 1.0, in = 1.0;
  [[nodiscard]] double variance(double share_out) const { return share_out * out * out + (1.0 - share_out) * in * in; }
};

/// Root mean square of the residuals up to five times what their median says: a median alone is blind to noise below the steps
/// of the grey levels.
double robust_rms(std::vector<double>& residuals) {
  constexpr double kMadToSigma = 1.4826;
  const double limit = 5.0 * std::max(kMadToSigma * math::median(residuals), 0.5);
  double squares = 0.0;
  double count = 0.0;
  for (const double residual : residuals) {
    if (residual > limit) continue;
    squares += residual * residual;
    count += 1.0;
  }
  return std::max(kQuantisation, std::sqrt(squares / count));
}

Noise noise_of(const std::vector<EdgePixel>& pixels, const LineState& state) {
  constexpr std::size_t kEnough = 8;
  std::vector<double> out, in;
  LineState j;
  for (const EdgePixel& pixel : pixels) {
    if (pixel.saturated) continue;
    const double residual = std::abs(pixel.grey - predicted(state, pixel, j));
    (j[kOut] > 0.5 ? out : in).push_back(residual);
  }
  Noise noise;
  noise.out = out.size() >= kEnough ? robust_rms(out) : 1.0;
  noise.in = in.size() >= kEnough ? robust_rms(in) : noise.out;
  if (out.size() < kEnough) noise.out = noise.in;
  return noise;
}

/// A saturated pixel says that the light is at least as bright.
bool silent(const EdgePixel& pixel, double model) { return pixel.saturated && model >= pixel.grey; }

/// Gauss-Newton on a strip; false where it runs away.
bool adjust(const std::vector<EdgePixel>& pixels, const Noise& noise, double largest_blur_px, double cell_px,
            LineState& state) {
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::Matrix<double, kLineParameters, kLineParameters> n = Eigen::Matrix<double, kLineParameters, kLineParameters>::Zero();
    LineState b = LineState::Zero();
    LineState j;
    for (const EdgePixel& pixel : pixels) {
      const double model = predicted(state, pixel, j);
      if (silent(pixel, model)) continue;
      const double weight = 1.0 / noise.variance(j[kOut]);
      n += weight * j * j.transpose();
      b += weight * (pixel.grey - model) * j;
    }
    n.diagonal() *= 1.0 + 1e-9;
    LineState step = n.ldlt().solve(b);
    if (!step.allFinite()) return false;
    const double move = std::abs(step[kOffset]) + std::abs(step[kTurn]);
    if (move > 1.0) step /= move;
    state += step;
    state[kBlur] = std::clamp(state[kBlur], kSmallestBlurPx, largest_blur_px);
    if (std::abs(state[kOffset]) + std::abs(state[kTurn]) > 0.8 * cell_px) return false;
    if (move < kConvergedPx) break;
  }
  return true;
}

/// Covariance, deviations from a straight line, and whether the strip shows an edge at all.
bool judge(const std::vector<EdgePixel>& pixels, const Noise& noise, const TagEdgeOptions& options, Edge& edge) {
  ExtendedNormal n = ExtendedNormal::Zero();
  ExtendedState b = ExtendedState::Zero();
  ExtendedState j;
  double squares = 0.0;
  for (const EdgePixel& pixel : pixels) {
    const double model = predicted(edge.state, pixel, j);
    if (silent(pixel, model)) continue;
    const double s = pixel.along;
    j[kLineParameters] = j[kOffset] * 0.5 * s * (5.0 * s * s - 3.0);
    j[kLineParameters + 1] = j[kOffset] * 0.125 * (s * s * (35.0 * s * s - 30.0) + 3.0);
    const double residual = pixel.grey - model;
    squares += residual * residual;
    const double weight = 1.0 / noise.variance(j[kOut]);
    n += weight * j * j.transpose();
    b += weight * residual * j;
  }
  const double contrast = (edge.tone_out - edge.tone_in) * (edge.state[kOut] - edge.state[kIn]);
  const double rms = std::sqrt(squares / static_cast<double>(pixels.size()));
  if (!(contrast >= options.min_contrast) || !(rms <= kMaxResidual * contrast)) return false;
  edge.cov = n.topLeftCorner<kLineParameters, kLineParameters>()
                 .ldlt()
                 .solve(Eigen::Matrix<double, kLineParameters, kLineParameters>::Identity())
                 .topLeftCorner<2, 2>();
  const ExtendedNormal q = n.ldlt().solve(ExtendedNormal::Identity());
  const Eigen::Vector2d amplitudes = (q * b).tail<2>();
  edge.deviation = amplitudes.dot(q.bottomRightCorner<2, 2>().inverse() * amplitudes);
  return edge.cov.allFinite() && std::isfinite(edge.deviation);
}

/// The corners as functions of the lines' (offset, turn), 8 numbers; `half` is where a turn counts once.
Corners intersections(const std::array<Edge, 4>& edges, const Eigen::Matrix<double, 8, 1>& lines) {
  std::array<Eigen::Vector3d, 4> line;
  for (std::size_t k = 0; k < 4; ++k) {
    const Edge& edge = edges[k];
    const auto row = static_cast<Eigen::Index>(2 * k);
    const double half = edge.half_length - edge.left_out;
    const Eigen::Vector2d point = edge.middle + lines[row] * edge.outward;
    const Eigen::Vector2d direction = edge.along + lines[row + 1] / half * edge.outward;
    line[k] = {direction.y(), -direction.x(), -(direction.y() * point.x() - direction.x() * point.y())};
  }
  Corners corners;
  for (std::size_t k = 0; k < 4; ++k) corners[k] = line[(k + 3) % 4].cross(line[k]).hnormalized();
  return corners;
}

Eigen::Matrix<double, 8, 1> lines_of(const std::array<Edge, 4>& edges) {
  Eigen::Matrix<double, 8, 1> lines;
  for (std::size_t k = 0; k < 4; ++k) lines.segment<2>(static_cast<Eigen::Index>(2 * k)) = edges[k].state.head<2>();
  return lines;
}

void propagate(const std::array<Edge, 4>& edges, TagEdges& result) {
  const Eigen::Matrix<double, 8, 1> lines = lines_of(edges);
  Eigen::Matrix<double, 8, 8> cov = Eigen::Matrix<double, 8, 8>::Zero();
  for (std::size_t k = 0; k < 4; ++k) {
    cov.block<2, 2>(static_cast<Eigen::Index>(2 * k), static_cast<Eigen::Index>(2 * k)) = edges[k].cov;
  }
  constexpr double kStepPx = 1e-4;
  Eigen::Matrix<double, 8, 8> corners_by_lines;
  Eigen::Matrix<double, 2, 8> centre_by_lines;
  for (Eigen::Index i = 0; i < 8; ++i) {
    Eigen::Matrix<double, 8, 1> step = Eigen::Matrix<double, 8, 1>::Zero();
    step[i] = kStepPx;
    const Corners more = intersections(edges, lines + step);
    const Corners less = intersections(edges, lines - step);
    for (std::size_t k = 0; k < 4; ++k) {
      corners_by_lines.block<2, 1>(static_cast<Eigen::Index>(2 * k), i) = (more[k] - less[k]) / (2.0 * kStepPx);
    }
    centre_by_lines.col(i) = (meeting_of_diagonals(more) - meeting_of_diagonals(less)) / (2.0 * kStepPx);
  }
  result.corners_cov_px2 = corners_by_lines * cov * corners_by_lines.transpose();
  result.centre_cov_px2 = centre_by_lines * cov * centre_by_lines.transpose();
}

/// Levels beside the edge to begin with: medians of the outer halves of the strip.
bool start_levels(const std::vector<EdgePixel>& pixels, Edge& edge) {
  std::vector<double> out, in;
  for (const EdgePixel& pixel : pixels) {
    if (pixel.distance > 0.5 * edge.reach_out) out.push_back(pixel.grey);
    if (pixel.distance < -0.5 * edge.reach_in) in.push_back(pixel.grey);
  }
  if (out.size() < 4 || in.size() < 4) return false;
  edge.state[kOut] = math::median(out);
  edge.state[kIn] = math::median(in);
  return true;
}

}  // namespace

std::optional<TagEdges> fit_tag_edges(const Sampler& image, const TagPattern& pattern, const Corners& start,
                                      const TagEdgeOptions& options) {
  TagEdges result;
  result.corners_px = start;
  std::array<Edge, 4> edges;
  double contrast = 0.0;  // not known in the first round: the neighbours' light is then left in
  for (int round = 0; round < kRounds; ++round) {
    if (!is_proper(result.corners_px)) return std::nullopt;
    const TagFrame frame(pattern.layout, result.corners_px);
    const double cell_px = frame.narrowest_cell_px(pattern.layout);
    if (!(cell_px > 1.0)) return std::nullopt;
    double next_contrast = 0.0;
    for (std::size_t k = 0; k < 4; ++k) {
      Edge& edge = edges[k];
      if (round == 0) edge.state[kBlur] = std::min(0.8, 0.3 * cell_px);
      place(pattern, frame, result.corners_px, k, edge);
      const std::vector<EdgePixel> pixels = strip(image, pattern, frame, edge, contrast, options.saturated_level);
      if (pixels.size() < 2 * (kLineParameters + 2) || edge.half_length <= edge.left_out) return std::nullopt;
      if (round == 0 && !start_levels(pixels, edge)) return std::nullopt;
      edge.state[kOffset] = edge.state[kTurn] = 0.0;
      Noise noise;
      if (round > 0) noise = noise_of(pixels, edge.state);
      if (!adjust(pixels, noise, kLargestBlur * cell_px, cell_px, edge.state)) return std::nullopt;
      if (round + 1 == kRounds && !judge(pixels, noise_of(pixels, edge.state), options, edge)) return std::nullopt;
      next_contrast += 0.25 * (edge.tone_out - edge.tone_in) * (edge.state[kOut] - edge.state[kIn]);
    }
    contrast = next_contrast;
    result.corners_px = intersections(edges, lines_of(edges));
  }
  if (!is_proper(result.corners_px)) return std::nullopt;
  propagate(edges, result);
  result.contrast = contrast;
  for (const Edge& edge : edges) {
    result.blur_px += 0.25 * edge.state[kBlur];
    result.deviation_power += edge.deviation / kTagDeviationDof;
  }
  return result;
}

}  // namespace crosstie::markers::detail
