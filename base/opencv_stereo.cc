#include "base/opencv_stereo.h"

#include <array>

#include <fmt/format.h>

#include "base/detail/opencv_yaml.h"
#include "base/file.h"

namespace crosstie::base {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxBytes = 1U << 20U;

tl::unexpected<Error> bad(const fs::path& path, const std::string& what) {
  return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), what));
}

Result<detail::YamlDocument> document(const fs::path& path) {
  const auto text = read_file(path, kMaxBytes);
  if (!text) return tl::unexpected(text.error());
  auto yaml = detail::parse_opencv_yaml(*text);
  if (!yaml) return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), yaml.error().line, yaml.error().reason));
  return *std::move(yaml);
}

/// The values of a matrix of that many numbers.
Result<std::vector<double>> matrix(const detail::YamlDocument& yaml, const fs::path& path, const std::string& key,
                                   std::size_t count) {
  const auto found = yaml.matrices.find(key);
  if (found == yaml.matrices.end()) return bad(path, "the matrix " + key + " is missing");
  if (count != 0 && found->second.data.size() != count)
    return bad(path, fmt::format("the matrix {} has {} values, {} are expected", key, found->second.data.size(), count));
  return found->second.data;
}

Result<Camera> camera(const detail::YamlDocument& yaml, const fs::path& path, const std::string& number, int width_px,
                      int height_px) {
  const auto m = matrix(yaml, path, "m" + number, 9);
  if (!m) return tl::unexpected(m.error());
  auto d = matrix(yaml, path, "d" + number, 0);
  if (!d) return tl::unexpected(d.error());
  if (d->size() == 14 && (*d)[12] == 0.0 && (*d)[13] == 0.0) d->resize(12);
  for (const LensModel model : {LensModel::kOpenCv4, LensModel::kOpenCv5, LensModel::kOpenCv8, LensModel::kOpenCv12}) {
    if (static_cast<std::size_t>(base::parameter_count(model)) != 4 + d->size()) continue;
    Eigen::VectorXd parameters(base::parameter_count(model));
    parameters << (*m)[0], (*m)[4], (*m)[2], (*m)[5],
        Eigen::Map<const Eigen::VectorXd>(d->data(), static_cast<Eigen::Index>(d->size()));
    auto made = Camera::make(model, width_px, height_px, std::move(parameters));
    if (!made) return bad(path, made.error().message);
    return made;
  }
  return bad(path, fmt::format("D{} has {} coefficients; 4, 5, 8, 12 or 14 (the last two 0) are known", number, d->size()));
}

template <typename Matrix>
std::string matrix_text(const char* key, const Matrix& matrix) {
  std::string values;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j)
      values += fmt::format("{}{:.17g}", values.empty() ? "" : ", ", matrix(i, j));
  }
  return fmt::format("{}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {} ]\n", key, matrix.rows(),
                     matrix.cols(), values);
}

Result<std::string> lens_text(const fs::path& path, const char* number, const Camera& camera) {
  if (camera.model().is_splined() || camera.model() == LensModel::kAicon) {
    return fail(ErrorCode::kUsage,
                fmt::format("{}: OpenCV has no lens model {}", shown(path), lens_model_name(camera.model())));
  }
  const Eigen::VectorXd& p = camera.parameters();
  Eigen::Matrix3d m;
  m << p[0], 0.0, p[2], 0.0, p[1], p[3], 0.0, 0.0, 1.0;
  const Eigen::RowVectorXd d =
      p.size() > 4 ? Eigen::RowVectorXd(p.tail(p.size() - 4).transpose()) : Eigen::RowVectorXd::Zero(4);
  return matrix_text(fmt::format("M{}", number).c_str(), m) + matrix_text(fmt::format("D{}", number).c_str(), d);
}

}  // namespace

Result<> write_opencv_stereo(const fs::path& intrinsic, const fs::path& extrinsic, const Camera& left, const Camera& right,
                             const Pose& right_from_left) {
  const auto first = lens_text(intrinsic, "1", left);
  if (!first) return tl::unexpected(first.error());
  const auto second = lens_text(intrinsic, "2", right);
  if (!second) return tl::unexpected(second.error());
  if (auto written = write_file_atomically(intrinsic, "%YAML:1.0\n---\n" + *first + *second); !written) return written;
  const Eigen::Matrix3d r = right_from_left.rotation.toRotationMatrix();
  return write_file_atomically(extrinsic,
                               "%YAML:1.0\n---\n" + matrix_text("R", r) + matrix_text("T", right_from_left.translation_mm));
}

Result<Head> read_opencv_stereo(const fs::path& intrinsic, const fs::path& extrinsic, int width_px, int height_px) {
  const auto lenses = document(intrinsic);
  if (!lenses) return tl::unexpected(lenses.error());
  const auto poses = document(extrinsic);
  if (!poses) return tl::unexpected(poses.error());
  auto left = camera(*lenses, intrinsic, "1", width_px, height_px);
  if (!left) return fail(std::move(left));
  auto right = camera(*lenses, intrinsic, "2", width_px, height_px);
  if (!right) return fail(std::move(right));
  const auto r = matrix(*poses, extrinsic, "r", 9);
  if (!r) return tl::unexpected(r.error());
  const auto t = matrix(*poses, extrinsic, "t", 3);
  if (!t) return tl::unexpected(t.error());
  Eigen::Matrix4d right_from_left = Eigen::Matrix4d::Identity();
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index j = 0; j < 3; ++j) right_from_left(i, j) = (*r)[static_cast<std::size_t>(3 * i + j)];
    right_from_left(i, 3) = (*t)[static_cast<std::size_t>(i)];
  }
  const auto pose = pose_from_matrix(right_from_left);
  if (!pose) return bad(extrinsic, pose.error().message);
  return Head{"left", "right", *std::move(left), *std::move(right), *pose, {}, {}};
}

}  // namespace crosstie::base
