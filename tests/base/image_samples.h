#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace crosstie::tests {

/// The grey level of the picture in all samples: smooth, with an edge, 97 x 61 px.
inline constexpr int kSampleWidth = 97;
inline constexpr int kSampleHeight = 61;
inline int sample_grey(int x, int y) { return (x > 40 ? 180 : 40) + (3 * x + 5 * y) % 60; }

/// One good file of each kind, by OpenCV's encoders: name and bytes.
std::vector<std::pair<std::string, std::string>> image_samples();

/// A PNG put together here, with uncompressed data: colour type 0 grey, 3 palette; the palette maps i to the grey level 255 -
/// i. `rows` holds the packed bytes of each row.
std::string handmade_png(std::uint32_t width, std::uint32_t height, int bits, int colour_type,
                         const std::vector<std::string>& rows);

}  // namespace crosstie::tests
