#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <tl/expected.hpp>

#include "base/camera.h"

namespace crosstie::base::detail {

/// A lens model of COLMAP that has an exact counterpart here.
struct ColmapLens {
  std::string_view name;
  std::int32_t id;  ///< in binary files
  int parameter_count;
};

[[nodiscard]] const ColmapLens* colmap_lens(std::string_view name);
[[nodiscard]] const ColmapLens* colmap_lens(std::int32_t id);
/// "SIMPLE_PINHOLE, PINHOLE, ...": for messages.
[[nodiscard]] std::string colmap_lens_names();

/// The camera of COLMAP's parameters (their number is the lens'); the error is the reason.
tl::expected<Camera, std::string> camera_of_colmap(const ColmapLens& lens, std::uint64_t width_px, std::uint64_t height_px,
                                                   const std::vector<double>& parameters);

struct ColmapLensValues {
  const ColmapLens* lens = nullptr;
  std::vector<double> parameters;
};

/// COLMAP's lens and parameters of a camera; the error is the reason.
tl::expected<ColmapLensValues, std::string> colmap_of_camera(const Camera& camera);

}  // namespace crosstie::base::detail
