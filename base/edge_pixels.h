#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"

namespace crosstie::base {

/// What an edge of an image is, as the phase map tells.
enum class EdgeClass : std::uint8_t {
  kMaterial,  ///< the surface ends or bends away: phases end, jump or change their slope
  kShadow,    ///< the projector's light ends, and nearer material beyond casts the shadow
  kPaint,     ///< phases go on unchanged: only the surface's brightness steps
};
inline constexpr std::size_t kEdgeClassCount = 3;

/// "material", "shadow", "paint".
[[nodiscard]] std::string_view edge_class_name(EdgeClass kind);
[[nodiscard]] std::optional<EdgeClass> edge_class_from_name(std::string_view name);

/// A place of an image edge, known across it only.
struct EdgePixel {
  Eigen::Vector2d at_px = Eigen::Vector2d::Zero();
  /// Unit, across the edge: from the material to where it ends; from the lit to the dark side of a shadow, from bright to dark of paint.
  Eigen::Vector2d out = Eigen::Vector2d::UnitX();
  double sigma_px = 0.0;  ///< across: camera's noise, the surface's grain, disagreement of the edge images
  double noise_px = 0.0;  ///< of the camera's noise alone
  /// Extent of a band beside the edge on its outer side, where one is seen: a chamfer, a bright lip. 0: one step.
  double band_px = 0.0;
  double step = 0.0;  ///< level beyond the edge minus level before it [grey levels of the mean fringe image]
  EdgeClass kind = EdgeClass::kMaterial;
};

/// The edges in one camera's image of a scan.
struct EdgePixels {
  std::string camera;
  int width = 0;
  int height = 0;
  double blur_px = 0.0;  ///< sigma of the camera's point spread, pixel included, as found
  /// Each position comes from a piece of edge of this length: those nearer to each other share pixels and are not independent.
  double piece_px = 0.0;
  std::vector<EdgePixel> pixels;

  [[nodiscard]] std::array<std::int64_t, kEdgeClassCount> counts() const;
};

/// edge_pixels.csv: camera,x_px,y_px,out_x,out_y,sigma_px,noise_px,band_px,step,class. Size, blur and piece are in the scan's result.
Result<> write_edge_pixels(const std::filesystem::path& path, const std::vector<EdgePixels>& cameras);
/// Reads it back, cameras in the order of their first rows. kBadInput with file and line: unknown class, a direction that is not of unit
/// length, a sigma that is not positive.
Result<std::vector<EdgePixels>> read_edge_pixels(const std::filesystem::path& path);

}  // namespace crosstie::base
