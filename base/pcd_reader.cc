#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "base/detail/lzf.h"
#include "base/file.h"
#include "base/pcd.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

static_assert(std::endian::native == std::endian::little);

template <typename T>
using Reading = tl::expected<T, std::string>;  ///< the error is the reason

constexpr std::size_t kMaxPcdBytes = std::size_t{8} << 30;
constexpr std::uint64_t kMostPoints = std::uint64_t{1} << 32;
constexpr std::size_t kMostFields = 1000;
constexpr std::string_view kBlanks = " \t\r\n";
constexpr std::array<std::string_view, 12> kNames = {"x",      "y",      "z",      "normal_x", "normal_y", "normal_z",
                                                     "cov_xx", "cov_xy", "cov_xz", "cov_yy",   "cov_yz",   "cov_zz"};

enum class Layout { kAscii, kBinary, kCompressed };

struct Field {
  std::string name;
  std::size_t bytes = 4;
  char type = 'F';
  std::size_t count = 1;
};

struct Header {
  std::vector<Field> fields;
  std::uint64_t points = 0;
  Layout layout = Layout::kAscii;
  std::string frame;
  std::size_t data_offset = 0;

  [[nodiscard]] std::size_t record_bytes() const {
    std::size_t bytes = 0;
    for (const Field& field : fields) bytes += field.bytes * field.count;
    return bytes;
  }
  [[nodiscard]] std::size_t record_values() const {
    std::size_t values = 0;
    for (const Field& field : fields) values += field.count;
    return values;
  }
};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (std::size_t at = line.find_first_not_of(kBlanks); at != std::string_view::npos;) {
    const std::size_t end = std::min(line.find_first_of(kBlanks, at), line.size());
    words.push_back(line.substr(at, end - at));
    at = line.find_first_not_of(kBlanks, end);
  }
  return words;
}

/// Collects the header's lines; each may stand once.
class HeaderReader {
 public:
  Reading<Header> read(std::string_view bytes) {
    std::size_t at = 0;
    while (at < bytes.size()) {
      const std::size_t end = bytes.find('\n', at);
      if (end == std::string_view::npos) break;
      const std::string_view line = trim(bytes.substr(at, end - at));
      at = end + 1;
      const auto last = take(line);
      if (!last) return tl::unexpected<std::string>(last.error());
      if (*last) {
        header_.data_offset = at;
        return checked();
      }
    }
    return tl::unexpected<std::string>("it is no PCD file: its header has no line DATA");
  }

 private:
  /// Whether it was the header's last line.
  Reading<bool> take(std::string_view line) {
    if (line.starts_with("# frame ")) header_.frame = trim(line.substr(8));
    if (line.starts_with("# unit ") && trim(line.substr(7)) != "mm")
      return tl::unexpected<std::string>(fmt::format("its unit is {}, but clouds are in mm", line.substr(7, 40)));
    if (line.empty() || line.starts_with('#')) return false;
    auto words = words_of(line);
    const std::string key(words.front());
    words.erase(words.begin());
    if (words.size() > kMostFields) return tl::unexpected<std::string>(fmt::format("{} has too many words", key));
    if (key == "FIELDS" || key == "SIZE" || key == "TYPE" || key == "COUNT") return column(key, words);
    if (words.empty()) return tl::unexpected<std::string>(fmt::format("{} says nothing", key.substr(0, 40)));
    if (key == "VERSION" || key == "VIEWPOINT") return false;
    if (key == "DATA") return data(words.front());
    const auto number = parse_int(words.front());
    if (!number || *number < 0 || static_cast<std::uint64_t>(*number) > kMostPoints)
      return tl::unexpected<std::string>(fmt::format("{} is no number of points", key.substr(0, 40)));
    if (key == "WIDTH")
      width_ = static_cast<std::uint64_t>(*number);
    else if (key == "HEIGHT")
      height_ = static_cast<std::uint64_t>(*number);
    else if (key == "POINTS")
      points_ = static_cast<std::uint64_t>(*number);
    else
      return tl::unexpected<std::string>(fmt::format("it is no PCD file: its header has a line {}", key.substr(0, 40)));
    return false;
  }

  Reading<bool> column(const std::string& key, const std::vector<std::string_view>& words) {
    if (key == "FIELDS") {
      if (!header_.fields.empty()) return tl::unexpected<std::string>("FIELDS occurs twice");
      for (const std::string_view word : words) header_.fields.push_back({std::string(word)});
      return false;
    }
    if (words.size() != header_.fields.size() || words.empty())
      return tl::unexpected<std::string>(
          fmt::format("{} has {} words for {} fields", key, words.size(), header_.fields.size()));
    for (std::size_t i = 0; i < words.size(); ++i) {
      Field& field = header_.fields[i];
      if (key == "TYPE") {
        if (words[i] != "F" && words[i] != "I" && words[i] != "U")
          return tl::unexpected<std::string>(fmt::format("the type {} of {} is unknown", words[i].substr(0, 40), field.name));
        field.type = words[i].front();
        continue;
      }
      const auto number = parse_int(words[i]);
      const bool fits = number && (key == "COUNT" ? *number >= 1 && *number <= 4096
                                                  : *number == 1 || *number == 2 || *number == 4 || *number == 8);
      if (!fits) return tl::unexpected<std::string>(fmt::format("{} of {} is {}", key, field.name, words[i].substr(0, 40)));
      (key == "COUNT" ? field.count : field.bytes) = static_cast<std::size_t>(*number);
    }
    return false;
  }

  Reading<bool> data(std::string_view word) {
    if (word == "ascii")
      header_.layout = Layout::kAscii;
    else if (word == "binary")
      header_.layout = Layout::kBinary;
    else if (word == "binary_compressed")
      header_.layout = Layout::kCompressed;
    else
      return tl::unexpected<std::string>(fmt::format("the data are {}, which is not known", word.substr(0, 40)));
    return true;
  }

  Reading<Header> checked() {
    if (header_.fields.empty()) return tl::unexpected<std::string>("its header has no FIELDS");
    for (const Field& field : header_.fields) {
      if (field.type == 'F' && field.bytes < 4)
        return tl::unexpected<std::string>(fmt::format("{} is a floating-point number of {} bytes", field.name, field.bytes));
    }
    if (!width_) return tl::unexpected<std::string>("its header has no WIDTH");
    header_.points = *width_ * height_.value_or(1);
    if (header_.points > kMostPoints || (points_ && *points_ != header_.points))
      return tl::unexpected<std::string>("POINTS is not WIDTH times HEIGHT");
    return std::move(header_);
  }

  Header header_;
  std::optional<std::uint64_t> width_, height_, points_;
};

template <typename T>
double as(const char* bytes) {
  T value{};
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

double number_of(const char* bytes, const Field& field) {
  switch (field.bytes) {
    case 1:
      return field.type == 'I' ? as<std::int8_t>(bytes) : as<std::uint8_t>(bytes);
    case 2:
      return field.type == 'I' ? as<std::int16_t>(bytes) : as<std::uint16_t>(bytes);
    case 4:
      return field.type == 'F' ? as<float>(bytes) : field.type == 'I' ? as<std::int32_t>(bytes) : as<std::uint32_t>(bytes);
    default:
      return field.type == 'F' ? as<double>(bytes) : field.type == 'I' ? as<std::int64_t>(bytes) : as<std::uint64_t>(bytes);
  }
}

/// Colours are bytes in the place of a number, and "_" is padding; several numbers under one name (a histogram) are no scalar.
bool is_scalar(const Field& field) {
  return field.count == 1 && field.name != "rgb" && field.name != "rgba" && field.name != "_";
}

/// Puts the first value of each field of a point where it belongs.
class Points {
 public:
  static Reading<Points> begin(const Header& header) {
    Points points(header);
    std::array<int, kNames.size()> present{};
    for (const Field& field : header.fields) {
      Target target;
      const auto known = std::find(kNames.begin(), kNames.end(), field.name);
      if (known != kNames.end()) {
        target.name = static_cast<std::size_t>(known - kNames.begin());
        if (present[*target.name]++ > 0 || field.count != 1)
          return tl::unexpected<std::string>(fmt::format("the field {} occurs twice", field.name));
      } else if (is_scalar(field)) {
        target.field = points.cloud_.fields.size();
        points.cloud_.fields.push_back({field.name, {}});
      }
      points.targets_.push_back(target);
    }
    const auto all = [&](std::size_t first, std::size_t count) {
      const auto n = std::count(present.begin() + static_cast<std::ptrdiff_t>(first),
                                present.begin() + static_cast<std::ptrdiff_t>(first + count), 1);
      return n == static_cast<std::ptrdiff_t>(count) ? 1 : n == 0 ? 0 : -1;
    };
    if (all(0, 3) != 1) return tl::unexpected<std::string>("its points have no x, y and z");
    if (all(3, 3) < 0) return tl::unexpected<std::string>("normal_x, normal_y and normal_z are not all there");
    if (all(6, 6) < 0) return tl::unexpected<std::string>("cov_xx to cov_zz are not all there");
    points.has_normals_ = all(3, 3) == 1;
    points.has_covariances_ = all(6, 6) == 1;
    points.cloud_.frame = header.frame;
    return points;
  }

  void put(std::size_t field, double value) { values_[field] = value; }

  /// A point that is no number is a hole of an organised cloud, and left out.
  Reading<void> finish(std::uint64_t index) {
    std::array<double, kNames.size()> v{};
    for (std::size_t f = 0; f < targets_.size(); ++f) {
      if (targets_[f].name) v[*targets_[f].name] = values_[f];
    }
    if (!std::isfinite(v[0]) || !std::isfinite(v[1]) || !std::isfinite(v[2])) return {};
    for (std::size_t f = 0; f < targets_.size(); ++f) {
      if (targets_[f].field) cloud_.fields[*targets_[f].field].values.push_back(values_[f]);
      if ((targets_[f].field || targets_[f].name) && !std::isfinite(values_[f]))
        return tl::unexpected<std::string>(fmt::format("point {}: {} is not finite", index, names_[f]));
    }
    cloud_.points.emplace_back(v[0], v[1], v[2]);
    if (has_normals_) cloud_.normals.emplace_back(v[3], v[4], v[5]);
    if (has_covariances_) {
      Eigen::Matrix3d cov;
      cov << v[6], v[7], v[8], v[7], v[9], v[10], v[8], v[10], v[11];
      cloud_.cov_mm2.push_back(cov);
    }
    return {};
  }

  Cloud take() { return std::move(cloud_); }

 private:
  struct Target {
    std::optional<std::size_t> name;
    std::optional<std::size_t> field;
  };

  explicit Points(const Header& header) : values_(header.fields.size()) {
    for (const Field& field : header.fields) names_.push_back(field.name);
  }

  Cloud cloud_;
  std::vector<Target> targets_;
  std::vector<std::string> names_;
  std::vector<double> values_;
  bool has_normals_ = false;
  bool has_covariances_ = false;
};

Reading<Cloud> read_ascii(const Header& header, std::string_view data) {
  if (header.points * header.record_values() > (data.size() + 1) / 2) return tl::unexpected<std::string>("the file is cut off");
  auto points = Points::begin(header);
  if (!points) return tl::unexpected<std::string>(points.error());
  std::size_t at = 0;
  for (std::uint64_t i = 0; i < header.points; ++i) {
    for (std::size_t f = 0; f < header.fields.size(); ++f) {
      for (std::size_t k = 0; k < header.fields[f].count; ++k) {
        at = std::min(data.find_first_not_of(kBlanks, at), data.size());
        const std::size_t end = std::min(data.find_first_of(kBlanks, at), data.size());
        const std::string_view word = data.substr(at, end - at);
        at = end;
        const auto value = word == "nan" || word == "-nan" ? std::optional(std::nan("")) : parse_double(word);
        if (!value)
          return tl::unexpected<std::string>(fmt::format("point {}: the file is cut off, or no number stands there", i));
        if (k == 0) points->put(f, *value);
      }
    }
    if (auto done = points->finish(i); !done) return tl::unexpected<std::string>(done.error());
  }
  if (data.find_first_not_of(kBlanks, at) != std::string_view::npos)
    return tl::unexpected<std::string>("it holds more data than its header describes");
  return points->take();
}

/// PCL fills its binary files up to a page with zeros.
bool is_filling(std::string_view rest) {
  constexpr std::size_t kLargestPage = std::size_t{1} << 16;
  return rest.size() < kLargestPage && rest.find_first_not_of('\0') == std::string_view::npos;
}

/// Records one after the other, or, where the data were compressed, all values of a field one after the other.
Reading<Cloud> read_numbers(const Header& header, std::string_view data, bool by_field) {
  const std::size_t size = header.points * header.record_bytes();
  if (data.size() < size) return tl::unexpected<std::string>("the file is cut off");
  if (!is_filling(data.substr(size))) return tl::unexpected<std::string>("it holds more data than its header describes");
  auto points = Points::begin(header);
  if (!points) return tl::unexpected<std::string>(points.error());
  for (std::uint64_t i = 0; i < header.points; ++i) {
    std::size_t before = 0;  // bytes of the fields before, in a record
    for (std::size_t f = 0; f < header.fields.size(); ++f) {
      const std::size_t width = header.fields[f].bytes * header.fields[f].count;
      const std::size_t at = by_field ? header.points * before + i * width : i * header.record_bytes() + before;
      points->put(f, number_of(data.data() + at, header.fields[f]));
      before += width;
    }
    if (auto done = points->finish(i); !done) return tl::unexpected<std::string>(done.error());
  }
  return points->take();
}

Reading<Cloud> read_compressed(const Header& header, std::string_view data) {
  std::array<std::uint32_t, 2> sizes{};  // compressed, as it was
  if (data.size() < sizeof sizes) return tl::unexpected<std::string>("the file is cut off");
  std::memcpy(sizes.data(), data.data(), sizeof sizes);
  data.remove_prefix(sizeof sizes);
  if (data.size() < sizes[0]) return tl::unexpected<std::string>("the file is cut off");
  if (!is_filling(data.substr(sizes[0]))) return tl::unexpected<std::string>("it holds more data than its header describes");
  if (header.points * header.record_bytes() != sizes[1])
    return tl::unexpected<std::string>("its compressed data are of another size than its header says");
  const auto bytes = detail::lzf_expanded(data.substr(0, sizes[0]), sizes[1]);
  if (!bytes) return tl::unexpected<std::string>("its compressed data are damaged");
  return read_numbers(header, *bytes, true);
}

Reading<Cloud> read(std::string_view bytes) {
  const auto header = HeaderReader().read(bytes);
  if (!header) return tl::unexpected<std::string>(header.error());
  const std::string_view data = bytes.substr(header->data_offset);
  switch (header->layout) {
    case Layout::kAscii:
      return read_ascii(*header, data);
    case Layout::kBinary:
      return read_numbers(*header, data, false);
    case Layout::kCompressed:
      return read_compressed(*header, data);
  }
  return tl::unexpected<std::string>("no data");
}

}  // namespace

Result<Cloud> read_pcd(const std::filesystem::path& path) {
  const auto bytes = read_file(path, kMaxPcdBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  auto cloud = read(*bytes);
  if (!cloud) return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), cloud.error()));
  return *std::move(cloud);
}

}  // namespace crosstie::base
