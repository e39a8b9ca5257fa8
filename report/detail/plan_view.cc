#include "report/detail/plan_view.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>

#include "report/detail/number.h"
#include "report/detail/plot.h"

namespace crosstie::report::detail {
namespace {

constexpr double kWidth_px = 560.0;
constexpr double kDigit_px = 5.6;  // of a label, and its height
constexpr double kLabelHeight_px = 9.0;
constexpr std::size_t kMaxLabels = 300;
constexpr double kWantedFraction = 1.0 / 16.0;

struct Extent {
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
};

/// How far a point's ellipse reaches along each axis as it is drawn; a wild one does not take the room of the others.
Eigen::Vector3d reach(const PlanPoint& point, const PlanOptions& options, double most_mm) {
  if (!options.ellipses || !point.cov_mm2.allFinite()) return Eigen::Vector3d::Zero();
  return (options.magnification * point.cov_mm2.diagonal().cwiseMax(0.0).cwiseSqrt()).cwiseMin(most_mm);
}

Extent extent(const std::vector<PlanPoint>& points) {
  Extent box;
  bool first = true;
  for (const PlanPoint& point : points) {
    if (!point.xyz_mm.allFinite()) continue;
    box.low = first ? point.xyz_mm : Eigen::Vector3d(box.low.cwiseMin(point.xyz_mm));
    box.high = first ? point.xyz_mm : Eigen::Vector3d(box.high.cwiseMax(point.xyz_mm));
    first = false;
  }
  return box;
}

double round_to_125(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  for (const double mantissa : {5.0, 2.0}) {
    if (value >= mantissa * power) return mantissa * power;
  }
  return power;
}

void draw_ellipse(Plot& plot, const PlanPoint& point, const PlanOptions& options) {
  Eigen::Matrix2d cov;
  cov << point.cov_mm2(options.horizontal, options.horizontal), point.cov_mm2(options.horizontal, options.vertical),
      point.cov_mm2(options.vertical, options.horizontal), point.cov_mm2(options.vertical, options.vertical);
  if (!cov.allFinite() || cov.isZero(0.0)) return;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(cov);
  const Eigen::Vector2d semi = eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt() * options.magnification * plot.scale_x();
  const Eigen::Vector2d major = eigen.eigenvectors().col(1);
  plot.svg().ellipse(plot.x_px(point.xyz_mm(options.horizontal)), plot.y_px(point.xyz_mm(options.vertical)), semi(1), semi(0),
                     -std::atan2(major.y(), major.x()), "ellipse", point.tooltip);
}

/// Where labels stand already, so that none is written over another.
class Labels {
 public:
  /// Whether a text that begins at (x, y) is free of the others; it is taken then.
  bool take(double x, double y, std::size_t digits) {
    const double width = kDigit_px * (static_cast<double>(digits) + 1.0);  // one for the gap
    for (const Box& box : taken_) {
      if (x < box.x + box.width && box.x < x + width && std::abs(y - box.y) < kLabelHeight_px) return false;
    }
    if (taken_.size() >= kMaxLabels) return false;
    taken_.push_back({x, y, width});
    return true;
  }

 private:
  struct Box {
    double x, y, width;
  };
  std::vector<Box> taken_;
};

/// How long a magnified millimetre or micrometre is.
void draw_key(Plot& plot, const PlanOptions& options) {
  const double length_mm = round_to_125(90.0 / (plot.scale_x() * options.magnification));
  const double width = length_mm * plot.scale_x() * options.magnification;
  const bool micro = length_mm < 0.1;
  plot.svg().line(plot.left(), 13.0, plot.left() + width, 13.0, options.arrows ? "arrow" : "whisker");
  plot.svg().text(plot.left() + width + 6.0, 17.0,
                  fmt::format("{} {} ({} magnified {} times)", significant(micro ? 1000.0 * length_mm : length_mm, 1),
                              micro ? "\u00b5m" : "mm", options.arrows ? "deviations" : "1-sigma ellipses",
                              significant(options.magnification, 2)),
                  "start", "tick");
}

}  // namespace

double plan_magnification(const std::vector<PlanPoint>& points, double typical_mm) {
  const Extent box = extent(points);
  const double size = (box.high - box.low).maxCoeff();
  if (!(size > 0.0) || !(typical_mm > 0.0) || !std::isfinite(typical_mm)) return 1.0;
  return std::max(1.0, round_to_125(kWantedFraction * size / typical_mm));
}

std::vector<std::pair<int, int>> plan_axes(const std::vector<PlanPoint>& points) {
  const Extent box = extent(points);
  int thinnest = 2;
  for (int axis = 1; axis >= 0; --axis) {
    if ((box.high - box.low)(axis) < (box.high - box.low)(thinnest)) thinnest = axis;
  }
  const int first = thinnest == 0 ? 1 : 0;
  const int second = 3 - thinnest - first;
  return {{first, second}, {first, thinnest}};
}

std::string plan_view(const std::vector<PlanPoint>& points, std::string_view title, const PlanOptions& options) {
  Extent box = extent(points);
  const double size = std::max(1e-6, (box.high - box.low).maxCoeff());
  const double margin = 0.06 * size;
  for (const PlanPoint& point : points) {
    if (!point.xyz_mm.allFinite()) continue;
    const Eigen::Vector3d around = reach(point, options, 0.4 * size) - Eigen::Vector3d::Constant(0.6 * margin);
    box.low = box.low.cwiseMin(point.xyz_mm - around);
    box.high = box.high.cwiseMax(point.xyz_mm + around);
  }
  const auto axis = [&](int which) { return make_axis(box.low(which) - margin, box.high(which) + margin, 6, false); };
  const std::string names = "xyz";
  Plot plot(
      title, fmt::format("Plan view of {} points, magnified {} times", points.size(), significant(options.magnification, 2)),
      axis(options.horizontal), axis(options.vertical),
      fmt::format("{} [mm]", names[static_cast<std::size_t>(options.horizontal)]),
      fmt::format("{} [mm]", names[static_cast<std::size_t>(options.vertical)]), {.width_px = kWidth_px, .equal_scale = true});
  draw_key(plot, options);
  Labels labels;
  for (const PlanPoint& point : points) {
    const double x = plot.x_px(point.xyz_mm(options.horizontal));
    const double y = plot.y_px(point.xyz_mm(options.vertical));
    if (!std::isfinite(x) || !std::isfinite(y)) continue;
    if (options.ellipses) draw_ellipse(plot, point, options);
    plot.point(point.xyz_mm(options.horizontal), point.xyz_mm(options.vertical), point.hollow ? "ring" : "dot", "",
               point.tooltip, point.hollow ? 2.2 : 1.6);
    if (options.arrows) {
      const double scale = options.magnification * plot.scale_x();
      plot.svg().arrow(x, y, x + scale * point.deviation_mm(options.horizontal),
                       y - scale * point.deviation_mm(options.vertical), "arrow");
    }
    const std::string id = std::to_string(point.id);
    if (labels.take(x + 4.0, y - 4.0, id.size())) plot.svg().text(x + 4.0, y - 4.0, id, "start", "id");
  }
  return plot.str();
}

}  // namespace crosstie::report::detail
