#include "base/kalibr.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <Eigen/Geometry>

#include "base/file.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

constexpr std::size_t kMaxBytes = std::size_t{4} << 20;
constexpr std::size_t kMostCameras = 64;
constexpr std::size_t kMostNumbers = 64;  // of one key
constexpr double kMetre_mm = 1000.0;
constexpr double kOrthonormal = 1e-6;  // kalibr prints all digits

/// What stands behind a key of a camera: a word, or the numbers of a list.
struct Value {
  int line = 0;
  std::string word;
  std::vector<double> numbers;
};

struct Entry {
  std::string name;
  int line = 0;
  std::map<std::string, Value> values;
};

/// Reads the lines of a chain.
class Reader {
 public:
  explicit Reader(const std::filesystem::path& path) : path_(path) {}

  Result<std::vector<Entry>> read(std::string_view text) {
    for (const std::string_view raw : split(text, '\n')) {
      ++line_;
      const std::string_view line = trim(raw);
      if (line.empty() || line[0] == '#' || line[0] == '%' || line == "---" || line == "...") continue;
      const bool indented = raw[0] == ' ' || raw[0] == '\t';
      if (auto ok = open_ ? continued(line) : indented ? inside(line) : top(line); !ok) return fail(std::move(ok));
    }
    if (open_) return bad("the file is cut off inside of a list");
    return std::move(entries_);
  }

 private:
  [[nodiscard]] tl::unexpected<Error> bad(std::string_view what) const {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path_), line_, what));
  }

  Result<> top(std::string_view line) {
    if (line[0] == '-' && value_ != nullptr) return rows(line);
    value_ = nullptr;
    if (!line.ends_with(':')) return bad("a camera (cam0:) was expected");
    const std::string name(trim(line.substr(0, line.size() - 1)));
    for (const Entry& entry : entries_) {
      if (entry.name == name) return bad(fmt::format("{} occurs twice", name.substr(0, 40)));
    }
    if (entries_.size() >= kMostCameras) return bad(fmt::format("more than {} cameras", kMostCameras));
    entries_.push_back({name, line_, {}});
    return {};
  }

  Result<> inside(std::string_view line) {
    if (line[0] == '-') return value_ == nullptr ? Result<>(bad("a list without a key")) : rows(line);
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos || entries_.empty()) return bad("neither a key nor a value");
    const std::string key(trim(line.substr(0, colon)));
    const auto [found, is_new] = entries_.back().values.try_emplace(key);
    if (!is_new) return bad(fmt::format("{} occurs twice", key.substr(0, 40)));
    value_ = &found->second;
    value_->line = line_;
    return behind(trim(line.substr(colon + 1)));
  }

  /// A row of a matrix, "- [1.0, 0.0, ...]".
  Result<> rows(std::string_view line) { return behind(trim(line.substr(1))); }

  Result<> behind(std::string_view text) {
    if (text.starts_with('[')) return numbers(text.substr(1));
    if (!text.empty()) value_->word = text;
    return {};
  }

  Result<> continued(std::string_view line) { return numbers(line); }

  /// Up to the closing bracket, which may stand on a later line. Of lists that hold no numbers the words are passed over.
  Result<> numbers(std::string_view text) {
    const std::size_t end = text.find(']');
    open_ = end == std::string_view::npos;
    for (const std::string_view cell : split(text.substr(0, end), ',')) {
      const std::string_view word = trim(cell);
      if (word.empty() || word == "[") continue;
      const auto number = parse_double(word);
      if (!number) {
        value_->word = word;
        continue;
      }
      if (value_->numbers.size() >= kMostNumbers) return bad("a list of implausible length");
      value_->numbers.push_back(*number);
    }
    return {};
  }

  const std::filesystem::path& path_;
  std::vector<Entry> entries_;
  Value* value_ = nullptr;
  int line_ = 0;
  bool open_ = false;  ///< inside of [ ... ]
};

class Chain {
 public:
  explicit Chain(const std::filesystem::path& path) : path_(path) {}

  Result<KalibrCamera> camera_of(const Entry& entry) const {
    const auto model = word(entry, "camera_model");
    if (!model) return tl::unexpected(model.error());
    if (*model != "pinhole")
      return bad(entry.line, fmt::format("{}: the camera model {} is not supported", entry.name, model->substr(0, 40)));
    const auto intrinsics = list(entry, "intrinsics", 4);
    if (!intrinsics) return tl::unexpected(intrinsics.error());
    const auto resolution = list(entry, "resolution", 2);
    if (!resolution) return tl::unexpected(resolution.error());
    const auto lens = distortion_of(entry);
    if (!lens) return tl::unexpected(lens.error());
    for (const double size : *resolution) {
      if (!(size >= 1.0 && size <= 1e6 && size == std::floor(size)))
        return bad(entry.line, fmt::format("{}: an image size of {} px", entry.name, size));
    }
    Eigen::VectorXd parameters(4 + static_cast<Eigen::Index>(lens->size()));
    for (Eigen::Index i = 0; i < parameters.size(); ++i)
      parameters(i) = i < 4 ? (*intrinsics)[static_cast<std::size_t>(i)] : (*lens)[static_cast<std::size_t>(i - 4)];
    auto camera = Camera::make(lens->empty() ? LensModel::kPinhole : LensModel::kOpenCv4, static_cast<int>((*resolution)[0]),
                               static_cast<int>((*resolution)[1]), std::move(parameters));
    if (!camera) return bad(entry.line, fmt::format("{}: {}", entry.name, camera.error().message));
    KalibrCamera result{.name = entry.name, .camera = *std::move(camera), .camera_from_previous = {}};
    if (!entry.values.contains("T_cn_cnm1")) return result;
    auto pose = pose_of(entry);
    if (!pose) return fail(std::move(pose));
    result.camera_from_previous = *pose;
    return result;
  }

 private:
  [[nodiscard]] tl::unexpected<Error> bad(int line, std::string_view what) const {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path_), line, what));
  }

  Result<std::string> word(const Entry& entry, const char* key) const {
    const auto found = entry.values.find(key);
    if (found == entry.values.end() || found->second.word.empty())
      return bad(entry.line, fmt::format("{}: the key {} is missing", entry.name, key));
    return found->second.word;
  }

  Result<std::vector<double>> list(const Entry& entry, const char* key, std::size_t count) const {
    const auto found = entry.values.find(key);
    if (found == entry.values.end()) return bad(entry.line, fmt::format("{}: the key {} is missing", entry.name, key));
    const Value& value = found->second;
    if (value.numbers.size() != count || !value.word.empty())
      return bad(value.line, fmt::format("{}: {} takes {} numbers", entry.name, key, count));
    return value.numbers;
  }

  /// OpenCV's four coefficients; none for a lens without distortion.
  Result<std::vector<double>> distortion_of(const Entry& entry) const {
    const auto model = word(entry, "distortion_model");
    if (!model) return tl::unexpected(model.error());
    if (*model == "none") return std::vector<double>();
    if (*model == "radtan") return list(entry, "distortion_coeffs", 4);
    return bad(entry.line, fmt::format("{}: the distortion model {} is not supported; radtan and none are", entry.name,
                                       model->substr(0, 40)));
  }

  Result<Pose> pose_of(const Entry& entry) const {
    const auto values = list(entry, "T_cn_cnm1", 16);
    if (!values) return tl::unexpected(values.error());
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(values->data());
    const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
    const bool proper = (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).norm() < kOrthonormal &&
                        rotation.determinant() > 0.0 && matrix.row(3) == Eigen::RowVector4d(0.0, 0.0, 0.0, 1.0);
    if (!proper) {
      return bad(entry.values.at("T_cn_cnm1").line, fmt::format("{}: T_cn_cnm1 is no rotation and translation", entry.name));
    }
    return Pose{Eigen::Quaterniond(rotation).normalized(), kMetre_mm * matrix.topRightCorner<3, 1>()};
  }

  const std::filesystem::path& path_;
};

}  // namespace

bool is_kalibr_chain(std::string_view text) {
  const auto lines = split(text, '\n');
  return std::any_of(lines.begin(), lines.end(), [](std::string_view line) { return trim(line) == "cam0:" && line[0] == 'c'; });
}

Result<std::vector<KalibrCamera>> parse_kalibr_chain(const std::filesystem::path& path, std::string_view text) {
  const auto entries = Reader(path).read(text);
  if (!entries) return tl::unexpected(entries.error());
  std::vector<KalibrCamera> cameras;
  for (const Entry& entry : *entries) {
    auto camera = Chain(path).camera_of(entry);
    if (!camera) return fail(std::move(camera));
    cameras.push_back(*std::move(camera));
  }
  if (cameras.empty()) return fail(ErrorCode::kBadInput, fmt::format("{}: the chain holds no camera", shown(path)));
  return cameras;
}

Result<std::vector<KalibrCamera>> read_kalibr_chain(const std::filesystem::path& path) {
  const auto text = read_file(path, kMaxBytes);
  if (!text) return tl::unexpected(text.error());
  return parse_kalibr_chain(path, *text);
}

}  // namespace crosstie::base
