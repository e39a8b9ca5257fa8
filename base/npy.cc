#include "base/npy.h"

#include <bit>
#include <cstdint>
#include <cstring>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/detail/byte_order.h"
#include "base/file.h"
#include "base/json_file.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

static_assert(std::endian::native == std::endian::little, "the bytes of doubles are copied as they stand");

constexpr std::string_view kMagic("\x93NUMPY\x01\x00", 8);
constexpr std::string_view kCovarianceFormat = "crosstie-covariance/1";
constexpr std::size_t kMaxNpyBytes = std::size_t{16} << 30;

tl::unexpected<Error> bad(const std::filesystem::path& path, std::string_view what) {
  return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(path), what));
}

/// What follows `'key':` in the header, which is a Python dictionary, up to the end.
std::string_view after_key(std::string_view header, std::string_view key) {
  const std::size_t at = header.find(fmt::format("'{}':", key));
  return at == std::string_view::npos ? std::string_view() : trim(header.substr(at + key.size() + 3));
}

struct Header {
  bool fortran_order = false;
  std::size_t rows = 0;
  std::size_t columns = 0;
  std::size_t data_offset = 0;
};

tl::expected<Header, std::string> read_header(std::string_view bytes) {
  const auto refuse = [](std::string_view what) { return tl::unexpected<std::string>(std::string(what)); };
  if (bytes.size() < 10 || !bytes.starts_with(kMagic)) return refuse("no NPY file of version 1.0");
  const std::size_t length = detail::little16(bytes, 8);
  if (bytes.size() - 10 < length) return refuse("the file is cut off");
  const std::string_view text = bytes.substr(10, length);
  Header header;
  header.data_offset = 10 + length;
  if (!after_key(text, "descr").starts_with("'<f8'")) return refuse("its values are not float64, little-endian");
  const std::string_view order = after_key(text, "fortran_order");
  header.fortran_order = order.starts_with("True");
  if (!header.fortran_order && !order.starts_with("False")) return refuse("a header that cannot be read");
  std::string_view shape = after_key(text, "shape");
  const std::size_t end = shape.find(')');
  if (!shape.starts_with("(") || end == std::string_view::npos) return refuse("a header that cannot be read");
  const auto sizes = split(shape.substr(1, end - 1), ',');
  if (sizes.size() != 2) return refuse("not a matrix of two dimensions");
  const auto rows = parse_int(sizes[0]);
  const auto columns = parse_int(sizes[1]);
  constexpr std::int64_t kLargest = 1 << 24;
  if (!rows || !columns || *rows < 0 || *columns < 0 || *rows > kLargest || *columns > kLargest) {
    return refuse("a shape that cannot be read");
  }
  header.rows = static_cast<std::size_t>(*rows);
  header.columns = static_cast<std::size_t>(*columns);
  if (bytes.size() - header.data_offset != header.rows * header.columns * sizeof(double)) {
    return refuse(fmt::format("its shape of {} x {} does not fit the file's size", header.rows, header.columns));
  }
  return header;
}

/// "[mm]" at the end of a label -> "mm".
std::string unit_of(const std::string& label) {
  const std::size_t open = label.rfind('[');
  if (open == std::string::npos || label.back() != ']') return "";
  return label.substr(open + 1, label.size() - open - 2);
}

}  // namespace

Result<> write_npy(const std::filesystem::path& path, const Eigen::MatrixXd& matrix) {
  std::string header =
      fmt::format("{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, {}), }}", matrix.rows(), matrix.cols());
  // The data begins at a multiple of 64 bytes; the padding ends with a newline.
  header.append(63 - (kMagic.size() + 2 + header.size()) % 64, ' ');
  header += '\n';
  std::string bytes(kMagic);
  bytes += static_cast<char>(header.size() & 0xFF);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  const std::size_t offset = bytes.size();
  bytes.resize(offset + static_cast<std::size_t>(matrix.size()) * sizeof(double));
  char* out = bytes.data() + offset;
  for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
    for (Eigen::Index j = 0; j < matrix.cols(); ++j, out += sizeof(double)) {
      const double value = matrix(i, j);
      std::memcpy(out, &value, sizeof value);
    }
  }
  return write_file_atomically(path, bytes);
}

Result<Eigen::MatrixXd> read_npy(const std::filesystem::path& path) {
  auto bytes = read_file(path, kMaxNpyBytes);
  if (!bytes) return fail(std::move(bytes));
  const auto header = read_header(*bytes);
  if (!header) return bad(path, header.error());
  const auto rows = static_cast<Eigen::Index>(header->rows);
  const auto columns = static_cast<Eigen::Index>(header->columns);
  Eigen::MatrixXd matrix(rows, columns);
  const char* in = bytes->data() + header->data_offset;
  for (Eigen::Index k = 0; k < matrix.size(); ++k, in += sizeof(double)) {
    double& value = header->fortran_order ? matrix(k % rows, k / rows) : matrix(k / columns, k % columns);
    std::memcpy(&value, in, sizeof value);
  }
  if (!matrix.allFinite()) return bad(path, "a value is not finite");
  return matrix;
}

Result<> write_covariance(const std::filesystem::path& folder, const LabelledCovariance& covariance) {
  const auto size = static_cast<Eigen::Index>(covariance.labels.size());
  if (covariance.matrix.rows() != size || covariance.matrix.cols() != size) {
    return fail(ErrorCode::kInternal,
                fmt::format("a covariance of {} x {} has {} labels", covariance.matrix.rows(), covariance.matrix.cols(), size));
  }
  nlohmann::ordered_json json;
  json["format"] = kCovarianceFormat;
  json["labels"] = covariance.labels;
  json["units"] = nlohmann::ordered_json::array();
  for (const std::string& label : covariance.labels) json["units"].push_back(unit_of(label));
  if (auto written = write_npy(folder / "covariance.npy", covariance.matrix); !written) return written;
  return write_json(folder / "covariance.json", json);
}

Result<LabelledCovariance> read_covariance(const std::filesystem::path& folder) {
  const std::filesystem::path labels_path = folder / "covariance.json";
  auto json = read_json(labels_path);
  if (!json) return fail(std::move(json));
  const bool known = json->is_object() && json->contains("format") && (*json)["format"] == kCovarianceFormat &&
                     json->contains("labels") && (*json)["labels"].is_array();
  if (!known) return bad(labels_path, "not the labels of a covariance");
  LabelledCovariance result;
  for (const auto& label : (*json)["labels"]) {
    if (!label.is_string()) return bad(labels_path, "a label is not a text");
    result.labels.push_back(label.get<std::string>());
  }
  auto matrix = read_npy(folder / "covariance.npy");
  if (!matrix) return fail(std::move(matrix));
  const auto size = static_cast<Eigen::Index>(result.labels.size());
  if (matrix->rows() != size || matrix->cols() != size) {
    return bad(folder / "covariance.npy",
               fmt::format("{} x {}, but there are {} labels", matrix->rows(), matrix->cols(), size));
  }
  result.matrix = *std::move(matrix);
  return result;
}

}  // namespace crosstie::base
