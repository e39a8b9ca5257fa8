#include "base/ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "base/detail/ply_header.h"
#include "base/file.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

using detail::PlyElement;
using detail::PlyFormat;
using detail::PlyProperty;
using detail::PlyType;

static_assert(std::endian::native == std::endian::little);

constexpr std::size_t kMaxPlyBytes = std::size_t{8} << 30;
constexpr std::string_view kBlanks = " \t\r\n";
/// In the order of a record: three coordinates, three of the normal, six of the covariance.
constexpr std::array<std::string_view, 12> kNames = {"x",      "y",      "z",      "nx",     "ny",     "nz",
                                                     "cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz"};
constexpr std::string_view kFieldPrefix = "scalar_";
/// MeshLab shows no scalar but this one; a comment says which field it repeats.
constexpr std::string_view kQuality = "quality";
constexpr std::string_view kQualityComment = "quality is ";

/// Reads values one after the other; nothing at the end of the data or where no number stands.
class ValueReader {
 public:
  ValueReader(std::string_view data, PlyFormat format) : data_(data), format_(format) {}

  std::optional<double> next(PlyType type) { return format_ == PlyFormat::kAscii ? next_text() : next_binary(type); }

  [[nodiscard]] bool at_end() const {
    return format_ == PlyFormat::kAscii ? data_.find_first_not_of(kBlanks, at_) == std::string_view::npos : at_ == data_.size();
  }

 private:
  std::optional<double> next_text() {
    at_ = data_.find_first_not_of(kBlanks, at_);
    if (at_ == std::string_view::npos) at_ = data_.size();
    const std::size_t end = std::min(data_.find_first_of(kBlanks, at_), data_.size());
    const auto value = parse_double(data_.substr(at_, end - at_));
    at_ = end;
    return value;
  }

  template <typename T>
  [[nodiscard]] double as(const char* bytes) const {
    T value{};
    std::memcpy(&value, bytes, sizeof value);
    return static_cast<double>(value);
  }

  std::optional<double> next_binary(PlyType type) {
    const std::size_t size = detail::size_of(type);
    if (data_.size() - at_ < size) return std::nullopt;
    char bytes[8];
    std::memcpy(bytes, data_.data() + at_, size);
    if (format_ == PlyFormat::kBigEndian) std::reverse(bytes, bytes + size);
    at_ += size;
    switch (type) {
      case PlyType::kInt8:
        return as<std::int8_t>(bytes);
      case PlyType::kUint8:
        return as<std::uint8_t>(bytes);
      case PlyType::kInt16:
        return as<std::int16_t>(bytes);
      case PlyType::kUint16:
        return as<std::uint16_t>(bytes);
      case PlyType::kInt32:
        return as<std::int32_t>(bytes);
      case PlyType::kUint32:
        return as<std::uint32_t>(bytes);
      case PlyType::kFloat:
        return as<float>(bytes);
      case PlyType::kDouble:
        return as<double>(bytes);
    }
    return std::nullopt;
  }

  std::string_view data_;
  PlyFormat format_;
  std::size_t at_ = 0;
};

/// The number of a list's items, which is of an integer type: in ASCII any number may stand there.
std::optional<std::uint64_t> read_count(ValueReader& values, const PlyProperty& list) {
  constexpr double kLargest = std::numeric_limits<std::uint32_t>::max();
  const auto count = values.next(list.count_type);
  if (!count || !(*count >= 0.0 && *count <= kLargest) || *count != std::floor(*count)) return std::nullopt;
  return static_cast<std::uint64_t>(*count);
}

/// Reads one property; lists are read over. Nothing where the data ends or is no number.
std::optional<double> read_property(ValueReader& values, const PlyProperty& property) {
  if (!property.is_list) return values.next(property.type);
  const auto count = read_count(values, property);
  if (!count) return std::nullopt;
  for (std::uint64_t left = *count; left > 0; --left) {
    if (!values.next(property.type)) return std::nullopt;
  }
  return 0.0;
}

bool skip(ValueReader& values, const PlyElement& element) {
  for (std::uint64_t i = 0; i < element.count; ++i) {
    for (const PlyProperty& property : element.properties) {
      if (!read_property(values, property)) return false;
    }
  }
  return true;
}

/// The error is the reason.
tl::expected<void, std::string> read_faces(ValueReader& values, const PlyElement& face, Mesh& mesh) {
  const auto is_corners = [](const PlyProperty& p) {
    return p.is_list && (p.name == "vertex_indices" || p.name == "vertex_index");
  };
  if (std::count_if(face.properties.begin(), face.properties.end(), is_corners) != 1) {
    return tl::unexpected<std::string>("its faces have no list vertex_indices");
  }
  const auto vertex_count = static_cast<double>(mesh.vertices.points.size());
  for (std::uint64_t i = 0; i < face.count; ++i) {
    for (const PlyProperty& property : face.properties) {
      if (!is_corners(property)) {
        if (!read_property(values, property))
          return tl::unexpected<std::string>(fmt::format("face {}: the file is cut off", i));
        continue;
      }
      const auto count = read_count(values, property);
      if (!count || *count < 3) {
        return tl::unexpected<std::string>(fmt::format("face {}: the file is cut off, or it has less than three corners", i));
      }
      std::array<std::uint32_t, 3> corners{};
      for (std::uint64_t k = 0; k < *count; ++k) {
        const auto index = values.next(property.type);
        if (!index || *index < 0.0 || *index != std::floor(*index) || *index >= vertex_count) {
          return tl::unexpected<std::string>(fmt::format("face {}: the file is cut off, or a corner is no vertex", i));
        }
        if (k < 2) {
          corners[static_cast<std::size_t>(k)] = static_cast<std::uint32_t>(*index);
          continue;
        }
        if (k > 2) corners[1] = corners[2];
        corners[2] = static_cast<std::uint32_t>(*index);
        const auto& p = mesh.vertices.points;
        const Eigen::Vector3d ab = p[corners[1]] - p[corners[0]];
        const Eigen::Vector3d ac = p[corners[2]] - p[corners[0]];
        if (ab.cross(ac).squaredNorm() > 0.0) mesh.triangles.push_back(corners);
      }
    }
  }
  return {};
}

/// Where a property of a vertex goes: to one of kNames, or to a field.
struct Target {
  std::optional<std::size_t> name;
  std::optional<std::size_t> field;
};

/// Every value of a vertex has its target; the error is the reason.
tl::expected<std::vector<Target>, std::string> targets_of(const PlyElement& vertex, bool skip_quality, Cloud& cloud) {
  std::array<bool, kNames.size()> present{};
  std::vector<Target> targets;
  for (const PlyProperty& property : vertex.properties) {
    Target target;
    const auto known = std::find(kNames.begin(), kNames.end(), property.name);
    if (property.is_list || (skip_quality && property.name == kQuality)) {
      // read over
    } else if (known != kNames.end()) {
      target.name = static_cast<std::size_t>(known - kNames.begin());
      present[*target.name] = true;
    } else {
      const bool prefixed = property.name.starts_with(kFieldPrefix) && property.name.size() > kFieldPrefix.size();
      target.field = cloud.fields.size();
      cloud.fields.push_back({property.name.substr(prefixed ? kFieldPrefix.size() : 0), {}});
    }
    targets.push_back(target);
  }
  const auto present_in = [&](std::size_t first, std::size_t count) {
    return static_cast<std::size_t>(std::count(present.begin() + static_cast<std::ptrdiff_t>(first),
                                               present.begin() + static_cast<std::ptrdiff_t>(first + count), true));
  };
  if (present_in(0, 3) != 3) return tl::unexpected<std::string>("its vertices have no x, y and z");
  if (present_in(3, 3) % 3 != 0) return tl::unexpected<std::string>("nx, ny and nz are not all there");
  if (present_in(6, 6) % 6 != 0) return tl::unexpected<std::string>("cov_xx to cov_zz are not all there");
  const auto count = static_cast<std::size_t>(vertex.count);
  cloud.points.reserve(count);
  if (present_in(3, 3) == 3) cloud.normals.reserve(count);
  if (present_in(6, 6) == 6) cloud.cov_mm2.reserve(count);
  for (auto& field : cloud.fields) field.values.reserve(count);
  return targets;
}

/// The error is the reason.
tl::expected<void, std::string> read_vertices(ValueReader& values, const PlyElement& vertex, bool skip_quality, Cloud& cloud) {
  const auto targets = targets_of(vertex, skip_quality, cloud);
  if (!targets) return tl::unexpected<std::string>(targets.error());
  const bool has_normals = cloud.normals.capacity() > 0;
  const bool has_covariances = cloud.cov_mm2.capacity() > 0;
  std::array<double, kNames.size()> v{};
  for (std::uint64_t i = 0; i < vertex.count; ++i) {
    for (std::size_t p = 0; p < targets->size(); ++p) {
      const auto value = read_property(values, vertex.properties[p]);
      if (!value)
        return tl::unexpected<std::string>(fmt::format("vertex {}: the file is cut off, or no finite number stands there", i));
      if (!std::isfinite(*value))
        return tl::unexpected<std::string>(fmt::format("vertex {}: {} is not finite", i, vertex.properties[p].name));
      if ((*targets)[p].name) v[*(*targets)[p].name] = *value;
      if ((*targets)[p].field) cloud.fields[*(*targets)[p].field].values.push_back(*value);
    }
    cloud.points.emplace_back(v[0], v[1], v[2]);
    if (has_normals) cloud.normals.emplace_back(v[3], v[4], v[5]);
    if (has_covariances) {
      Eigen::Matrix3d cov;
      cov << v[6], v[7], v[8], v[7], v[9], v[10], v[8], v[10], v[11];
      cloud.cov_mm2.push_back(cov);
    }
  }
  return {};
}

/// The error is the reason.
tl::expected<Mesh, std::string> read_mesh(std::string_view bytes, bool with_faces) {
  const auto header = detail::parse_ply_header(bytes);
  if (!header) return tl::unexpected<std::string>(header.error());
  Mesh mesh;
  Cloud& cloud = mesh.vertices;
  bool skip_quality = false;
  for (const std::string& comment : header->comments) {
    skip_quality = skip_quality || comment.starts_with(kQualityComment);
    if (comment.starts_with("frame ")) cloud.frame = trim(comment.substr(6));
    if (comment.starts_with("unit ") && trim(comment.substr(5)) != "mm") {
      return tl::unexpected<std::string>(fmt::format("its {}, but clouds are in mm", comment));
    }
  }
  ValueReader values(bytes.substr(header->data_offset), header->format);
  bool has_vertices = false;
  for (const PlyElement& element : header->elements) {
    if (element.name == "vertex") {
      if (has_vertices) return tl::unexpected<std::string>("it has two elements vertex");
      has_vertices = true;
      if (auto read = read_vertices(values, element, skip_quality, cloud); !read)
        return tl::unexpected<std::string>(std::move(read).error());
    } else if (with_faces && element.name == "face") {
      if (!has_vertices) return tl::unexpected<std::string>("its faces stand before its vertices");
      if (auto read = read_faces(values, element, mesh); !read) return tl::unexpected<std::string>(std::move(read).error());
    } else if (!skip(values, element)) {
      return tl::unexpected<std::string>(fmt::format("the file is cut off in {}", element.name));
    }
  }
  if (!has_vertices) return tl::unexpected<std::string>("it has no element vertex");
  if (!values.at_end()) return tl::unexpected<std::string>("it holds more data than its header describes");
  return mesh;
}

Result<Mesh> read_mesh_file(const std::filesystem::path& path, bool with_faces) {
  auto bytes = read_file(path, kMaxPlyBytes);
  if (!bytes) return fail(std::move(bytes));
  auto mesh = read_mesh(*bytes, with_faces);
  if (!mesh) return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), mesh.error()));
  return *std::move(mesh);
}

/// False for a finite value that a float cannot hold.
bool append(std::string& bytes, double value, bool as_double) {
  char buffer[8];
  const float narrow = static_cast<float>(value);
  if (as_double)
    std::memcpy(buffer, &value, sizeof value);
  else
    std::memcpy(buffer, &narrow, sizeof narrow);
  bytes.append(buffer, as_double ? sizeof value : sizeof narrow);
  return as_double || std::isfinite(narrow) || !std::isfinite(value);
}

/// What is wrong with a cloud that is to be written, or nothing.
std::string fault(const Cloud& cloud) {
  const auto fits = [&](std::size_t size) { return size == 0 || size == cloud.points.size(); };
  if (!fits(cloud.normals.size()) || !fits(cloud.cov_mm2.size())) return "the lists of a cloud differ in length";
  for (const CloudField& field : cloud.fields) {
    if (field.values.size() != cloud.points.size()) return "the lists of a cloud differ in length";
    if (field.name.empty() || field.name.find_first_of(kBlanks) != std::string::npos) {
      return fmt::format("\"{}\" cannot be the name of a field", field.name);
    }
  }
  if (cloud.frame.find('\n') != std::string::npos) return "the name of a frame is one line";
  return "";
}

/// The field that MeshLab is to show: the first sigma, else the first; nothing where the cloud has none, or one of that name.
const CloudField* quality_of(const Cloud& cloud) {
  const CloudField* shown = nullptr;
  for (const CloudField& field : cloud.fields) {
    if (field.name == kQuality) return nullptr;
    const bool better = shown == nullptr || (field.name.starts_with("sigma") && !shown->name.starts_with("sigma"));
    if (better) shown = &field;
  }
  return shown;
}

/// Whole numbers beyond 2^24 (ids) are not all floats.
bool needs_double(const CloudField& field) {
  constexpr double kFloatIntegers = 16777216.0;
  return std::any_of(field.values.begin(), field.values.end(),
                     [](double v) { return std::abs(v) > kFloatIntegers && v == std::floor(v); });
}

}  // namespace

Result<> write_ply(const std::filesystem::path& path, const Cloud& cloud, const PlyOptions& options) {
  if (const std::string what = fault(cloud); !what.empty()) {
    return fail(ErrorCode::kInternal, fmt::format("cannot write {}: {}", shown(path), what));
  }
  std::string bytes = "ply\nformat binary_little_endian 1.0\ncomment unit mm\n";
  if (!cloud.frame.empty()) bytes += fmt::format("comment frame {}\n", cloud.frame);
  const CloudField* quality = quality_of(cloud);
  if (quality != nullptr) bytes += fmt::format("comment {}{}{}\n", kQualityComment, kFieldPrefix, quality->name);
  bytes += fmt::format("element vertex {}\n", cloud.points.size());
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if ((i >= 3 && i < 6 && cloud.normals.empty()) || (i >= 6 && cloud.cov_mm2.empty())) continue;
    bytes += fmt::format("property {} {}\n", i < 3 && options.double_coordinates ? "double" : "float", kNames[i]);
  }
  if (quality != nullptr) bytes += fmt::format("property float {}\n", kQuality);
  std::vector<bool> as_double;
  for (const CloudField& field : cloud.fields) {
    as_double.push_back(needs_double(field));
    bytes += fmt::format("property {} {}{}\n", as_double.back() ? "double" : "float", kFieldPrefix, field.name);
  }
  bytes += "end_header\n";
  bool held = true;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    for (int k = 0; k < 3; ++k) held &= append(bytes, cloud.points[i][k], options.double_coordinates);
    for (int k = 0; k < 3 && !cloud.normals.empty(); ++k) held &= append(bytes, cloud.normals[i][k], false);
    for (int r = 0; r < 3 && !cloud.cov_mm2.empty(); ++r) {
      for (int c = r; c < 3; ++c) held &= append(bytes, cloud.cov_mm2[i](r, c), false);
    }
    if (quality != nullptr) held &= append(bytes, quality->values[i], false);
    for (std::size_t f = 0; f < cloud.fields.size(); ++f) held &= append(bytes, cloud.fields[f].values[i], as_double[f]);
  }
  if (!held) return fail(ErrorCode::kBadInput, fmt::format("cannot write {}: a value is too large for a float", shown(path)));
  return write_file_atomically(path, bytes);
}

Result<Cloud> read_ply(const std::filesystem::path& path) {
  auto mesh = read_mesh_file(path, false);
  if (!mesh) return fail(std::move(mesh));
  return std::move(mesh->vertices);
}

Result<Mesh> read_ply_mesh(const std::filesystem::path& path) { return read_mesh_file(path, true); }

}  // namespace crosstie::base
