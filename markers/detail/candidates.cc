#include "markers/detail/candidates.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include <opencv2/imgproc.hpp>

namespace crosstie::markers::detail {
namespace {

/// Side of the window of the local mean: more than three radii of the smallest dots, so that dot and gap are seen together.
constexpr int kWindowPx = 31;

/// The image in 8 bits; shares the samples where they are 8-bit already.
cv::Mat eight_bit(const base::ImageView& image) {
  const int type = image.bits == 8 ? CV_8UC1 : CV_16UC1;
  const cv::Mat all(image.height, image.width, type, const_cast<std::byte*>(image.data),
                    static_cast<std::size_t>(image.row_stride_bytes));
  if (image.bits == 8) return all;
  cv::Mat grey;
  all.convertTo(grey, CV_8U, 255.0 / image.white_level);
  return grey;
}

/// Standard deviation of the noise in grey levels: from the median of second differences along sampled rows.
double noise_level(const cv::Mat& grey) {
  std::array<std::int64_t, 1024> counts{};
  std::int64_t n = 0;
  for (int y = 4; y < grey.rows; y += 8) {
    const std::uint8_t* row = grey.ptr<std::uint8_t>(y);
    for (int x = 1; x + 1 < grey.cols; x += 2) {
      ++counts[static_cast<std::size_t>(std::abs(row[x - 1] - 2 * row[x] + row[x + 1]))];
      ++n;
    }
  }
  std::int64_t below = 0;
  std::size_t median = 0;
  while (median + 1 < counts.size() && 2 * (below += counts[median]) < n) ++median;
  return 1.4826 * static_cast<double>(median) / std::sqrt(6.0);
}

/// 255 where the image exceeds (sign +1) or undercuts (sign -1) its local mean by more than `delta`.
cv::Mat mask_of(const cv::Mat& grey, const cv::Mat& mean, int delta, bool bright) {
  cv::Mat mask(grey.size(), CV_8UC1);
  for (int y = 0; y < grey.rows; ++y) {
    const std::uint8_t* g = grey.ptr<std::uint8_t>(y);
    const std::uint8_t* m = mean.ptr<std::uint8_t>(y);
    std::uint8_t* out = mask.ptr<std::uint8_t>(y);
    if (bright) {
      for (int x = 0; x < grey.cols; ++x) out[x] = g[x] > m[x] + delta ? 255 : 0;
    } else {
      for (int x = 0; x < grey.cols; ++x) out[x] = g[x] + delta < m[x] ? 255 : 0;
    }
  }
  return mask;
}

/// Largest distance of the outline from the ellipse that is let pass, and its quadratic mean.
double max_distance_px(double semi_minor_px) { return 1.0 + 0.15 * semi_minor_px; }
double rms_distance_px(double semi_minor_px) { return 0.5 + 0.06 * semi_minor_px; }

std::optional<Ellipse> ellipse_of(const std::vector<cv::Point>& outline, const DetectOptions& options, double max_radius_px) {
  if (outline.size() < 6) return std::nullopt;
  const cv::Moments m = cv::moments(outline);
  if (m.m00 < 4.0) return std::nullopt;
  Eigen::Matrix2d moments;
  moments << m.mu20, m.mu11, m.mu11, m.mu02;
  std::optional<Ellipse> ellipse = Ellipse::from_moments({m.m10 / m.m00, m.m01 / m.m00}, moments / m.m00);
  if (!ellipse) return std::nullopt;
  ellipse->semi_major_px += 0.5;  // the outline runs through the centres of the region's outermost pixels
  ellipse->semi_minor_px += 0.5;
  const double a = ellipse->semi_major_px;
  const double b = ellipse->semi_minor_px;
  if (b < options.min_radius_px - 0.5 || a > max_radius_px || b < 0.9 * options.min_axis_ratio * a) return std::nullopt;
  const Eigen::Matrix2d shape = ellipse->shape();
  const double max_px = max_distance_px(b);
  double sum = 0.0;
  for (const cv::Point& point : outline) {
    const Eigen::Vector2d e = Eigen::Vector2d(point.x, point.y) - ellipse->centre_px;
    const Eigen::Vector2d gradient = shape * e;
    const double rho = std::sqrt(e.dot(gradient));
    const double distance = (rho - 1.0) * rho / std::max(gradient.norm(), 1e-12) + 0.5;
    if (std::abs(distance) > max_px) return std::nullopt;
    sum += distance * distance;
  }
  if (std::sqrt(sum / static_cast<double>(outline.size())) > rms_distance_px(b)) return std::nullopt;
  return ellipse;
}

void add_candidates(const cv::Mat& mask, bool bright, const DetectOptions& options, std::vector<Candidate>& candidates) {
  const double max_radius_px = options.max_radius_px > 0.0 ? options.max_radius_px : 0.25 * std::min(mask.rows, mask.cols);
  std::vector<std::vector<cv::Point>> outlines;
  std::vector<cv::Vec4i> hierarchy;
  cv::findContours(mask, outlines, hierarchy, cv::RETR_CCOMP, cv::CHAIN_APPROX_SIMPLE);
  for (std::size_t i = 0; i < outlines.size(); ++i) {
    if (hierarchy[i][3] >= 0) continue;  // the outline of a hole
    if (const auto ellipse = ellipse_of(outlines[i], options, max_radius_px)) candidates.push_back({*ellipse, bright});
  }
}

}  // namespace

std::vector<Candidate> find_candidates(const base::ImageView& image, const DetectOptions& options) {
  const cv::Mat grey = eight_bit(image);
  cv::Mat mean;
  cv::blur(grey, mean, cv::Size(kWindowPx, kWindowPx));
  const int delta = static_cast<int>(std::lround(std::clamp(3.0 * noise_level(grey), 2.0, 12.0)));
  std::vector<Candidate> candidates;
  if (options.polarity != Polarity::kDarkDots) add_candidates(mask_of(grey, mean, delta, true), true, options, candidates);
  if (options.polarity != Polarity::kBrightDots) add_candidates(mask_of(grey, mean, delta, false), false, options, candidates);
  return candidates;
}

}  // namespace crosstie::markers::detail
