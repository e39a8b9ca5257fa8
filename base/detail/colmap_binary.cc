#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include <fmt/format.h>

#include "base/detail/colmap_camera.h"
#include "base/detail/colmap_files.h"
#include "base/detail/colmap_pixel.h"
#include "base/file.h"

namespace crosstie::base::detail {
namespace {

static_assert(std::endian::native == std::endian::little, "COLMAP's files are little-endian");

constexpr std::uint64_t kNoPoint = std::numeric_limits<std::uint64_t>::max();
constexpr std::uint32_t kNoId = std::numeric_limits<std::uint32_t>::max();

// Bytes of the smallest record of each kind, against which counts are checked.
constexpr std::uint64_t kMinCameraBytes = 4 + 4 + 8 + 8 + 3 * 8;
constexpr std::uint64_t kMinImageBytes = 4 + 7 * 8 + 4 + 1 + 8;
constexpr std::uint64_t kImagePointBytes = 2 * 8 + 8;
constexpr std::uint64_t kMinPointBytes = 8 + 3 * 8 + 3 + 8 + 8;
constexpr std::uint64_t kTrackBytes = 4 + 4;

/// The bytes of a file one value after the other. After the first fault all values are zero.
class Reader {
 public:
  Reader(const std::filesystem::path& path, std::string_view bytes) : path_(path), bytes_(bytes) {}

  template <typename T>
  T next() {
    T value{};
    if (bytes_.size() - at_ < sizeof value) {
      refuse("the file is cut off");
      at_ = bytes_.size();
    } else if (!failed()) {
      std::memcpy(&value, bytes_.data() + at_, sizeof value);
      at_ += sizeof value;
    }
    return value;
  }

  double number() {
    const auto value = next<double>();
    if (!std::isfinite(value)) refuse_at(at_ - sizeof value, "the value is not finite");
    return failed() ? 0.0 : value;
  }

  std::uint32_t id() {
    const auto value = next<std::uint32_t>();
    if (value == kNoId) refuse_at(at_ - sizeof value, "an id is missing");
    return value;
  }

  /// A number of records that fit into the rest of the file.
  std::size_t count(std::uint64_t record_bytes) {
    const auto value = next<std::uint64_t>();
    if (value > (bytes_.size() - at_) / record_bytes) {
      refuse_at(at_ - sizeof value,
                fmt::format("{} records are announced, but only {} bytes follow", value, bytes_.size() - at_));
    }
    return failed() ? 0 : static_cast<std::size_t>(value);
  }

  std::string name() {
    const std::size_t end = bytes_.find('\0', at_);
    if (end == std::string_view::npos) {
      refuse("the file is cut off in a name");
      return {};
    }
    std::string found(bytes_.substr(at_, end - at_));
    if (found.empty()) refuse("the image's name is missing");
    at_ = end + 1;
    return found;
  }

  void refuse(std::string reason) { refuse_at(at_, std::move(reason)); }
  void expect_end() {
    if (at_ != bytes_.size()) refuse(fmt::format("{} bytes follow the last record", bytes_.size() - at_));
  }

  [[nodiscard]] bool failed() const { return !fault_.empty(); }
  [[nodiscard]] tl::unexpected<Error> failure() const {
    return fail(ErrorCode::kBadInput, fmt::format("{}: offset {}: {}", shown(path_), fault_at_, fault_));
  }

 private:
  void refuse_at(std::size_t at, std::string reason) {
    if (failed()) return;
    fault_ = std::move(reason);
    fault_at_ = at;
  }

  const std::filesystem::path& path_;
  std::string_view bytes_;
  std::size_t at_ = 0;
  std::string fault_;
  std::size_t fault_at_ = 0;
};

Result<std::vector<ColmapCamera>> parse_cameras(const std::filesystem::path& path, std::string_view bytes) {
  std::vector<ColmapCamera> cameras;
  Reader reader(path, bytes);
  const std::size_t count = reader.count(kMinCameraBytes);
  cameras.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t id = reader.id();
    const auto lens_id = reader.next<std::int32_t>();
    const ColmapLens* lens = colmap_lens(lens_id);
    if (lens == nullptr) {
      reader.refuse(fmt::format("lens model {} has no exact counterpart; known: {}", lens_id, colmap_lens_names()));
      return reader.failure();
    }
    const auto width_px = reader.next<std::uint64_t>();
    const auto height_px = reader.next<std::uint64_t>();
    std::vector<double> parameters;
    for (int k = 0; k < lens->parameter_count; ++k) parameters.push_back(reader.number());
    if (reader.failed()) return reader.failure();
    auto camera = camera_of_colmap(*lens, width_px, height_px, parameters);
    if (!camera) {
      reader.refuse(camera.error());
      return reader.failure();
    }
    cameras.push_back({id, *std::move(camera)});
  }
  reader.expect_end();
  if (reader.failed()) return reader.failure();
  return cameras;
}

Result<std::vector<ColmapImage>> parse_images(const std::filesystem::path& path, std::string_view bytes) {
  std::vector<ColmapImage> images;
  Reader reader(path, bytes);
  const std::size_t count = reader.count(kMinImageBytes);
  images.reserve(count);
  for (std::size_t i = 0; i < count && !reader.failed(); ++i) {
    ColmapImage image;
    image.id = reader.id();
    std::array<double, 4> wxyz{};
    for (double& q : wxyz) q = reader.number();
    if (!reader.failed() && !rotation_of_colmap(wxyz, image.camera_from_world.rotation)) {
      reader.refuse("the quaternion is not of unit length");
    }
    for (int k = 0; k < 3; ++k) image.camera_from_world.translation_mm[k] = reader.number();
    image.camera_id = reader.id();
    image.name = reader.name();
    const std::size_t points = reader.count(kImagePointBytes);
    image.points.reserve(points);
    for (std::size_t k = 0; k < points && !reader.failed(); ++k) {
      const double x = reader.number();
      const double y = reader.number();
      const auto point_id = reader.next<std::uint64_t>();
      image.points.push_back({from_colmap_pixel(Eigen::Vector2d(x, y)),
                              point_id == kNoPoint ? std::nullopt : std::optional<std::uint64_t>(point_id)});
    }
    images.push_back(std::move(image));
  }
  reader.expect_end();
  if (reader.failed()) return reader.failure();
  return images;
}

Result<std::vector<ColmapPoint>> parse_points(const std::filesystem::path& path, std::string_view bytes) {
  std::vector<ColmapPoint> points;
  Reader reader(path, bytes);
  const std::size_t count = reader.count(kMinPointBytes);
  points.reserve(count);
  for (std::size_t i = 0; i < count && !reader.failed(); ++i) {
    ColmapPoint point;
    point.id = reader.next<std::uint64_t>();
    if (point.id == kNoPoint) reader.refuse("a point's id is missing");
    for (int k = 0; k < 3; ++k) point.xyz[k] = reader.number();
    for (std::uint8_t& colour : point.rgb) colour = reader.next<std::uint8_t>();
    point.error_px = reader.number();
    const std::size_t rays = reader.count(kTrackBytes);
    point.track.reserve(rays);
    for (std::size_t k = 0; k < rays; ++k) {
      const std::uint32_t image_id = reader.id();
      point.track.push_back({image_id, reader.id()});
    }
    points.push_back(std::move(point));
  }
  reader.expect_end();
  if (reader.failed()) return reader.failure();
  return points;
}

template <typename T>
void put(std::string& bytes, T value) {
  char buffer[sizeof value];
  std::memcpy(buffer, &value, sizeof value);
  bytes.append(buffer, sizeof value);
}

std::string format_images(const ColmapModel& model) {
  std::string bytes;
  put(bytes, static_cast<std::uint64_t>(model.images.size()));
  for (const ColmapImage& image : model.images) {
    put(bytes, image.id);
    const Eigen::Quaterniond& q = image.camera_from_world.rotation;
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) put(bytes, value);
    for (const double value : image.camera_from_world.translation_mm) put(bytes, value);
    put(bytes, image.camera_id);
    bytes += image.name;
    bytes += '\0';
    put(bytes, static_cast<std::uint64_t>(image.points.size()));
    for (const ColmapImagePoint& point : image.points) {
      for (const double value : to_colmap_pixel(point.pixel_px)) put(bytes, value);
      put(bytes, point.point_id.value_or(kNoPoint));
    }
  }
  return bytes;
}

}  // namespace

Result<ColmapModel> parse_colmap_binary(const ColmapPaths& paths, const ColmapContents& contents) {
  auto cameras = parse_cameras(paths[0], contents[0]);
  if (!cameras) return fail(std::move(cameras));
  auto images = parse_images(paths[1], contents[1]);
  if (!images) return fail(std::move(images));
  auto points = parse_points(paths[2], contents[2]);
  if (!points) return fail(std::move(points));
  return ColmapModel{*std::move(cameras), *std::move(images), *std::move(points)};
}

ColmapContents format_colmap_binary(const ColmapModel& model) {
  ColmapContents contents;
  put(contents[0], static_cast<std::uint64_t>(model.cameras.size()));
  for (const ColmapCamera& camera : model.cameras) {
    const auto values = colmap_of_camera(camera.camera);
    put(contents[0], camera.id);
    put(contents[0], values->lens->id);
    put(contents[0], static_cast<std::uint64_t>(camera.camera.width_px()));
    put(contents[0], static_cast<std::uint64_t>(camera.camera.height_px()));
    for (const double value : values->parameters) put(contents[0], value);
  }
  contents[1] = format_images(model);
  put(contents[2], static_cast<std::uint64_t>(model.points.size()));
  for (const ColmapPoint& point : model.points) {
    put(contents[2], point.id);
    for (const double value : point.xyz) put(contents[2], value);
    for (const std::uint8_t colour : point.rgb) put(contents[2], colour);
    put(contents[2], point.error_px);
    put(contents[2], static_cast<std::uint64_t>(point.track.size()));
    for (const ColmapTrackElement& element : point.track) {
      put(contents[2], element.image_id);
      put(contents[2], element.point_index);
    }
  }
  return contents;
}

}  // namespace crosstie::base::detail
