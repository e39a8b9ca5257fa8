#include "report/detail/scene.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <numbers>

#include <fmt/format.h>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "base/base64.h"
#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

using base::AdjustedCamera;
using base::AdjustedImage;
using base::AdjustedNetwork;
using Eigen::Vector3d;

std::string number(double value) { return std::isfinite(value) ? fmt::format("{:.9g}", value) : "0"; }

std::string list(const std::vector<std::string>& items) {
  std::string text = "[";
  for (std::size_t i = 0; i < items.size(); ++i) text += (i > 0 ? "," : "") + items[i];
  return text + "]";
}

std::string triple(const Vector3d& v) { return list({number(v.x()), number(v.y()), number(v.z())}); }

std::string quoted_list(const std::vector<std::string>& texts) {
  std::vector<std::string> items;
  for (const std::string& text : texts) items.push_back(json_quoted(text));
  return list(items);
}

std::string axes_list(const Eigen::Matrix3d& axes) {
  std::vector<std::string> items;
  for (Eigen::Index i = 0; i < 9; ++i) items.push_back(number(axes(i % 3, i / 3)));
  return list(items);
}

/// Where the first view looks and which way is up in it.
struct Orientation {
  Vector3d towards = -Vector3d::UnitZ();
  Vector3d up = Vector3d::UnitY();
};

Orientation facing_thinnest(const std::vector<Vector3d>& points) {
  Orientation orientation;
  if (points.empty()) return orientation;
  Vector3d low = points.front();
  Vector3d high = points.front();
  for (const Vector3d& point : points) {
    low = low.cwiseMin(point);
    high = high.cwiseMax(point);
  }
  Eigen::Index thinnest = 0;
  (high - low).minCoeff(&thinnest);
  orientation.towards = -Vector3d::Unit(thinnest);
  orientation.up = Vector3d::Unit(thinnest == 2 ? 1 : 2);
  return orientation;
}

Orientation facing_as_cameras(const AdjustedNetwork& network) {
  std::vector<Vector3d> points;
  for (const base::AdjustedPoint& point : network.points) points.push_back(point.xyz_mm);
  Orientation orientation = facing_thinnest(points);
  Vector3d towards = Vector3d::Zero();
  Vector3d up = Vector3d::Zero();
  for (const AdjustedImage& image : network.images) {
    towards += image.network_from_camera.rotation * Vector3d::UnitZ();
    up -= image.network_from_camera.rotation * Vector3d::UnitY();
  }
  const auto count = static_cast<double>(network.images.size());
  if (towards.norm() > 0.2 * count && towards.allFinite()) orientation.towards = towards.normalized();
  up -= up.dot(orientation.towards) * orientation.towards;
  if (up.norm() > 0.1 * count && up.allFinite()) {
    orientation.up = up.normalized();
  } else {
    orientation.up = orientation.towards.unitOrthogonal();
  }
  return orientation;
}

std::string camera_json(const AdjustedImage& image, const AdjustedCamera* camera, std::size_t group) {
  std::vector<std::string> corners;
  for (const auto& [right, bottom] : {std::pair(0, 0), std::pair(1, 0), std::pair(1, 1), std::pair(0, 1)}) {
    Vector3d direction(right == 1 ? 0.6 : -0.6, bottom == 1 ? 0.4 : -0.4, 1.0);
    if (camera != nullptr) {
      const base::Camera& lens = camera->camera;
      const Eigen::Vector2d pixel(right * lens.width_px() - 0.5, bottom * lens.height_px() - 0.5);
      const auto ray = lens.unproject(pixel);
      const Eigen::VectorXd& p = lens.parameters();
      direction = ray ? Vector3d(*ray / ray->z()) : Vector3d((pixel.x() - p(2)) / p(0), (pixel.y() - p(3)) / p(1), 1.0);
    }
    corners.push_back(triple(image.network_from_camera.rotation * direction));
  }
  return fmt::format("{{\"name\":{},\"centre\":{},\"corners\":{},\"group\":{}}}", json_quoted(image.name),
                     triple(image.network_from_camera.translation_mm), list(corners), group);
}

std::string scene(const std::vector<std::string>& points, const std::vector<std::string>& cameras,
                  const std::vector<std::string>& bars, const std::string& legend, const std::vector<double>& values,
                  double magnification, const Orientation& orientation, const std::string& more = "") {
  // Single wild values do not take the colours from the rest.
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  const double largest = sorted.empty() ? 1.0 : sorted.back();
  const double usual = sorted.empty() ? 1.0 : sorted[sorted.size() * 95 / 100];
  const bool open = largest > 2.0 * usual && usual > 0.0;
  const double high = open ? usual : largest;
  const double low = sorted.empty() ? 0.0 : sorted.front();
  return fmt::format(
      "{{\"points\":{},\n\"cameras\":{},\n\"bars\":{},\n\"legend\":{{\"label\":{},\"min\":{},\"max\":{},\"open\":{}}},\n"
      "\"magnification\":{},\"up\":{},\"towards\":{}{}}}",
      list(points), list(cameras), list(bars), json_quoted(legend), number(low), number(high), open, number(magnification),
      triple(orientation.up), triple(orientation.towards), more);
}

/// The scene's member "cloud", with the comma before it.
std::string cloud_member(const ShownCloud& cloud) {
  Vector3d low = Vector3d::Constant(std::numeric_limits<double>::infinity());
  Vector3d high = -low;
  for (const ShownCloud::Point& point : cloud.points) {
    if (!point.xyz_mm.allFinite()) continue;
    low = low.cwiseMin(point.xyz_mm);
    high = high.cwiseMax(point.xyz_mm);
  }
  if (!low.allFinite()) return {};
  const Vector3d centre = (0.5 * (low + high)).array().round();
  std::string bytes;
  bytes.reserve(cloud.points.size() * 20);
  const auto add = [&](double value) {
    const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(value));
    for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(bits >> shift & 0xFFU);
  };
  for (const ShownCloud::Point& point : cloud.points) {
    if (!point.xyz_mm.allFinite()) continue;
    for (Eigen::Index i = 0; i < 3; ++i) add(point.xyz_mm(i) - centre(i));
    add(point.value);
    add(point.sigma);
  }
  return fmt::format(
      ",\n\"cloud\":{{\"centre\":{},\"value\":{},\"unit\":{},\"none\":{},\"sigma\":{},\"sigma_unit\":{},\n\"data\":\"{}\"}}",
      triple(centre), json_quoted(cloud.value), json_quoted(cloud.unit), json_quoted(cloud.none), json_quoted(cloud.sigma),
      json_quoted(cloud.sigma_unit), base::base64(bytes));
}

}  // namespace

Eigen::Matrix3d ellipsoid_axes(const Eigen::Matrix3d& cov) {
  if (!cov.allFinite()) return Eigen::Matrix3d::Zero();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(cov);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

double largest_sigma(const Eigen::Matrix3d& cov) { return ellipsoid_axes(cov).colwise().norm().maxCoeff(); }

std::string network_scene(const AdjustedNetwork& network, double magnification) {
  std::vector<double> sigmas;
  for (const base::AdjustedPoint& point : network.points) sigmas.push_back(largest_sigma(point.cov_mm2));
  const LengthUnit unit = unit_for_lengths(sigmas);

  std::vector<std::vector<std::string>> seen(network.points.size());
  for (const base::AdjustedObservation& observation : network.residuals) {
    const auto point = static_cast<std::size_t>(observation.point);
    if (point < seen.size()) seen[point].push_back(std::to_string(observation.image));
  }
  std::vector<std::string> points;
  std::vector<double> values;
  std::map<int, Vector3d> by_id;
  for (std::size_t i = 0; i < network.points.size(); ++i) {
    const base::AdjustedPoint& point = network.points[i];
    if (!point.xyz_mm.allFinite()) continue;
    by_id.emplace(point.id, point.xyz_mm);
    values.push_back(sigmas[i] * unit.per_mm);
    const bool coded = point.kind == "coded";
    std::vector<std::string> about = {fmt::format("Point {}{}", point.id, coded ? "" : fmt::format(" ({})", point.kind))};
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      about.push_back(
          fmt::format("{} = {}", "xyz"[axis], with_sigma(point.xyz_mm(axis), std::sqrt(point.cov_mm2(axis, axis)), "mm")));
    }
    about.push_back(
        fmt::format("{} rays, largest angle {}\u00b0", point.rays, fixed(point.angle_rad * 180.0 / std::numbers::pi, 0)));
    points.push_back(fmt::format("{{\"id\":\"{}\",\"p\":{},\"axes\":{},\"value\":{},\"about\":{},\"seen\":{}{}}}", point.id,
                                 triple(point.xyz_mm), axes_list(ellipsoid_axes(point.cov_mm2)), number(values.back()),
                                 quoted_list(about), list(seen[i]), coded ? "" : ",\"ring\":true"));
  }
  std::vector<std::string> cameras;
  for (const AdjustedImage& image : network.images) {
    const auto camera = std::find_if(network.cameras.begin(), network.cameras.end(),
                                     [&](const AdjustedCamera& one) { return one.name == image.camera; });
    const bool found = camera != network.cameras.end();
    cameras.push_back(
        camera_json(image, found ? &*camera : nullptr, static_cast<std::size_t>(camera - network.cameras.begin())));
  }
  std::vector<std::string> bars;
  for (const base::AdjustedScaleBar& bar : network.scale_bars) {
    const auto a = by_id.find(bar.bar.id_a);
    const auto b = by_id.find(bar.bar.id_b);
    if (a == by_id.end() || b == by_id.end()) continue;
    bars.push_back(fmt::format("{{\"a\":{},\"b\":{},\"name\":\"{}-{}\"}}", triple(a->second), triple(b->second), bar.bar.id_a,
                               bar.bar.id_b));
  }
  return scene(points, cameras, bars, fmt::format("Largest sigma [{}]", unit.name), values, magnification,
               facing_as_cameras(network));
}

std::string points_scene(const std::vector<ShownPoint>& shown, const std::string& legend, double magnification,
                         const ShownCloud& cloud, const std::string& rings) {
  std::vector<std::string> points;
  std::vector<Vector3d> places;
  std::vector<double> values;
  for (const ShownPoint& point : shown) {
    if (!point.xyz_mm.allFinite()) continue;
    places.push_back(point.xyz_mm);
    values.push_back(point.value);
    points.push_back(fmt::format("{{\"id\":{},\"p\":{},\"axes\":{},\"value\":{},\"about\":{},\"seen\":[]{}}}",
                                 json_quoted(point.id), triple(point.xyz_mm),
                                 point.cov_mm2.isZero(0.0) ? "[]" : axes_list(ellipsoid_axes(point.cov_mm2)),
                                 number(point.value), quoted_list(point.about), point.ring ? ",\"ring\":true" : ""));
  }
  if (!cloud.points.empty()) values = {0.0};  // the legend is the cloud's, and begins where nothing differs
  for (const ShownCloud::Point& point : cloud.points) {
    if (!point.xyz_mm.allFinite()) continue;
    places.push_back(point.xyz_mm);
    if (std::isfinite(point.value)) values.push_back(point.value);
  }
  std::string more = cloud.points.empty() ? "" : cloud_member(cloud);
  if (!rings.empty()) more += fmt::format(",\n\"rings\":{}", json_quoted(rings));
  return scene(points, {}, {}, legend, values, magnification, facing_thinnest(places), more);
}

std::string verification_scene(const base::Verification& verification, double magnification) {
  std::vector<double> lengths;
  std::vector<Vector3d> places;
  for (const base::Deviation& deviation : verification.points) lengths.push_back(deviation.deviation_mm.norm());
  const LengthUnit unit = unit_for_lengths(lengths);
  std::vector<std::string> points;
  std::vector<double> values;
  for (const base::Deviation& deviation : verification.points) {
    if (!deviation.reference_mm.allFinite() || !deviation.deviation_mm.allFinite()) continue;
    places.push_back(deviation.reference_mm);
    values.push_back(deviation.deviation_mm.norm() * unit.per_mm);
    std::vector<std::string> about = {fmt::format("Point {}{}", deviation.id, deviation.used ? "" : " (not in the fit)")};
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      about.push_back(fmt::format(
          "d{} = {}", "xyz"[axis],
          with_sigma(deviation.deviation_mm(axis) * unit.per_mm, deviation.sigma_mm(axis) * unit.per_mm, unit.name)));
    }
    points.push_back(fmt::format("{{\"id\":\"{}\",\"p\":{},\"axes\":[],\"value\":{},\"about\":{},\"seen\":[],\"d\":{}}}",
                                 deviation.id, triple(deviation.reference_mm), number(values.back()), quoted_list(about),
                                 triple(deviation.deviation_mm)));
  }
  return scene(points, {}, {}, fmt::format("3D deviation [{}]", unit.name), values, magnification, facing_thinnest(places));
}

std::string cloud_scene(const std::vector<Eigen::Vector4d>& cloud) {
  std::vector<double> sigmas;
  for (const Eigen::Vector4d& point : cloud) sigmas.push_back(point.w());
  const LengthUnit unit = unit_for_lengths(sigmas);
  ShownCloud shown;
  shown.sigma_unit = unit.name;
  std::vector<double> values;
  for (const Eigen::Vector4d& point : cloud) {
    if (!point.allFinite()) continue;
    values.push_back(point.w() * unit.per_mm);
    shown.points.push_back({point.head<3>(), values.back(), values.back()});
  }
  return scene({}, {}, {}, fmt::format("Sigma [{}]", unit.name), values, 1.0, {Vector3d::UnitZ(), -Vector3d::UnitY()},
               cloud_member(shown));
}

}  // namespace crosstie::report::detail
