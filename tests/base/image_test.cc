#include "base/image.h"

#include <cmath>
#include <cstring>
#include <random>

#include <sys/resource.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <exiv2/exiv2.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/base/image_samples.h"
#include "tests/support/measured_data.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::HasSubstr;
using tests::sample_grey;
using tests::TemporaryFolder;

double grey(const Image& image, int x, int y) {
  const ImageView view = image.view();
  return view.bits == 16 ? view.row<std::uint16_t>(y)[x] : view.row<std::uint8_t>(y)[x];
}

std::string encoded(const char* extension, const cv::Mat& image, const std::vector<int>& parameters = {}) {
  std::vector<unsigned char> bytes;
  EXPECT_TRUE(cv::imencode(extension, image, bytes, parameters));
  return {bytes.begin(), bytes.end()};
}

/// The sample picture, 8 bit.
cv::Mat sample() {
  cv::Mat image(tests::kSampleHeight, tests::kSampleWidth, CV_8U);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) image.at<unsigned char>(y, x) = static_cast<unsigned char>(sample_grey(x, y));
  }
  return image;
}

TEST(Image, ReadsEachFormatWithItsDepth) {
  const TemporaryFolder folder;
  for (const auto& [name, bytes] : tests::image_samples()) {
    const auto path = folder.write(name, bytes);
    const auto image = read_image(path);
    ASSERT_TRUE(image) << name << ": " << image.error().message;
    const bool deep = name.find("16") != std::string::npos;
    ASSERT_EQ(image->width(), tests::kSampleWidth) << name;
    ASSERT_EQ(image->height(), tests::kSampleHeight) << name;
    EXPECT_EQ(image->bits(), deep ? 16 : 8) << name;
    EXPECT_EQ(image->white_level(), deep ? 65535 : 255) << name;
    const auto info = read_image_info(path);
    ASSERT_TRUE(info);
    EXPECT_EQ(info->width, tests::kSampleWidth);
    EXPECT_EQ(info->bits, deep ? 16 : 8);
    const double tolerance = name == "jpeg" ? 12.0 : 0.0;  // the edge of the picture rings
    for (int y = 0; y < image->height(); ++y) {
      for (int x = 0; x < image->width(); ++x) {
        ASSERT_NEAR(grey(*image, x, y), sample_grey(x, y) * (deep ? 257.0 : 1.0), tolerance) << name << " " << x << " " << y;
      }
    }
  }
}

TEST(Image, ColourBecomesLuminance) {
  const TemporaryFolder folder;
  const cv::Vec3b bgr(10, 200, 90);
  const double expected = std::round(0.299 * 90 + 0.587 * 200 + 0.114 * 10);
  const cv::Mat colour(5, 7, CV_8UC3, cv::Scalar(bgr[0], bgr[1], bgr[2]));
  const cv::Mat with_alpha(5, 7, CV_8UC4, cv::Scalar(bgr[0], bgr[1], bgr[2], 17));
  const cv::Mat deep(5, 7, CV_16UC3, cv::Scalar(1000, 20000, 9000));
  for (const auto& [name, bytes] : {std::pair<std::string, std::string>{"rgb.png", encoded(".png", colour)},
                                    {"rgba.png", encoded(".png", with_alpha)},
                                    {"rgb.tiff", encoded(".tiff", colour)},
                                    {"rgba.tiff", encoded(".tiff", with_alpha)},
                                    {"rgb.bmp", encoded(".bmp", colour)},
                                    {"rgb.ppm", encoded(".ppm", colour)}}) {
    const auto image = read_image(folder.write(name, bytes));
    ASSERT_TRUE(image) << name << ": " << image.error().message;
    EXPECT_EQ(grey(*image, 3, 2), expected) << name;
  }
  for (const char* extension : {".png", ".tiff"}) {
    const auto image = read_image(folder.write("deep", encoded(extension, deep)));
    ASSERT_TRUE(image);
    EXPECT_EQ(image->bits(), 16);
    EXPECT_EQ(grey(*image, 0, 0), std::round(0.299 * 9000 + 0.587 * 20000 + 0.114 * 1000));
  }
}

TEST(Image, ReadsPackedAndPaletteSamples) {
  const TemporaryFolder folder;
  const auto bits = read_image(folder.write("bits.png", tests::handmade_png(10, 2, 1, 0, {"\xA5\x40", "\x01\x80"})));
  ASSERT_TRUE(bits) << bits.error().message;
  const int first_row[] = {255, 0, 255, 0, 0, 255, 0, 255, 0, 255};
  for (int x = 0; x < 10; ++x) EXPECT_EQ(grey(*bits, x, 0), first_row[x]);
  EXPECT_EQ(grey(*bits, 7, 1), 255);

  const auto palette =
      read_image(folder.write("palette.png", tests::handmade_png(3, 1, 8, 3, {std::string("\x00\x05\xff", 3)})));
  ASSERT_TRUE(palette) << palette.error().message;
  EXPECT_EQ(grey(*palette, 0, 0), 255);
  EXPECT_EQ(grey(*palette, 1, 0), 250);
  EXPECT_EQ(grey(*palette, 2, 0), 0);

  const auto text = read_image(folder.write("text.pgm", "P2\n# a comment\n3 2\n4095\n0 1 4095\n7 8 9"));
  ASSERT_TRUE(text) << text.error().message;
  EXPECT_EQ(text->bits(), 16);
  EXPECT_EQ(text->white_level(), 4095);
  EXPECT_EQ(grey(*text, 2, 0), 4095);
  EXPECT_EQ(grey(*text, 2, 1), 9);
  EXPECT_FALSE(read_image(folder.write("above.pgm", "P2 1 1 100 101")));

  const auto one = read_image(folder.write("one.png", tests::handmade_png(1, 1, 8, 0, {"\x2A"})));
  ASSERT_TRUE(one);
  EXPECT_EQ(grey(*one, 0, 0), 42);
}

TEST(Image, ReadsPackedTiff) {
  // A TIFF of 12 bits a sample, big-endian, put together by hand: 3 x 1 px of 0x123, 0xabc, 0xfff.
  const auto entry = [](int tag, int type, int count, int value) {
    std::string bytes;
    for (const int v : {tag, type}) bytes += {static_cast<char>(v >> 8), static_cast<char>(v)};
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(count >> shift);
    if (type == 3) value <<= 16;
    for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift);
    return bytes;
  };
  const std::string pixels = "\x12\x3a\xbc\xff\xf0";
  std::string tiff = std::string("MM\0*\0\0\0\x08", 8) + std::string("\0\x08", 2);
  const int data = 8 + 2 + 8 * 12 + 4;
  tiff += entry(256, 3, 1, 3) + entry(257, 3, 1, 1) + entry(258, 3, 1, 12) + entry(259, 3, 1, 1) + entry(262, 3, 1, 1) +
          entry(273, 4, 1, data) + entry(278, 3, 1, 1) + entry(279, 4, 1, 5) + std::string(4, '\0') + pixels;
  const TemporaryFolder folder;
  const auto image = read_image(folder.write("packed.tif", tiff));
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->bits(), 16);
  EXPECT_EQ(image->white_level(), 4095);
  EXPECT_EQ(grey(*image, 0, 0), 0x123);
  EXPECT_EQ(grey(*image, 1, 0), 0xabc);
  EXPECT_EQ(grey(*image, 2, 0), 0xfff);
  EXPECT_FALSE(read_image(folder.write("short.tif", tiff.substr(0, tiff.size() - 1))));
}

/// The most memory that this process has held.
long peak_kb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

TEST(Image, AHeaderThatClaimsTooMuchCostsNothing) {
  const TemporaryFolder folder;
  std::string bmp = encoded(".bmp", sample());
  for (const int at : {18, 22}) {
    const std::int32_t size = 30000;
    std::memcpy(bmp.data() + at, &size, 4);
  }
  const std::pair<const char*, std::string> cases[] = {{"huge.png", tests::handmade_png(30000, 30000, 8, 0, {"\x01"})},
                                                       {"huge.pgm", "P5 30000 30000 255\n\x01"},
                                                       {"huge.ppm", "P6 30000 30000 65535\n\x01"},
                                                       {"huge.bmp", bmp},
                                                       {"large.png", tests::handmade_png(19000, 19000, 16, 2, {"\x01"})},
                                                       {"large.pgm", "P5 19000 19000 65535\n\x01"},
                                                       {"wider.pgm", "P5 4294967297 1 255\n\x01"},
                                                       {"wide.png", tests::handmade_png(0xFFFFFFFFU, 1, 8, 0, {"\x01"})},
                                                       {"none.png", tests::handmade_png(0, 5, 8, 0, {"\x01"})},
                                                       {"none.pgm", "P5 0 5 255\n\x01"}};
  const long peak_kb_before = peak_kb();
  for (const auto& [name, bytes] : cases) {
    const auto image = read_image(folder.write(name, bytes));
    ASSERT_FALSE(image) << name;
    EXPECT_EQ(image.error().code, ErrorCode::kBadInput) << name << image.error().message;
  }
  EXPECT_LT(peak_kb() - peak_kb_before, 50000);
}

TEST(Image, AHalfJpegIsNoImage) {
  // OpenCV's reader makes up the lower half of such a file.
  const TemporaryFolder folder;
  const std::string jpeg = encoded(".jpg", sample());
  const std::string half = jpeg.substr(0, jpeg.size() / 2);
  for (const std::string& bytes : {half, half + "\xff\xd9", jpeg.substr(0, jpeg.size() - 2)}) {
    EXPECT_FALSE(read_image(folder.write("half.jpg", bytes)));
  }
}

/// A grey progressive JPEG of 64 x 64 px by ISO/IEC 10918-1: one scan with all means, which are 0, then empty scans of all else, each one run
/// of 16384 blocks without coefficients.
std::string jpeg_of_scans(int count) {
  using namespace std::string_literals;
  std::string bytes = "\xff\xd8\xff\xdb\x00\x43\x00"s + std::string(64, '\1');
  bytes += "\xff\xc2\x00\x0b\x08\x00\x40\x00\x40\x01\x01\x11\x00"s;
  bytes += "\xff\xc4\x00\x14\x00\x01"s + std::string(15, '\0') + "\x00"s;
  bytes += "\xff\xc4\x00\x14\x10\x01"s + std::string(15, '\0') + "\xe0"s;
  bytes += "\xff\xda\x00\x08\x01\x01\x00\x00\x00\x00"s + std::string(8, '\0');
  for (int i = 1; i < count; ++i) bytes += "\xff\xda\x00\x08\x01\x01\x00\x01\x3f\x00\x00\x01"s;
  return bytes + "\xff\xd9"s;
}

TEST(Image, AJpegOfThousandsOfScansIsRefused) {
  const TemporaryFolder folder;
  const auto image = read_image(folder.write("few.jpg", jpeg_of_scans(20)));
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(grey(*image, 5, 60), 128.0);
  const auto refused = read_image(folder.write("many.jpg", jpeg_of_scans(5000)));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(refused.error().message, HasSubstr("more than 100 scans"));
}

TEST(Image, MostFlippedBytesOfAJpegAreSeen) {
  // A JPEG has no check sums: what decodes without a complaint cannot be told from a picture. PNG misses none.
  const TemporaryFolder folder;
  cv::Mat noisy(200, 300, CV_8U);
  cv::RNG random(5);
  random.fill(noisy, cv::RNG::NORMAL, 120.0, 30.0);
  const std::string jpeg = encoded(".jpg", noisy);
  const std::string png = encoded(".png", noisy);
  std::mt19937_64 positions(15);
  int seen_jpeg = 0;
  constexpr int kTrials = 100;
  for (int i = 0; i < kTrials; ++i) {
    std::string damaged = jpeg;
    for (int k = 0; k < 2; ++k) damaged[700 + positions() % (jpeg.size() - 702)] ^= static_cast<char>(0xFF);
    if (!read_image(folder.write("flipped.jpg", damaged))) ++seen_jpeg;
    damaged = png;
    damaged[positions() % png.size()] ^= static_cast<char>(1U << positions() % 8);
    EXPECT_FALSE(read_image(folder.write("flipped.png", damaged)));
  }
  RecordProperty("jpeg_damage_seen_of_100", seen_jpeg);
  EXPECT_GT(seen_jpeg, 50);
}

TEST(Image, WhatIsWrittenReadsBack) {
  const TemporaryFolder folder;
  for (const int bits : {8, 16}) {
    Image image(33, 17, bits);
    for (int y = 0; y < 17; ++y) {
      for (int x = 0; x < 33; ++x) {
        if (bits == 16)
          image.row<std::uint16_t>(y)[x] = static_cast<std::uint16_t>(x * 1777 + y * 3001);
        else
          image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(x * 7 + y * 11);
      }
    }
    ASSERT_TRUE(write_image(folder / "a.png", image.view()));
    ASSERT_TRUE(write_image(folder / "b.png", image.view()));
    EXPECT_EQ(tests::read_all(folder / "a.png"), tests::read_all(folder / "b.png"));
    const cv::Mat read = cv::imread((folder / "a.png").string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(read.type(), bits == 16 ? CV_16UC1 : CV_8UC1);
    ASSERT_EQ(read.cols, 33);
    for (int y = 0; y < 17; ++y) {
      for (int x = 0; x < 33; ++x) {
        EXPECT_EQ(bits == 16 ? read.at<std::uint16_t>(y, x) : read.at<std::uint8_t>(y, x), grey(image, x, y));
      }
    }
  }
}

TEST(Image, APartOfAnImageCanBeWritten) {
  Image image(20, 10, 8);
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 20; ++x) image.row<std::uint8_t>(y)[x] = static_cast<std::uint8_t>(10 * y + x);
  }
  ImageView part = image.view();
  part.data += 3 * part.row_stride_bytes + 4;
  part.width = 5;
  part.height = 2;
  const TemporaryFolder folder;
  ASSERT_TRUE(write_image(folder / "part.png", part));
  const cv::Mat read = cv::imread((folder / "part.png").string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(read.cols, 5);
  EXPECT_EQ(read.at<unsigned char>(1, 2), 46);
}

TEST(Image, ColourIsWrittenAsRgb) {
  ColourImage image{2, 1, {255, 0, 0, 0, 0, 255}};
  const TemporaryFolder folder;
  ASSERT_TRUE(write_image(folder / "colour.png", image));
  const cv::Mat read = cv::imread((folder / "colour.png").string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(read.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 0, 255));
  EXPECT_EQ(read.at<cv::Vec3b>(0, 1), cv::Vec3b(255, 0, 0));
  image.rgb.pop_back();
  EXPECT_FALSE(write_image(folder / "short.png", image));
  EXPECT_FALSE(write_image(folder / "colour.jpg", image));
  EXPECT_FALSE(std::filesystem::exists(folder / "colour.jpg"));
}

/// A JPEG of 40 x 30 px with the given EXIF entries.
std::filesystem::path jpeg_with(const TemporaryFolder& folder,
                                const std::vector<std::pair<std::string, std::string>>& entries) {
  const auto path = folder.write("exif.jpg", encoded(".jpg", cv::Mat(30, 40, CV_8U, cv::Scalar(80))));
  const auto image = Exiv2::ImageFactory::open(path.string());
  image->readMetadata();
  for (const auto& [key, value] : entries) image->exifData()[key] = value;
  image->writeMetadata();
  return path;
}

TEST(Image, FocalLengthComesFromExif) {
  const TemporaryFolder folder;
  const std::pair<std::string, std::string> focal{"Exif.Photo.FocalLength", "24/1"};
  const std::pair<std::string, std::string> resolution{"Exif.Photo.FocalPlaneXResolution", "2000/1"};
  // 24 mm, 2000 px per cm: 4800 px.
  const auto of = [&](const std::vector<std::pair<std::string, std::string>>& entries) {
    return exif_focal_px(jpeg_with(folder, entries));
  };
  EXPECT_DOUBLE_EQ(of({focal, resolution, {"Exif.Photo.FocalPlaneResolutionUnit", "3"}}).value(), 4800.0);
  EXPECT_DOUBLE_EQ(
      of({focal, {"Exif.Photo.FocalPlaneXResolution", "5080/1"}, {"Exif.Photo.FocalPlaneResolutionUnit", "2"}}).value(),
      4800.0);
  // The picture was scaled to a tenth after it was taken.
  EXPECT_DOUBLE_EQ(
      of({focal, resolution, {"Exif.Photo.FocalPlaneResolutionUnit", "3"}, {"Exif.Photo.PixelXDimension", "400"}}).value(),
      480.0);
  EXPECT_DOUBLE_EQ(of({focal, {"Exif.Photo.FocalLengthIn35mmFilm", "36"}}).value(), 40.0);
  EXPECT_FALSE(of({}));
  EXPECT_FALSE(of({focal}));
  EXPECT_FALSE(of({focal, {"Exif.Photo.FocalPlaneXResolution", "2000/0"}, {"Exif.Photo.FocalPlaneResolutionUnit", "3"}}));
  EXPECT_FALSE(exif_focal_px(folder / "missing.jpg"));
  EXPECT_FALSE(exif_focal_px(folder.write("text.jpg", "no image")));
}

TEST(Image, RotationOfTheCameraIsNotApplied) {
  const TemporaryFolder folder;
  const auto image = read_image(jpeg_with(folder, {{"Exif.Image.Orientation", "6"}}));
  ASSERT_TRUE(image);
  EXPECT_EQ(image->width(), 40);
  EXPECT_EQ(image->height(), 30);
}

TEST(Image, RealPhotographsAreReadAsOpenCvReadsThem) {
  const auto data = tests::measured_data("aicon-panel");
  if (data.empty()) GTEST_SKIP() << "no aicon-panel in CROSSTIE_DATA";
  const auto path = data / "043_0005_Scaled.tif";
  const auto image = read_image(path);
  ASSERT_TRUE(image) << image.error().message;
  const cv::Mat truth = cv::imread(path.string(), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(truth.type(), CV_8UC1);
  ASSERT_EQ(truth.cols, image->width());
  for (int y = 0; y < truth.rows; ++y) {
    ASSERT_EQ(std::memcmp(truth.ptr(y), image->view().row<std::uint8_t>(y), static_cast<std::size_t>(truth.cols)), 0) << y;
  }
}

}  // namespace
}  // namespace crosstie::base
