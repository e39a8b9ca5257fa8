#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace crosstie::markers::detail {

/// Pixels [left, left + width) x [top, top + height).
struct Window {
  int left, top, width, height;
};

/// A figure through the blur, with the derivatives along x and y, at the pixels of a window: row by row, `stride` apart.
struct BlurredCover {
  Window window;
  std::size_t stride;
  std::vector<float> value, x, y, xx, xy, yy;

  /// Where a pixel's values stand; nothing beside the window.
  [[nodiscard]] std::optional<std::size_t> index(int x_px, int y_px) const {
    const int column = x_px - window.left;
    const int row = y_px - window.top;
    if (column < 0 || row < 0 || column >= window.width || row >= window.height) return std::nullopt;
    return static_cast<std::size_t>(row) * stride + static_cast<std::size_t>(column);
  }
};

/// The image of plane figures on a window of pixels: what share of each pixel's neighbourhood they cover, through a Gaussian.
///
/// Model: the cover of every cell of a grid (2 or 3 cells per pixel) by polygons, exact, blurred by the Gaussian that makes,
/// together with the cell's own box, the blur asked for. For a disc of 3.3 px the value errs by at most 3e-3, in the centre by
/// 5e-4 px; less for larger ones.
/// Blurs of at least 0.28 px, which is that of a pixel alone. Polygons that leave the window are cut off at its border.
class CoverImage {
 public:
  CoverImage(const Window& window, double blur_px);

  /// Adds the inside of a closed polygon (px; the last corner is joined to the first) that runs clockwise in the image; one that
  /// runs the other way round is taken off.
  void add(std::span<const Eigen::Vector2d> corners);

  [[nodiscard]] BlurredCover blurred() const;

 private:
  void add_edge(Eigen::Vector2d from, Eigen::Vector2d to);

  Window window_;
  int cells_;   ///< per pixel along each axis
  int margin_;  ///< pixels beside the window that the blur reaches
  double kernel_px_;
  std::ptrdiff_t stride_;
  std::vector<float> change_;  ///< of the cover from cell to cell along each row
};

}  // namespace crosstie::markers::detail
