#include "tests/scan/synthetic_scan.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace crosstie::tests {
namespace {

constexpr double kProjectorSpread = 0.5;  // tangents from -0.25 to 0.25
const Eigen::Vector3d kProjector(150.0, 20.0, 0.0);

base::Camera lens(int width, int height, double k1) {
  Eigen::VectorXd p(9);
  p << 500.0, 502.0, 0.5 * width + 3.0, 0.5 * height - 2.0, k1, 0.05, 1e-3, -5e-4, 0.0;
  return *base::Camera::make(base::LensModel::kOpenCv5, width, height, p);
}

/// The Gray code's bit of a word.
bool gray_bit(int word, int bit, int bits) { return (((word ^ (word >> 1)) >> (bits - 1 - bit)) & 1) != 0; }

}  // namespace

SyntheticScan::SyntheticScan()
    : head{"left",
           "right",
           lens(320, 240, -0.12),
           lens(320, 240, -0.10),
           base::Pose{base::rotation_exp({0.01, 0.22, -0.008}), Eigen::Vector3d(-300.0, 4.0, 30.0)},
           {},
           {}},
      surface(tilted_plane(1200.0, 0.1)) {}

const std::optional<SyntheticScan::Seen>& SyntheticScan::seen(int camera, int x, int y) const {
  auto& all = seen_[static_cast<std::size_t>(camera)];
  if (all.empty()) {
    for (int row = 0; row < height; ++row) {
      for (int column = 0; column < width; ++column) all.push_back(trace(camera, column, row));
    }
  }
  return all[static_cast<std::size_t>(y * width + x)];
}

std::optional<SyntheticScan::Seen> SyntheticScan::trace(int camera, int x, int y) const {
  const auto ray = (camera == 0 ? head.left : head.right).unproject(Eigen::Vector2d(x, y));
  if (!ray) return {};
  const base::Pose left_from_camera = camera == 0 ? base::Pose{} : head.right_from_left.inverse();
  const Eigen::Vector3d direction = left_from_camera.rotation * *ray;
  const auto distance = surface(left_from_camera.translation_mm, direction);
  if (!distance) return {};
  Seen result;
  result.point_mm = left_from_camera.translation_mm + *distance * direction;
  const Eigen::Vector3d from_projector = result.point_mm - kProjector;
  result.u = (from_projector.x() / from_projector.z() + 0.12) / kProjectorSpread + 0.5;
  result.v = from_projector.y() / from_projector.z() / kProjectorSpread + 0.5;
  if (result.u < 0.0 || result.u >= 1.0 || result.v < 0.0 || result.v >= 1.0) return {};
  return result;
}

base::Image SyntheticScan::image(int camera, const base::PatternSequence& sequence, const base::Pattern& pattern,
                                 std::mt19937_64& random) const {
  std::normal_distribution<double> normal;
  base::Image image(width, height, bits);
  image.set_white_level(white);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      double light = 0.0;
      if (const auto& here = seen(camera, x, y)) {
        const base::AxisCode& code = sequence.code(pattern.axis);
        const double at = pattern.axis == base::ProjectorAxis::kX ? here->u : here->v;
        double level = pattern.kind == base::PatternKind::kWhite ? 2.0 : 0.0;
        if (pattern.kind == base::PatternKind::kFringe) {
          const double turns = code.fringes[static_cast<std::size_t>(pattern.frequency)] * at;
          level = 1.0 + std::cos(2.0 * std::numbers::pi * (turns - pattern.shift));
        } else if (pattern.kind == base::PatternKind::kGray || pattern.kind == base::PatternKind::kGrayInverse) {
          const double turns = code.fringes[static_cast<std::size_t>(code.finest())] * at;
          const int word = std::clamp(static_cast<int>(std::floor(turns / code.word_periods - code.word_offset.value_or(0.0))),
                                      0, (1 << code.gray_bits) - 1);
          const bool set = gray_bit(word, pattern.bit, code.gray_bits);
          level = set == (pattern.kind == base::PatternKind::kGray) ? 2.0 : 0.0;
        }
        const double shown = 2.0 * std::pow(0.5 * level, gamma);
        light = pattern.exposure * albedo(here->u, here->v) * (ambient + amplitude * shown);
      }
      const double noisy = light + std::sqrt(read_sigma * read_sigma + shot * light) * normal(random);
      const double grey = std::clamp(std::round(noisy), 0.0, white);
      if (bits == 8) {
        image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(grey);
      } else {
        image.row<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(grey);
      }
    }
  }
  return image;
}

std::function<std::optional<double>(const Eigen::Vector3d&, const Eigen::Vector3d&)> tilted_plane(double z_mm,
                                                                                                  double tilt_rad) {
  const Eigen::Vector3d normal(std::sin(tilt_rad), 0.0, std::cos(tilt_rad));
  return [=](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) -> std::optional<double> {
    const double distance = (z_mm * normal.z() - normal.dot(origin)) / normal.dot(direction);
    if (distance <= 0.0) return {};
    return distance;
  };
}

base::PatternSequence gray_and_fringes(double fringes, int steps, bool inverse, bool both_axes) {
  base::PatternSequence sequence;
  int bits = 1;
  while (0.5 * std::pow(2.0, bits) < fringes) ++bits;
  for (const base::ProjectorAxis axis : {base::ProjectorAxis::kX, base::ProjectorAxis::kY}) {
    if (axis == base::ProjectorAxis::kY && !both_axes) break;
    (axis == base::ProjectorAxis::kX ? sequence.x : sequence.y) = {{fringes}, bits, 0.5, 0.0};
    for (int bit = 0; bit < bits; ++bit) {
      base::Pattern pattern;
      pattern.kind = base::PatternKind::kGray;
      pattern.axis = axis;
      pattern.bit = bit;
      sequence.patterns.push_back(pattern);
      if (!inverse) continue;
      pattern.kind = base::PatternKind::kGrayInverse;
      sequence.patterns.push_back(pattern);
    }
    for (int step = 0; step < steps; ++step) {
      base::Pattern pattern;
      pattern.kind = base::PatternKind::kFringe;
      pattern.axis = axis;
      pattern.shift = static_cast<double>(step) / steps;
      sequence.patterns.push_back(pattern);
    }
  }
  return sequence;
}

}  // namespace crosstie::tests
