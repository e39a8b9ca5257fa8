#include "base/aicon_files.h"

#include <cmath>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "base/detail/word_scanner.h"
#include "base/file.h"

namespace crosstie::base {
namespace {

using detail::WordScanner;

constexpr std::size_t kMaxAiconBytes = std::size_t{1} << 30;

/// Reads entries with `entry(scanner)` to the end of the file; `key(entry)` tells entries apart.
template <typename T, typename Entry, typename Key>
Result<std::vector<T>> read_entries(const std::filesystem::path& path, Entry entry, Key key) {
  const auto text = read_file(path, kMaxAiconBytes);
  if (!text) return tl::unexpected<Error>(text.error());
  WordScanner scanner(path, *text);
  std::vector<T> entries;
  std::set<decltype(key(std::declval<T>()))> seen;
  while (scanner.next_line()) {
    entries.push_back(entry(scanner));
    scanner.expect_line_end();
    if (!scanner.failed() && !seen.insert(key(entries.back())).second) scanner.refuse("this entry stands there twice");
  }
  if (scanner.failed()) return scanner.failure();
  if (entries.empty()) return fail(ErrorCode::kBadInput, fmt::format("{}: the file holds nothing", shown(path)));
  return entries;
}

Eigen::Vector2d pair(WordScanner& scanner, const char* what) {
  const double first = scanner.number(what);
  return {first, scanner.number(what)};
}

Eigen::Vector3d triple(WordScanner& scanner, const char* what) {
  const Eigen::Vector2d first = pair(scanner, what);
  return {first.x(), first.y(), scanner.number(what)};
}

std::optional<Eigen::Vector3d> sigmas(WordScanner& scanner) {
  Eigen::Vector3d values = Eigen::Vector3d::Zero();
  int given = 0;
  for (double& value : values) {
    const auto sigma = scanner.sigma("sigma");
    given += sigma.has_value() ? 1 : 0;
    value = sigma.value_or(0.0);
  }
  if (given != 0 && given != 3) scanner.refuse("sigmas for some of the three coordinates only");
  return given == 3 ? std::optional(values) : std::nullopt;
}

/// The next line of an entry of several lines.
void continue_entry(WordScanner& scanner) {
  scanner.expect_line_end();
  if (!scanner.next_line()) scanner.refuse("the camera's five lines are not all there");
}

AiconCamera read_camera_entry(WordScanner& scanner) {
  AiconCamera camera;
  camera.id = scanner.id("camera id");
  static_cast<void>(scanner.integer("integer"));  // -999
  camera.c_mm = -scanner.number("principal distance");
  if (!(camera.c_mm > 0.0)) scanner.refuse("the principal distance is stored with a minus sign and is not zero");
  camera.principal_point_mm = pair(scanner, "principal point");
  camera.a1 = scanner.number("A1");
  camera.a2 = scanner.number("A2");
  camera.r0_mm = scanner.number("r0");
  if (camera.r0_mm < 0.0) scanner.refuse("r0 is negative");
  continue_entry(scanner);
  camera.a3 = scanner.number("A3");
  continue_entry(scanner);
  camera.b1 = scanner.number("B1");
  camera.b2 = scanner.number("B2");
  continue_entry(scanner);
  camera.c1 = scanner.number("C1");
  camera.c2 = scanner.number("C2");
  continue_entry(scanner);
  camera.sensor_mm = pair(scanner, "sensor size");
  camera.width_px = scanner.id("number of pixels");
  camera.height_px = scanner.id("number of pixels");
  if (!(camera.sensor_mm.minCoeff() > 0.0) || camera.width_px == 0 || camera.height_px == 0) {
    scanner.refuse("the sensor has no area");
  }
  return camera;
}

}  // namespace

Result<std::vector<AiconImagePoint>> read_aicon_image_points(const std::filesystem::path& phc) {
  return read_entries<AiconImagePoint>(
      phc,
      [](WordScanner& scanner) {
        AiconImagePoint point;
        point.image = scanner.id("image id");
        point.point = scanner.id("point id");
        point.xy_mm = pair(scanner, "image coordinate");
        point.sigma_mm = pair(scanner, "sigma");
        if (point.sigma_mm.minCoeff() < 0.0) scanner.refuse("a sigma is negative");
        point.residual_mm = pair(scanner, "residual");
        point.method = scanner.integer("method");
        point.active = scanner.integer("flag (active)") != 0;
        point.internal = scanner.integer("flag (internal)");
        return point;
      },
      // A point that two dots of an image may be is listed twice, so rows are told apart by where they are.
      [](const AiconImagePoint& point) { return std::tuple(point.image, point.point, point.xy_mm.x(), point.xy_mm.y()); });
}

Result<std::vector<AiconObjectPoint>> read_aicon_object_points(const std::filesystem::path& obc) {
  return read_entries<AiconObjectPoint>(
      obc,
      [](WordScanner& scanner) {
        AiconObjectPoint point;
        point.id = scanner.id("point id");
        point.xyz_mm = triple(scanner, "coordinate");
        point.sigma_mm = sigmas(scanner);
        point.rays = scanner.id("number of rays");
        point.active = scanner.integer("flag (active)") != 0;
        if (!scanner.at_line_end()) point.is_new = scanner.integer("flag (new)") != 0;
        if (!scanner.at_line_end()) point.datum = scanner.integer("flag (datum)") != 0;
        return point;
      },
      [](const AiconObjectPoint& point) { return point.id; });
}

Result<std::vector<AiconImage>> read_aicon_images(const std::filesystem::path& eor) {
  return read_entries<AiconImage>(
      eor,
      [](WordScanner& scanner) {
        AiconImage image;
        image.image = scanner.id("image id");
        image.camera = scanner.id("camera id");
        image.position_mm = triple(scanner, "coordinate");
        image.omega_phi_kappa_rad = triple(scanner, "angle");
        image.rotation_order = scanner.integer("rotation order");
        image.status = scanner.integer("status");
        image.orientation_status = scanner.integer("orientation status");
        return image;
      },
      [](const AiconImage& image) { return image.image; });
}

Result<std::vector<AiconCamera>> read_aicon_cameras(const std::filesystem::path& ior) {
  return read_entries<AiconCamera>(ior, read_camera_entry, [](const AiconCamera& camera) { return camera.id; });
}

Result<std::vector<AiconScale>> read_aicon_scales(const std::filesystem::path& scale) {
  return read_entries<AiconScale>(
      scale,
      [](WordScanner& scanner) {
        AiconScale entry;
        static_cast<void>(scanner.integer("number"));
        entry.name = scanner.quoted("name");
        entry.id_a = scanner.id("point id");
        entry.id_b = scanner.id("point id");
        if (entry.id_a == entry.id_b) scanner.refuse("both ends are the same point");
        entry.length_mm = scanner.number("length");
        entry.sigma_mm = scanner.number("sigma");
        if (!(entry.length_mm > 0.0) || entry.sigma_mm < 0.0) scanner.refuse("a length is positive, its sigma not negative");
        entry.active = scanner.integer("flag (active)") != 0;
        return entry;
      },
      [](const AiconScale& entry) { return std::tuple(entry.id_a, entry.id_b, entry.name); });
}

Result<> write_aicon_object_points(const std::filesystem::path& obc, const PointList& list) {
  std::string text;
  for (const ReferencePoint& point : list.points) {
    text += fmt::format("{:10}", point.id);
    for (const double value : point.xyz_mm) text += fmt::format(" {:18.9f}", value);
    for (int i = 0; i < 3; ++i) {
      text += point.cov_mm2 ? fmt::format(" {:13.9f}", std::sqrt(std::max((*point.cov_mm2)(i, i), 0.0))) : "  fix";
    }
    text += "  0  1  0  0\n";
  }
  return write_file_atomically(obc, text);
}

}  // namespace crosstie::base
