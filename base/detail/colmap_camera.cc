#include "base/detail/colmap_camera.h"

#include <algorithm>
#include <array>
#include <limits>

#include <fmt/format.h>

#include "base/detail/colmap_pixel.h"

namespace crosstie::base::detail {
namespace {

constexpr std::array kLenses = {
    ColmapLens{"SIMPLE_PINHOLE", 0, 3},  // f cx cy
    ColmapLens{"PINHOLE", 1, 4},         // fx fy cx cy
    ColmapLens{"SIMPLE_RADIAL", 2, 4},   // f cx cy k1
    ColmapLens{"RADIAL", 3, 5},          // f cx cy k1 k2
    ColmapLens{"OPENCV", 4, 8},          // fx fy cx cy k1 k2 p1 p2
    ColmapLens{"FULL_OPENCV", 6, 12},    // fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6
};

LensModel model_of(const ColmapLens& lens) {
  if (lens.name.ends_with("PINHOLE")) return LensModel::kPinhole;
  return lens.name == "FULL_OPENCV" ? LensModel::kOpenCv8 : LensModel::kOpenCv4;
}

}  // namespace

const ColmapLens* colmap_lens(std::string_view name) {
  const auto found = std::find_if(kLenses.begin(), kLenses.end(), [&](const ColmapLens& lens) { return lens.name == name; });
  return found == kLenses.end() ? nullptr : &*found;
}

const ColmapLens* colmap_lens(std::int32_t id) {
  const auto found = std::find_if(kLenses.begin(), kLenses.end(), [&](const ColmapLens& lens) { return lens.id == id; });
  return found == kLenses.end() ? nullptr : &*found;
}

std::string colmap_lens_names() {
  std::string names;
  for (const ColmapLens& lens : kLenses) names += fmt::format("{}{}", names.empty() ? "" : ", ", lens.name);
  return names;
}

tl::expected<Camera, std::string> camera_of_colmap(const ColmapLens& lens, std::uint64_t width_px, std::uint64_t height_px,
                                                   const std::vector<double>& parameters) {
  constexpr std::uint64_t kMaxSize = std::numeric_limits<int>::max();
  if (width_px > kMaxSize || height_px > kMaxSize) {
    return tl::unexpected<std::string>(fmt::format("an image size of {} x {} px", width_px, height_px));
  }
  const LensModel model = model_of(lens);
  // One focal length (simple and radial models) stands for both.
  const bool single_focal = lens.name.starts_with("SIMPLE") || lens.name == "RADIAL";
  Eigen::VectorXd ours = Eigen::VectorXd::Zero(parameter_count(model));
  Eigen::Index next = 0;
  ours[next++] = parameters[0];
  if (single_focal) ours[next++] = parameters[0];
  for (std::size_t i = 1; i < parameters.size(); ++i) ours[next++] = parameters[i];
  ours[2] = from_colmap_pixel(ours[2]);
  ours[3] = from_colmap_pixel(ours[3]);
  auto camera = Camera::make(model, static_cast<int>(width_px), static_cast<int>(height_px), std::move(ours));
  if (!camera) return tl::unexpected<std::string>(camera.error().message);
  return *std::move(camera);
}

tl::expected<ColmapLensValues, std::string> colmap_of_camera(const Camera& camera) {
  const Eigen::VectorXd& p = camera.parameters();
  ColmapLensValues values;
  std::size_t count = static_cast<std::size_t>(p.size());
  switch (camera.model()) {
    case LensModel::kPinhole:
      values.lens = colmap_lens("PINHOLE");
      break;
    case LensModel::kOpenCv4:
      values.lens = colmap_lens("OPENCV");
      break;
    case LensModel::kOpenCv12:
      if (!p.tail(4).isZero(0.0)) {
        return tl::unexpected<std::string>("COLMAP has no lens model with thin-prism terms; calibrate with opencv8 or fewer");
      }
      count = 12;
      [[fallthrough]];
    case LensModel::kOpenCv5:
    case LensModel::kOpenCv8:
      values.lens = colmap_lens("FULL_OPENCV");
      break;
    case LensModel::kAicon:
      return tl::unexpected<std::string>(
          "COLMAP has no lens model with AICON's balanced distortion; adjust with opencv4 or opencv5");
    case LensModel::Kind::kSplined:
      return tl::unexpected<std::string>("COLMAP has no splined lens model; calibrate with opencv4, opencv5 or opencv8");
  }
  values.parameters.assign(p.data(), p.data() + count);
  values.parameters.resize(static_cast<std::size_t>(values.lens->parameter_count), 0.0);
  values.parameters[2] = to_colmap_pixel(values.parameters[2]);
  values.parameters[3] = to_colmap_pixel(values.parameters[3]);
  return values;
}

}  // namespace crosstie::base::detail
