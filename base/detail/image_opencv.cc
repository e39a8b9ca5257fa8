#include <cstring>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/detail/image_codec.h"

namespace crosstie::base::detail {
namespace {

tl::unexpected<std::string> bad(std::string_view reason) { return tl::unexpected<std::string>(std::string(reason)); }

/// Libraries print nothing: what OpenCV would say of damaged files is said by our errors.
void silence_opencv() {
  static const bool done = [] {
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    return true;
  }();
  static_cast<void>(done);
}

Decoded<std::string> encode(const cv::Mat& image) {
  silence_opencv();
  try {
    std::vector<unsigned char> bytes;
    if (!cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 6})) return bad("the picture cannot be encoded");
    return std::string(bytes.begin(), bytes.end());
  } catch (const cv::Exception& e) {
    return bad("the picture cannot be encoded: " + e.err);
  }
}

}  // namespace

Decoded<Image> decode_with_opencv(std::string_view bytes, const ImageHeader& header) {
  silence_opencv();
  cv::Mat decoded;
  try {
    const cv::Mat raw(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
    decoded = cv::imdecode(raw, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception& e) {
    return bad("the file is damaged: " + e.err);
  }
  if (decoded.empty()) return bad("the file is damaged or of a kind that cannot be decoded");
  if (decoded.cols != header.info.width || decoded.rows != header.info.height) {
    return bad("the file is damaged: its size is not the one its header states");
  }
  if (decoded.type() != CV_8UC1 && decoded.type() != CV_16UC1) return bad("samples that are not 8 or 16 bit integers");
  Image image(decoded.cols, decoded.rows, decoded.depth() == CV_16U ? 16 : 8);
  const std::size_t row_bytes = static_cast<std::size_t>(decoded.cols) * decoded.elemSize();
  for (int y = 0; y < decoded.rows; ++y)
    std::memcpy(image.row<std::byte>(0) + static_cast<std::size_t>(y) * row_bytes, decoded.ptr(y), row_bytes);
  return image;
}

Decoded<std::string> encode_png(const ImageView& image) {
  if (image.data == nullptr || image.width <= 0 || image.height <= 0) return bad("a picture without pixels");
  return encode(cv::Mat(image.height, image.width, image.bits == 16 ? CV_16U : CV_8U, const_cast<std::byte*>(image.data),
                        static_cast<std::size_t>(image.row_stride_bytes)));
}

Decoded<std::string> encode_png(const ColourImage& image) {
  const std::size_t expected = 3 * static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
  if (image.width <= 0 || image.height <= 0 || image.rgb.size() != expected) return bad("a picture without pixels");
  cv::Mat bgr;
  cv::cvtColor(cv::Mat(image.height, image.width, CV_8UC3, const_cast<std::uint8_t*>(image.rgb.data())), bgr,
               cv::COLOR_RGB2BGR);
  return encode(bgr);
}

}  // namespace crosstie::base::detail
