#pragma once

#include <cstddef>
#include <span>

#include "base/image.h"
#include "base/result.h"

namespace crosstie::devices::detail {

/// How grey levels lie in memory (GenICam's Pixel Format Naming Convention, PFNC, and GigE Vision's older packed format).
enum class RawFormat {
  kMono8,
  kMono12,        ///< 16 bits each, little endian, the upper four are 0
  kMono12p,       ///< two pixels in 3 bytes, lowest bits first: a[7:0], b[3:0] a[11:8], b[11:4]
  kMono12Packed,  ///< two pixels in 3 bytes, GigE Vision: a[11:4], b[3:0] a[3:0], b[11:4]
  kMono16,        ///< little endian
};

/// The image that `bytes` hold, with the format's white level. Rows of the unpacked formats end with `padding_bytes`; packed ones follow
/// each other without a gap. Error kBadInput where there are fewer bytes than the image takes.
base::Result<base::Image> unpack_pixels(std::span<const std::byte> bytes, int width, int height, std::size_t padding_bytes,
                                        RawFormat format);

}  // namespace crosstie::devices::detail
