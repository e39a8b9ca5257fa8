#include "base/camera_file.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <fmt/format.h>

#include "base/detail/opencv_yaml.h"
#include "base/detail/python_literal.h"
#include "base/file.h"
#include "base/kalibr.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

using detail::PythonLiteral;
using detail::YamlDocument;

/// mrcal's models may carry the whole calibration problem inside.
constexpr std::size_t kMaxCameraFileBytes = std::size_t{256} << 20;
/// Ours: mrcal passes over keys that it does not know.
const std::string kCovarianceKey = "intrinsics_covariance";

tl::unexpected<Error> bad(const std::filesystem::path& path, std::string_view what) {
  return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), what));
}

Result<Camera> make_camera(const std::filesystem::path& path, LensModel model, double width, double height,
                           Eigen::VectorXd parameters) {
  const auto is_size = [](double v) { return v >= 1.0 && v <= 1e6 && v == std::floor(v); };
  if (!is_size(width) || !is_size(height)) return bad(path, fmt::format("an image size of {} x {} px", width, height));
  auto camera = Camera::make(model, static_cast<int>(width), static_cast<int>(height), std::move(parameters));
  if (!camera) return bad(path, camera.error().message);
  return camera;
}

/// The numbers of a list; nothing where it is none or holds anything else.
std::optional<Eigen::VectorXd> numbers(const PythonLiteral* list) {
  if (list == nullptr || list->kind != PythonLiteral::Kind::kList) return std::nullopt;
  Eigen::VectorXd result(static_cast<Eigen::Index>(list->items.size()));
  for (std::size_t i = 0; i < list->items.size(); ++i) {
    if (list->items[i].kind != PythonLiteral::Kind::kNumber) return std::nullopt;
    result[static_cast<Eigen::Index>(i)] = list->items[i].number;
  }
  return result;
}

bool is_none(const PythonLiteral& literal) { return literal.kind == PythonLiteral::Kind::kName && literal.text == "None"; }

/// mrcal repeats the first corner at the end; here every corner stands once.
std::optional<Camera::Region> region_of(const PythonLiteral& list) {
  if (list.kind != PythonLiteral::Kind::kList) return std::nullopt;
  Camera::Region region;
  for (const PythonLiteral& item : list.items) {
    const auto corner = numbers(&item);
    if (!corner || corner->size() != 2) return std::nullopt;
    region.emplace_back(*corner);
  }
  if (region.size() > 1 && region.front() == region.back()) region.pop_back();
  return region;
}

/// A symmetric matrix from its upper triangle, row by row; nothing where it cannot be a covariance.
std::optional<Eigen::MatrixXd> covariance_of(const PythonLiteral& list, Eigen::Index size) {
  const auto values = numbers(&list);
  if (!values || values->size() != size * (size + 1) / 2) return std::nullopt;
  Eigen::MatrixXd matrix(size, size);
  Eigen::Index next = 0;
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index k = i; k < size; ++k) matrix(i, k) = matrix(k, i) = (*values)[next++];
  }
  const Eigen::VectorXd sigmas = matrix.diagonal().cwiseMax(0.0).cwiseSqrt();
  const bool possible = matrix.diagonal().minCoeff() >= 0.0 &&
                        (matrix.cwiseAbs().array() <= (1.0 + 1e-6) * (sigmas * sigmas.transpose()).array()).all();
  return possible ? std::optional<Eigen::MatrixXd>(std::move(matrix)) : std::nullopt;
}

Result<Camera> read_cameramodel(const std::filesystem::path& path, std::string_view text) {
  const auto literal = detail::parse_python_literal(text);
  if (!literal)
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), literal.error().line, literal.error().reason));
  const PythonLiteral* name = literal->find("lensmodel");
  if (name == nullptr || name->kind != PythonLiteral::Kind::kText) return bad(path, "the key lensmodel is missing");
  const auto model = lens_model_from_name(name->text);
  if (!model) {
    return bad(path, fmt::format("the lens model {} is not read; known are LENSMODEL_PINHOLE, LENSMODEL_OPENCV4 to 12 and "
                                 "LENSMODEL_SPLINED_STEREOGRAPHIC with its configuration",
                                 name->text.substr(0, 80)));
  }
  auto parameters = numbers(literal->find("intrinsics"));
  if (!parameters) return bad(path, "the list intrinsics is missing");
  const auto size = numbers(literal->find("imagersize"));
  if (!size || size->size() != 2) return bad(path, "the list imagersize of two numbers is missing");
  auto camera = make_camera(path, *model, (*size)[0], (*size)[1], *std::move(parameters));
  if (!camera) return camera;
  if (const PythonLiteral* region = literal->find("valid_intrinsics_region"); region != nullptr && !is_none(*region)) {
    auto polygon = region_of(*region);
    if (!polygon) return bad(path, "valid_intrinsics_region is no list of points [x, y]");
    camera->set_valid_region(*std::move(polygon));
  }
  if (const PythonLiteral* covariance = literal->find(kCovarianceKey); covariance != nullptr && !is_none(*covariance)) {
    auto matrix = covariance_of(*covariance, camera->parameters().size());
    if (!matrix) {
      return bad(path, fmt::format("{} is not the upper triangle of a covariance of {} parameters", kCovarianceKey,
                                   camera->parameters().size()));
    }
    camera->set_covariance(*std::move(matrix));
  }
  return camera;
}

/// The model with that many coefficients; the two of a tilted sensor (14) are accepted where they are zero.
Result<Eigen::VectorXd> distortion_of(const std::filesystem::path& path, const YamlDocument& yaml) {
  const auto found = yaml.matrices.find("distortion_coefficients");
  if (found == yaml.matrices.end()) return bad(path, "distortion_coefficients are missing");
  std::vector<double> k = found->second.data;
  if (found->second.rows != 1 && found->second.columns != 1) return bad(path, "distortion_coefficients are no vector");
  if (k.size() == 14) {
    if (k[12] != 0.0 || k[13] != 0.0) return bad(path, "a tilted sensor (14 distortion coefficients) is not supported");
    k.resize(12);
  }
  return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(k.data(), static_cast<Eigen::Index>(k.size())));
}

std::optional<LensModel> model_of(Eigen::Index coefficients) {
  for (const auto model : {LensModel::kOpenCv4, LensModel::kOpenCv5, LensModel::kOpenCv8, LensModel::kOpenCv12}) {
    if (parameter_count(model) - 4 == coefficients) return model;
  }
  return std::nullopt;
}

Result<Camera> read_opencv_yaml(const std::filesystem::path& path, std::string_view text) {
  const auto yaml = detail::parse_opencv_yaml(text);
  if (!yaml) return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), yaml.error().line, yaml.error().reason));
  const auto scalar = [&](const char* key) {
    const auto found = yaml->scalars.find(key);
    return found == yaml->scalars.end() ? std::optional<std::string>() : found->second;
  };
  if (const auto fisheye = scalar("fisheye_model"); fisheye && parse_double(*fisheye) != 0.0)
    return bad(path, "a fisheye model is not supported");
  if (const auto model = scalar("distortion_model"); model && *model != "plumb_bob" && *model != "rational_polynomial") {
    return bad(path, fmt::format("the distortion model {} is not supported", model->substr(0, 40)));
  }
  const auto matrix = yaml->matrices.find("camera_matrix");
  if (matrix == yaml->matrices.end() || matrix->second.rows != 3 || matrix->second.columns != 3) {
    return bad(path, "no camera file: neither mrcal's .cameramodel nor OpenCV's YAML with a 3 x 3 camera_matrix");
  }
  const std::vector<double>& m = matrix->second.data;
  if (m[1] != 0.0 || m[3] != 0.0 || m[6] != 0.0 || m[7] != 0.0 || m[8] != 1.0) {
    return bad(path, "camera_matrix is not fx 0 cx, 0 fy cy, 0 0 1 (a skew is not supported)");
  }
  const auto width = scalar("image_width");
  const auto height = scalar("image_height");
  const auto width_px = width ? parse_double(*width) : std::nullopt;
  const auto height_px = height ? parse_double(*height) : std::nullopt;
  if (!width_px || !height_px) return bad(path, "image_width and image_height are missing");
  auto k = distortion_of(path, *yaml);
  if (!k) return fail(std::move(k));
  const auto model = model_of(k->size());
  if (!model) return bad(path, fmt::format("{} distortion coefficients; 4, 5, 8, 12 or 14 are known", k->size()));
  Eigen::VectorXd parameters(4 + k->size());
  parameters << m[0], m[4], m[2], m[5], *k;
  return make_camera(path, *model, *width_px, *height_px, std::move(parameters));
}

Result<Camera> read_of_chain(const std::filesystem::path& path, std::string_view text, const std::string& name) {
  auto chain = parse_kalibr_chain(path, text);
  if (!chain) return fail(std::move(chain));
  if (name.empty() && chain->size() == 1) return std::move(chain->front().camera);
  std::string names;
  for (KalibrCamera& one : *chain) {
    if (one.name == name) return std::move(one.camera);
    names += (names.empty() ? "" : ", ") + one.name;
  }
  return fail(ErrorCode::kUsage, fmt::format("{}: {}; --camera is one of {}", shown(path),
                                             name.empty() ? std::string("several cameras") : "no camera " + name, names));
}

/// Seventeen significant digits read back exactly.
std::string digits(double value) { return fmt::format("{:.17g}", value); }

std::string joined(const Eigen::VectorXd& values) {
  std::string result;
  for (Eigen::Index i = 0; i < values.size(); ++i)
    fmt::format_to(std::back_inserter(result), "{}{}", i == 0 ? "" : ", ", digits(values[i]));
  return result;
}

std::string region_text(const std::optional<Camera::Region>& region) {
  if (!region) return "";
  std::string corners;
  const auto add = [&](const Eigen::Vector2d& corner) {
    fmt::format_to(std::back_inserter(corners), "        [ {}, {} ],\n", digits(corner.x()), digits(corner.y()));
  };
  for (const Eigen::Vector2d& corner : *region) add(corner);
  if (!region->empty()) add(region->front());
  return fmt::format("    # where observations stand behind the model\n    'valid_intrinsics_region': [\n{}    ],\n\n",
                     corners);
}

std::string covariance_text(const Eigen::MatrixXd& covariance) {
  if (covariance.size() == 0) return "";
  std::string rows;
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    const Eigen::VectorXd row = covariance.row(i).tail(covariance.cols() - i);
    fmt::format_to(std::back_inserter(rows), "        {},\n", joined(row));
  }
  return fmt::format("    # upper triangle, row by row\n    '{}': [\n{}    ],\n\n", kCovarianceKey, rows);
}

}  // namespace

Result<Camera> read_camera(const std::filesystem::path& path) { return read_named_camera(path, {}); }

Result<Camera> read_named_camera(const std::filesystem::path& path, const std::string& name) {
  auto contents = read_file(path, kMaxCameraFileBytes);
  if (!contents) return fail(std::move(contents));
  std::string_view text = *contents;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  // A cameramodel is a Python dictionary: past blanks and comments it begins with a brace.
  std::string_view rest = trim(text);
  while (rest.starts_with('#')) rest = trim(rest.substr(std::min(rest.find('\n'), rest.size())));
  if (rest.empty()) return bad(path, "the file is empty");
  if (rest.starts_with('{')) return read_cameramodel(path, text);
  return is_kalibr_chain(text) ? read_of_chain(path, text, name) : read_opencv_yaml(path, text);
}

Result<> write_cameramodel(const std::filesystem::path& path, const Camera& camera, const Pose& camera_from_reference) {
  constexpr double kMetre_mm = 1000.0;
  Eigen::VectorXd extrinsics(6);
  extrinsics << rotation_log(camera_from_reference.rotation), camera_from_reference.translation_mm / kMetre_mm;
  const bool placed = !extrinsics.isZero(0.0);
  std::string names;
  for (const auto name : parameter_names(camera.model()))
    fmt::format_to(std::back_inserter(names), "{}{}", names.empty() ? "" : " ", name);
  return write_file_atomically(
      path, fmt::format("{{\n"
                        "    'lensmodel':  '{}',\n\n"
                        "    # {}\n"
                        "    'intrinsics': [ {} ],\n\n"
                        "{}{}"
                        "    # {}\n"
                        "    'extrinsics': [ {} ],\n\n"
                        "    'imagersize': [ {}, {} ]\n"
                        "}}\n",
                        lens_model_name(camera.model()), names, joined(camera.parameters()),
                        region_text(camera.valid_region_px()), covariance_text(camera.covariance()),
                        placed ? "from the common frame to the camera's: rad, m" : "none: the frame is the camera's own",
                        joined(extrinsics), camera.width_px(), camera.height_px()));
}

Result<> write_opencv_yaml(const std::filesystem::path& path, const Camera& camera) {
  if (camera.model().is_splined()) {
    return fail(ErrorCode::kUsage, fmt::format("{}: OpenCV has no splined lens model", shown(path)));
  }
  if (camera.model() == LensModel::kAicon) {
    return fail(ErrorCode::kUsage, fmt::format("{}: OpenCV has no lens model with AICON's balanced distortion", shown(path)));
  }
  const Eigen::VectorXd& p = camera.parameters();
  // OpenCV has no model without coefficients; four zeros are the same projection.
  const Eigen::VectorXd k = p.size() > 4 ? Eigen::VectorXd(p.tail(p.size() - 4)) : Eigen::VectorXd::Zero(4);
  return write_file_atomically(path, fmt::format("%YAML:1.0\n---\n"
                                                 "image_width: {}\n"
                                                 "image_height: {}\n"
                                                 "camera_matrix: !!opencv-matrix\n"
                                                 "   rows: 3\n   cols: 3\n   dt: d\n"
                                                 "   data: [ {}, 0., {},\n       0., {}, {},\n       0., 0., 1. ]\n"
                                                 "distortion_coefficients: !!opencv-matrix\n"
                                                 "   rows: {}\n   cols: 1\n   dt: d\n"
                                                 "   data: [ {} ]\n",
                                                 camera.width_px(), camera.height_px(), digits(p[0]), digits(p[2]),
                                                 digits(p[1]), digits(p[3]), k.size(), joined(k)));
}

}  // namespace crosstie::base
