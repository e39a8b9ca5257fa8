#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>

#include "base/detail/colmap_camera.h"
#include "base/detail/colmap_files.h"
#include "base/detail/colmap_pixel.h"
#include "base/file.h"
#include "base/text.h"

namespace crosstie::base::detail {
namespace {

constexpr std::string_view kBlanks = " \t\r";

/// The lines of a file and the words of the current one. Once a word is not what was expected, `fault()` says so and all
/// further words are zero.
class Scanner {
 public:
  Scanner(const std::filesystem::path& path, std::string_view text) : path_(path), text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
  }

  /// Goes to the next line, whatever it holds; false at the end.
  bool next_line() {
    if (text_.empty()) return false;
    const std::size_t end = std::min(text_.find('\n'), text_.size());
    rest_ = text_.substr(0, end);
    text_.remove_prefix(std::min(end + 1, text_.size()));
    ++line_;
    return true;
  }

  /// Goes to the next line that holds data. Comments that state the number of records are remembered.
  bool next_record() {
    while (next_line()) {
      const std::string_view line = trim(rest_);
      if (line.empty()) continue;
      if (!line.starts_with('#')) return true;
      remember_count(line.substr(1));
    }
    return false;
  }

  [[nodiscard]] bool at_line_end() const { return rest_.find_first_not_of(kBlanks) == std::string_view::npos; }

  std::string_view word(const char* what) {
    const std::size_t begin = rest_.find_first_not_of(kBlanks);
    if (begin == std::string_view::npos) {
      if (fault_.empty()) fault_ = fmt::format("{} is missing", what);
      rest_ = {};
      return {};
    }
    const std::size_t end = std::min(rest_.find_first_of(kBlanks, begin), rest_.size());
    const std::string_view found = rest_.substr(begin, end - begin);
    rest_.remove_prefix(end);
    return found;
  }

  double number(const char* what) {
    const std::string_view text = word(what);
    const auto value = fault_.empty() ? parse_double(text) : std::nullopt;
    if (!value) set_fault(text, what);
    return value.value_or(0.0);
  }

  /// An integer from 0 to `last`.
  std::uint64_t count(const char* what, std::uint64_t last) {
    const std::string_view text = word(what);
    std::uint64_t value = 0;
    bool good = !text.empty() && text.size() <= 20;
    for (const char c : text) {
      const auto digit = static_cast<std::uint64_t>(c - '0');
      good = good && c >= '0' && c <= '9' && value <= (last - digit) / 10 && digit <= last;
      if (good) value = value * 10 + digit;
    }
    if (!good) set_fault(text, what);
    return good ? value : 0;
  }

  [[nodiscard]] std::string_view rest() const { return trim(rest_); }
  void skip_rest() { rest_ = {}; }
  /// A fault that the words themselves do not show.
  void refuse(std::string reason) {
    if (fault_.empty()) fault_ = std::move(reason);
  }

  [[nodiscard]] bool failed() const { return !fault_.empty(); }
  [[nodiscard]] tl::unexpected<Error> failure() const {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path_), line_, fault_));
  }
  /// Whether the number of records is the one that the file states, if it does.
  [[nodiscard]] Result<> check_count(std::size_t read) const {
    if (!stated_ || *stated_ == read) return {};
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: the file states {} records and holds {}; it was cut off or edited",
                                                  shown(path_), stated_line_, *stated_, read));
  }

 private:
  void set_fault(std::string_view text, const char* what) {
    if (fault_.empty()) fault_ = fmt::format("\"{}\" is no {}", shown(std::string(text.substr(0, 40))), what);
  }

  /// " Number of images: 2, mean observations per image: 2"
  void remember_count(std::string_view comment) {
    constexpr std::string_view kStart = "Number of ";
    comment = trim(comment);
    if (stated_ || !comment.starts_with(kStart)) return;
    const std::size_t colon = comment.find(':');
    if (colon == std::string_view::npos) return;
    comment = comment.substr(colon + 1);
    const auto value = parse_int(comment.substr(0, comment.find(',')));
    if (!value || *value < 0) return;
    stated_ = static_cast<std::uint64_t>(*value);
    stated_line_ = line_;
  }

  const std::filesystem::path& path_;
  std::string_view text_;
  std::string_view rest_;
  int line_ = 0;
  std::string fault_;
  std::optional<std::uint64_t> stated_;
  int stated_line_ = 0;
};

constexpr std::uint64_t kLastId32 = std::numeric_limits<std::uint32_t>::max() - 1U;  // the last one means "none"
constexpr std::uint64_t kLastId64 = std::numeric_limits<std::uint64_t>::max() - 1U;

std::uint32_t id32(Scanner& scanner, const char* what) { return static_cast<std::uint32_t>(scanner.count(what, kLastId32)); }

Result<std::vector<ColmapCamera>> parse_cameras(const std::filesystem::path& path, std::string_view text) {
  std::vector<ColmapCamera> cameras;
  Scanner scanner(path, text);
  while (scanner.next_record()) {
    const std::uint32_t id = id32(scanner, "camera id");
    const std::string_view name = scanner.word("lens model");
    const ColmapLens* lens = colmap_lens(name);
    if (lens == nullptr) {
      scanner.refuse(fmt::format("the lens model {} has no exact counterpart; known: {}",
                                 shown(std::string(name.substr(0, 40))), colmap_lens_names()));
      return scanner.failure();
    }
    const std::uint64_t width_px = scanner.count("width", kLastId32);
    const std::uint64_t height_px = scanner.count("height", kLastId32);
    std::vector<double> parameters;
    for (int i = 0; i < lens->parameter_count; ++i) parameters.push_back(scanner.number("lens parameter"));
    if (!scanner.at_line_end())
      scanner.refuse(fmt::format("more than the {} parameters of {}", lens->parameter_count, lens->name));
    if (scanner.failed()) return scanner.failure();
    auto camera = camera_of_colmap(*lens, width_px, height_px, parameters);
    if (!camera) {
      scanner.refuse(camera.error());
      return scanner.failure();
    }
    cameras.push_back({id, *std::move(camera)});
  }
  if (auto whole = scanner.check_count(cameras.size()); !whole) return fail(std::move(whole));
  return cameras;
}

/// The line of an image's points.
void parse_image_points(Scanner& scanner, ColmapImage& image) {
  while (!scanner.at_line_end() && !scanner.failed()) {
    ColmapImagePoint point;
    const double x = scanner.number("x of an image point");
    const double y = scanner.number("y of an image point");
    point.pixel_px = from_colmap_pixel(Eigen::Vector2d(x, y));
    if (scanner.rest().starts_with('-')) {
      if (scanner.word("point id") != "-1") scanner.refuse("a negative point id other than -1");
    } else {
      point.point_id = scanner.count("point id", kLastId64);
    }
    image.points.push_back(point);
  }
}

Result<std::vector<ColmapImage>> parse_images(const std::filesystem::path& path, std::string_view text) {
  std::vector<ColmapImage> images;
  Scanner scanner(path, text);
  while (scanner.next_record()) {
    ColmapImage image;
    image.id = id32(scanner, "image id");
    std::array<double, 4> wxyz{};
    for (double& q : wxyz) q = scanner.number("quaternion");
    for (int i = 0; i < 3; ++i) image.camera_from_world.translation_mm[i] = scanner.number("translation");
    image.camera_id = id32(scanner, "camera id");
    image.name = scanner.rest();
    if (image.name.empty()) scanner.refuse("the image's name is missing");
    if (!scanner.failed() && !rotation_of_colmap(wxyz, image.camera_from_world.rotation)) {
      scanner.refuse("the quaternion is not of unit length");
    }
    if (scanner.failed()) return scanner.failure();
    if (!scanner.next_line()) scanner.refuse("the line of its image points is missing");
    if (!scanner.failed()) parse_image_points(scanner, image);
    if (scanner.failed()) return scanner.failure();
    images.push_back(std::move(image));
  }
  if (auto whole = scanner.check_count(images.size()); !whole) return fail(std::move(whole));
  return images;
}

Result<std::vector<ColmapPoint>> parse_points(const std::filesystem::path& path, std::string_view text) {
  std::vector<ColmapPoint> points;
  Scanner scanner(path, text);
  while (scanner.next_record()) {
    ColmapPoint point;
    point.id = scanner.count("point id", kLastId64);
    for (int i = 0; i < 3; ++i) point.xyz[i] = scanner.number("coordinate");
    for (std::uint8_t& colour : point.rgb) colour = static_cast<std::uint8_t>(scanner.count("colour (0 to 255)", 255));
    point.error_px = scanner.number("error");
    while (!scanner.at_line_end() && !scanner.failed()) {
      ColmapTrackElement element;
      element.image_id = id32(scanner, "image id of the track");
      element.point_index = id32(scanner, "index of an image point");
      point.track.push_back(element);
    }
    if (scanner.failed()) return scanner.failure();
    points.push_back(std::move(point));
  }
  if (auto whole = scanner.check_count(points.size()); !whole) return fail(std::move(whole));
  return points;
}

std::string format_images(const ColmapModel& model) {
  std::string text = fmt::format(
      "# Two lines for each image:\n#   IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n#   X Y POINT3D_ID, repeated\n"
      "# Number of images: {}\n",
      model.images.size());
  const auto add = [&](double value) { text += ' ' + format_double(value); };
  for (const ColmapImage& image : model.images) {
    text += std::to_string(image.id);
    const Eigen::Quaterniond& q = image.camera_from_world.rotation;
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) add(value);
    for (const double value : image.camera_from_world.translation_mm) add(value);
    text += fmt::format(" {} {}\n", image.camera_id, image.name);
    for (const ColmapImagePoint& point : image.points) {
      const Eigen::Vector2d pixel = to_colmap_pixel(point.pixel_px);
      text += fmt::format("{}{} {} {}", &point == image.points.data() ? "" : " ", format_double(pixel.x()),
                          format_double(pixel.y()), point.point_id ? std::to_string(*point.point_id) : "-1");
    }
    text += '\n';
  }
  return text;
}

}  // namespace

bool rotation_of_colmap(const std::array<double, 4>& wxyz, Eigen::Quaterniond& rotation) {
  constexpr double kRotationTolerance = 0.01;  // six-digit files deviate by 1e-6; what is further off is no quaternion
  constexpr double kUnitTolerance = 1e-14;
  rotation = Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  const double deviation = std::abs(rotation.norm() - 1.0);
  if (!(deviation < kRotationTolerance)) return false;
  if (deviation > kUnitTolerance) rotation.normalize();
  return true;
}

Result<ColmapModel> parse_colmap_text(const ColmapPaths& paths, const ColmapContents& contents) {
  auto cameras = parse_cameras(paths[0], contents[0]);
  if (!cameras) return fail(std::move(cameras));
  auto images = parse_images(paths[1], contents[1]);
  if (!images) return fail(std::move(images));
  auto points = parse_points(paths[2], contents[2]);
  if (!points) return fail(std::move(points));
  return ColmapModel{*std::move(cameras), *std::move(images), *std::move(points)};
}

ColmapContents format_colmap_text(const ColmapModel& model) {
  ColmapContents contents;
  contents[0] =
      fmt::format("# One line for each camera:\n#   CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS\n# Number of cameras: {}\n",
                  model.cameras.size());
  for (const ColmapCamera& camera : model.cameras) {
    const auto values = colmap_of_camera(camera.camera);
    contents[0] +=
        fmt::format("{} {} {} {}", camera.id, values->lens->name, camera.camera.width_px(), camera.camera.height_px());
    for (const double value : values->parameters) contents[0] += ' ' + format_double(value);
    contents[0] += '\n';
  }
  contents[1] = format_images(model);
  contents[2] = fmt::format(
      "# One line for each point:\n#   POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX, repeated\n"
      "# Number of points: {}\n",
      model.points.size());
  for (const ColmapPoint& point : model.points) {
    contents[2] += std::to_string(point.id);
    for (const double value : point.xyz) contents[2] += ' ' + format_double(value);
    for (const std::uint8_t colour : point.rgb) contents[2] += fmt::format(" {}", colour);
    contents[2] += ' ' + format_double(point.error_px);
    for (const ColmapTrackElement& e : point.track) contents[2] += fmt::format(" {} {}", e.image_id, e.point_index);
    contents[2] += '\n';
  }
  return contents;
}

}  // namespace crosstie::base::detail
