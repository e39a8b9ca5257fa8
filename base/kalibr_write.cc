#include <string>

#include <fmt/format.h>

#include "base/file.h"
#include "base/kalibr.h"

namespace crosstie::base {
namespace {

constexpr Eigen::Index kRadtan = 4;  ///< coefficients of radtan, the first of every model of OpenCV

std::string digits(double value) { return fmt::format("{:.17g}", value == 0.0 ? 0.0 : value); }

std::string list(const Eigen::VectorXd& values) {
  std::string text;
  for (Eigen::Index i = 0; i < values.size(); ++i) text += (i == 0 ? "" : ", ") + digits(values[i]);
  return "[" + text + "]";
}

Result<> check(const std::filesystem::path& path, const KalibrCamera& one) {
  const Eigen::VectorXd& p = one.camera.parameters();
  const bool opencv = one.camera.model() == LensModel::kPinhole || one.camera.model() == LensModel::kOpenCv4 ||
                      one.camera.model() == LensModel::kOpenCv5 || one.camera.model() == LensModel::kOpenCv8 ||
                      one.camera.model() == LensModel::kOpenCv12;
  const bool fits = opencv && (p.size() <= 4 + kRadtan || p.tail(p.size() - 4 - kRadtan).isZero(0.0));
  if (fits) return {};
  return fail(ErrorCode::kUsage,
              fmt::format("{}: kalibr's radtan has four coefficients, but camera {} is {}; calibrate it as opencv4",
                          shown(path), one.name, lens_model_name(one.camera.model())));
}

}  // namespace

Result<> write_kalibr_chain(const std::filesystem::path& path, const std::vector<KalibrCamera>& cameras) {
  constexpr double kMetre_mm = 1000.0;
  std::string text;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const KalibrCamera& one = cameras[i];
    if (auto checked = check(path, one); !checked) return checked;
    const Eigen::VectorXd& p = one.camera.parameters();
    const Eigen::VectorXd lens = p.size() > 4 ? Eigen::VectorXd(p.segment(4, kRadtan)) : Eigen::VectorXd::Zero(kRadtan);
    text += fmt::format("cam{}:\n", i);
    if (i > 0 && one.camera_from_previous) {
      text += "  T_cn_cnm1:\n";
      Eigen::Matrix<double, 4, 4> matrix = one.camera_from_previous->matrix();
      matrix.topRightCorner<3, 1>() /= kMetre_mm;
      for (Eigen::Index row = 0; row < 4; ++row) text += fmt::format("  - {}\n", list(matrix.row(row).transpose()));
    }
    text += fmt::format(
        "  camera_model: pinhole\n  distortion_coeffs: {}\n  distortion_model: radtan\n  intrinsics: {}\n  resolution: [{}, "
        "{}]\n",
        list(lens), list(p.head(4)), one.camera.width_px(), one.camera.height_px());
  }
  return write_file_atomically(path, text);
}

}  // namespace crosstie::base
