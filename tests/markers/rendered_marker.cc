#include "tests/markers/rendered_marker.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/LU>

namespace crosstie::tests {
namespace {

/// Rendered around the image so that the blur sees what lies beyond.
int margin_px(double blur_px) { return static_cast<int>(std::ceil(5.0 * blur_px)) + 1; }

/// Cover of a sample by the inside of a circle: `distance` from the edge in samples, positive inside.
double cover(double distance) { return std::clamp(0.5 + distance, 0.0, 1.0); }

/// Tone of a tag at a place in cells from its centre; `width` is the extent of a sample there, in cells along both axes. Paper
/// is white, and so is what is free.
double tag_tone(const MarkerScene& scene, Eigen::Vector2d p, const Eigen::Vector2d& width) {
  const markers::TagLayout& layout = *scene.family.tag;
  if (scene.mirrored) p.x() = -p.x();
  p.array() += 0.5 * layout.total_cells;
  double white = 0.0;
  // The shares of the sample's box that fall into the cells it touches.
  const Eigen::Vector2d low = p - 0.5 * width;
  const Eigen::Vector2d high = p + 0.5 * width;
  for (int y = static_cast<int>(std::floor(low.y())); y <= static_cast<int>(std::floor(high.y())); ++y) {
    for (int x = static_cast<int>(std::floor(low.x())); x <= static_cast<int>(std::floor(high.x())); ++x) {
      const double share = (std::min(high.x(), x + 1.0) - std::max(low.x(), static_cast<double>(x))) / width.x() *
                           (std::min(high.y(), y + 1.0) - std::max(low.y(), static_cast<double>(y))) / width.y();
      bool set = true;
      if (x >= 0 && y >= 0 && x < layout.total_cells && y < layout.total_cells) {
        const int cell = layout.at(x, y);
        set = cell >= 0 ? ((scene.code >> (scene.family.bits - 1 - cell)) & 1U) != 0 : cell != markers::TagLayout::kBlack;
      }
      if (set) white += share;
    }
  }
  return scene.dark_on_bright ? white : 1.0 - white;
}

/// Tone (0..1) at a place in dot radii; `gradient` is d rho / d sample at this place.
double tone(const MarkerScene& scene, const Eigen::Vector2d& p, double gradient) {
  const markers::MarkerFamily& family = scene.family;
  const double rho = p.norm();
  const auto inside = [&](double radius) { return cover((radius - rho) / gradient); };
  double value = inside(1.0);
  const double ring = scene.coded ? inside(family.ring_outer) - inside(family.ring_inner) : 0.0;
  if (ring > 0.0) {
    double angle = std::atan2(p.y(), scene.mirrored ? -p.x() : p.x());
    if (angle < 0.0) angle += 2.0 * std::numbers::pi;
    const double turns = angle / (2.0 * std::numbers::pi) * family.bits;
    const int segment = std::min(static_cast<int>(turns), family.bits - 1);
    const auto bit = [&](int s) {
      return static_cast<double>((scene.code >> (family.bits - 1 - (s + family.bits) % family.bits)) & 1U);
    };
    // Cover of the neighbouring segments near the radial edges.
    const double per_sample = gradient / std::max(rho, 0.1) / (2.0 * std::numbers::pi) * family.bits;
    const double from_start = (turns - segment) / per_sample;
    const double from_end = (segment + 1 - turns) / per_sample;
    double set = bit(segment);
    if (from_start < 0.5) set = cover(from_start) * bit(segment) + (1.0 - cover(from_start)) * bit(segment - 1);
    if (from_end < 0.5) set = cover(from_end) * bit(segment) + (1.0 - cover(from_end)) * bit(segment + 1);
    value += set * ring;
  }
  if (scene.coded && family.border_outer > family.disc_outer) value += inside(family.border_outer) - inside(family.disc_outer);
  return scene.dark_on_bright ? 1.0 - value : value;
}

/// The Gaussian of the lens and the box of the pixel on the fine grid.
std::vector<double> pixel_kernel(double blur_px, int fine) {
  const int half = static_cast<int>(std::ceil(5.0 * blur_px * fine));
  std::vector<double> kernel(static_cast<std::size_t>(2 * half + fine), 0.0);
  double sum = 0.0;
  for (int i = -half; i <= half; ++i) {
    const double weight = half == 0 ? 1.0 : std::exp(-0.5 * i * i / std::pow(blur_px * fine, 2));
    for (int k = 0; k < fine; ++k) kernel[static_cast<std::size_t>(i + half + k)] += weight;
    sum += weight * fine;
  }
  for (double& weight : kernel) weight /= sum;
  return kernel;
}

/// One pixel out of `fine` samples along the rows, written as columns: twice this makes the image.
std::vector<double> reduced_rows(const std::vector<double>& samples, int rows, int width_px, const MarkerScene& scene,
                                 const std::vector<double>& kernel) {
  const int fine = scene.samples_per_px;
  const int margin = margin_px(scene.blur_px);
  const int stride = (width_px + 2 * margin) * fine;
  const int reach = (static_cast<int>(kernel.size()) - fine) / 2;
  std::vector<double> result(static_cast<std::size_t>(rows) * static_cast<std::size_t>(width_px));
  for (int y = 0; y < rows; ++y) {
    const double* line = samples.data() + static_cast<std::ptrdiff_t>(y) * stride;
    for (int x = 0; x < width_px; ++x) {
      const double* first = line + (x + margin) * fine - reach;
      double value = 0.0;
      for (std::size_t i = 0; i < kernel.size(); ++i) value += kernel[i] * first[i];
      result[static_cast<std::size_t>(x) * static_cast<std::size_t>(rows) + static_cast<std::size_t>(y)] = value;
    }
  }
  return result;
}

}  // namespace

std::vector<double> rendered(const MarkerScene& scene) {
  const int fine = scene.samples_per_px;
  const int margin = margin_px(scene.blur_px);
  const int width = (scene.width_px + 2 * margin) * fine;
  const int height = (scene.height_px + 2 * margin) * fine;
  const double c = std::cos(scene.tilt_axis_rad);
  const double s = std::sin(scene.tilt_axis_rad);
  Eigen::Matrix2d to_axis, roll;
  to_axis << c, s, -s, c;
  roll << std::cos(scene.roll_rad), std::sin(scene.roll_rad), -std::sin(scene.roll_rad), std::cos(scene.roll_rad);
  const Eigen::Matrix2d stretch = Eigen::Vector2d(1.0, 1.0 / std::cos(scene.tilt_rad)).asDiagonal();
  const Eigen::Matrix2d marker_from_pixel = roll * stretch * to_axis / scene.radius_px;
  const Eigen::Matrix2d metric = marker_from_pixel.transpose() * marker_from_pixel;

  std::vector<double> samples(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d pixel((x + 0.5) / fine - 0.5 - margin, (y + 0.5) / fine - 0.5 - margin);
      const Eigen::Vector2d e = pixel - scene.centre_px;
      const double depth = 1.0 + scene.perspective.dot(e);
      const Eigen::Vector2d p = marker_from_pixel * e / depth;
      const double light = 1.0 + scene.light_slope.dot(e);
      double value = 0.0;
      if (scene.family.tag) {
        const Eigen::Matrix2d by_pixel = (marker_from_pixel - p * scene.perspective.transpose()) / depth;
        value = tag_tone(scene, p, by_pixel.rowwise().norm() / fine);
      } else {
        const double gradient = (metric * e).norm() / std::max(p.norm(), 1e-9) / fine;
        value = tone(scene, p, std::max(gradient, 1e-9));
      }
      const double level = scene.dark_level + (scene.bright_level - scene.dark_level) * value;
      samples[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)] = level * light;
    }
  }
  const std::vector<double> kernel = pixel_kernel(scene.blur_px, fine);
  const std::vector<double> columns = reduced_rows(samples, height, scene.width_px, scene, kernel);
  return reduced_rows(columns, scene.width_px, scene.height_px, scene, kernel);
}

base::Image photograph(const std::vector<double>& levels, int width_px, int height_px, const Noise& noise, int bits,
                       double white_level) {
  base::Image image(width_px, height_px, bits);
  image.set_white_level(white_level);
  std::mt19937_64 random(noise.seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::size_t i = 0;
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x, ++i) {
      const double value = std::clamp(std::round(levels[i] + noise.sigma * normal(random)), 0.0, white_level);
      if (bits == 8) {
        image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(value);
      } else {
        image.row<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(value);
      }
    }
  }
  return image;
}

}  // namespace crosstie::tests
