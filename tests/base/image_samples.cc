#include "tests/base/image_samples.h"

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

namespace crosstie::tests {
namespace {

std::string encoded(const char* extension, const cv::Mat& image, const std::vector<int>& parameters = {}) {
  std::vector<unsigned char> bytes;
  cv::imencode(extension, image, bytes, parameters);
  return {bytes.begin(), bytes.end()};
}

void append32(std::string& bytes, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
}

void append_chunk(std::string& png, const std::string& type_and_data) {
  append32(png, static_cast<std::uint32_t>(type_and_data.size() - 4));
  png += type_and_data;
  std::uint32_t crc = 0xFFFFFFFFU;
  for (const char c : type_and_data) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? (crc >> 1) ^ 0xEDB88320U : crc >> 1;
  }
  append32(png, ~crc);
}

/// A zlib stream of one stored block.
std::string stored(const std::string& data) {
  const auto size = static_cast<std::uint16_t>(data.size());
  std::string stream = "\x78\x01\x01";
  for (const std::uint16_t value : {size, static_cast<std::uint16_t>(~size)}) {
    stream += static_cast<char>(value & 0xFF);
    stream += static_cast<char>(value >> 8);
  }
  std::uint32_t a = 1;
  std::uint32_t b = 0;
  for (const char c : data) {
    a = (a + static_cast<unsigned char>(c)) % 65521;
    b = (b + a) % 65521;
  }
  stream += data;
  append32(stream, b << 16 | a);
  return stream;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> image_samples() {
  cv::Mat grey8(kSampleHeight, kSampleWidth, CV_8U);
  for (int y = 0; y < grey8.rows; ++y) {
    for (int x = 0; x < grey8.cols; ++x) grey8.at<unsigned char>(y, x) = static_cast<unsigned char>(sample_grey(x, y));
  }
  cv::Mat grey16;
  grey8.convertTo(grey16, CV_16U, 257.0);
  cv::Mat colour;
  cv::merge(std::vector<cv::Mat>{grey8, grey8, grey8}, colour);
  return {{"png8", encoded(".png", grey8)},
          {"png16", encoded(".png", grey16)},
          {"png_colour", encoded(".png", colour)},
          {"tiff8", encoded(".tiff", grey8)},
          {"tiff16_uncompressed", encoded(".tiff", grey16, {cv::IMWRITE_TIFF_COMPRESSION, 1})},
          {"bmp", encoded(".bmp", grey8)},
          {"pgm8", encoded(".pgm", grey8)},
          {"pgm16", encoded(".pgm", grey16)},
          {"jpeg", encoded(".jpg", grey8, {cv::IMWRITE_JPEG_QUALITY, 98})}};
}

std::string handmade_png(std::uint32_t width, std::uint32_t height, int bits, int colour_type,
                         const std::vector<std::string>& rows) {
  std::string png("\x89PNG\r\n\x1a\n", 8);
  std::string header = "IHDR";
  append32(header, width);
  append32(header, height);
  header += static_cast<char>(bits);
  header += static_cast<char>(colour_type);
  header += std::string(3, '\0');
  append_chunk(png, header);
  if (colour_type == 3) {
    std::string palette = "PLTE";
    for (int i = 0; i < (1 << bits); ++i) palette += std::string(3, static_cast<char>(255 - i));
    append_chunk(png, palette);
  }
  std::string data;
  for (const std::string& row : rows) data += std::string(1, '\0') + row;
  append_chunk(png, "IDAT" + stored(data));
  append_chunk(png, "IEND");
  return png;
}

}  // namespace crosstie::tests
