#include "devices/detail/raw_pixels.h"

#include <cstdint>
#include <tuple>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace crosstie::devices::detail {
namespace {

using base::ErrorCode;
using ::testing::ElementsAre;

std::vector<std::byte> bytes_of(std::initializer_list<int> values) {
  std::vector<std::byte> bytes;
  for (const int value : values) bytes.push_back(static_cast<std::byte>(value));
  return bytes;
}

std::vector<int> samples_of(const base::Image& image) {
  std::vector<int> samples;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      samples.push_back(image.bits() == 8 ? image.view().row<std::uint8_t>(y)[x] : image.view().row<std::uint16_t>(y)[x]);
    }
  }
  return samples;
}

TEST(RawPixels, UnpackedFormatsWithPaddedRows) {
  const auto eight = unpack_pixels(bytes_of({1, 2, 99, 3, 4}), 2, 2, 1, RawFormat::kMono8);
  EXPECT_THAT(samples_of(*eight), ElementsAre(1, 2, 3, 4));
  EXPECT_EQ(eight->white_level(), 255.0);
  const auto twelve = unpack_pixels(bytes_of({0xBC, 0x0A, 99, 99, 0xFF, 0x0F}), 1, 2, 2, RawFormat::kMono12);
  EXPECT_THAT(samples_of(*twelve), ElementsAre(0xABC, 0xFFF));
  EXPECT_EQ(twelve->white_level(), 4095.0);
  const auto sixteen = unpack_pixels(bytes_of({0x34, 0x12, 0xFF, 0xFF}), 2, 1, 0, RawFormat::kMono16);
  EXPECT_THAT(samples_of(*sixteen), ElementsAre(0x1234, 0xFFFF));
  EXPECT_EQ(sixteen->white_level(), 65535.0);
}

// The layouts as the standards draw them, for the pixels 0xABC and 0x123.
TEST(RawPixels, Mono12pHasTheLowestBitsFirst) {
  EXPECT_THAT(samples_of(*unpack_pixels(bytes_of({0xBC, 0x3A, 0x12}), 2, 1, 0, RawFormat::kMono12p)),
              ElementsAre(0xABC, 0x123));
}

TEST(RawPixels, Mono12PackedHasTheHighestBitsInBytesOfTheirOwn) {
  EXPECT_THAT(samples_of(*unpack_pixels(bytes_of({0xAB, 0x3C, 0x12}), 2, 1, 0, RawFormat::kMono12Packed)),
              ElementsAre(0xABC, 0x123));
}

TEST(RawPixels, PackedRowsOfAnOddWidthFollowEachOther) {
  // 0xABC 0x123 0x456 | 0x789 0xDEF 0x001, and the last three bytes of five pixels are two.
  const auto bytes = bytes_of({0xBC, 0x3A, 0x12, 0x56, 0x94, 0x78, 0xEF, 0x1D, 0x00});
  EXPECT_THAT(samples_of(*unpack_pixels(bytes, 3, 2, 0, RawFormat::kMono12p)),
              ElementsAre(0xABC, 0x123, 0x456, 0x789, 0xDEF, 0x001));
  EXPECT_THAT(samples_of(*unpack_pixels({bytes.data(), 8}, 5, 1, 0, RawFormat::kMono12p)),
              ElementsAre(0xABC, 0x123, 0x456, 0x789, 0xDEF));
}

TEST(RawPixels, TooFewBytesAreRefused) {
  const std::vector<std::byte> bytes(12);
  for (const auto& [width, height, format] : {std::tuple{13, 1, RawFormat::kMono8},
                                              {7, 1, RawFormat::kMono16},
                                              {3, 3, RawFormat::kMono12p},
                                              {3, 3, RawFormat::kMono12Packed},
                                              {0, 4, RawFormat::kMono8},
                                              {4, -1, RawFormat::kMono8}}) {
    const auto image = unpack_pixels(bytes, width, height, 0, format);
    ASSERT_FALSE(image) << width << " x " << height;
    EXPECT_EQ(image.error().code, ErrorCode::kBadInput);
  }
  EXPECT_TRUE(unpack_pixels(bytes, 4, 3, 0, RawFormat::kMono8));
  EXPECT_FALSE(unpack_pixels(bytes, 4, 3, 1, RawFormat::kMono8));
}

}  // namespace
}  // namespace crosstie::devices::detail
