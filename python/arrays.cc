#include "python/arrays.h"

#include <cstring>
#include <string>

#include <fmt/format.h>
#include <pybind11/eigen.h>

#include "python/call.h"

namespace crosstie::python {
namespace {

using base::ObservationStatus;

constexpr ObservationStatus kStatuses[] = {ObservationStatus::kCoded, ObservationStatus::kUncoded,
                                           ObservationStatus::kAmbiguous, ObservationStatus::kUnreadable,
                                           ObservationStatus::kRefused};

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;

/// Contiguous doubles of this shape; a first extent of -1 stands for any.
Doubles doubles_of(const py::handle& array, std::initializer_list<py::ssize_t> shape, const char* what) {
  Doubles values = Doubles::ensure(array);
  if (!values) throw py::error_already_set();
  bool fits = values.ndim() == static_cast<py::ssize_t>(shape.size());
  py::ssize_t axis = 0;
  for (const py::ssize_t extent : shape) {
    if (fits && extent >= 0 && values.shape(axis) != extent) fits = false;
    ++axis;
  }
  if (fits) return values;
  std::string wanted;
  for (const py::ssize_t extent : shape) wanted += (wanted.empty() ? "" : ", ") + (extent < 0 ? "N" : std::to_string(extent));
  throw py::value_error(fmt::format("{} is an array of shape ({}{})", what, wanted, shape.size() == 1 ? "," : ""));
}

template <typename Element>
std::vector<Element> elements_of(const Doubles& values) {
  std::vector<Element> elements(static_cast<std::size_t>(values.shape(0)));
  if (!elements.empty()) std::memcpy(static_cast<void*>(elements.data()), values.data(), elements.size() * sizeof(Element));
  return elements;
}

}  // namespace

py::object points_array(std::vector<Eigen::Vector3d>&& points) {
  if (points.empty()) return py::none();
  const auto count = static_cast<py::ssize_t>(points.size());
  return array_of<double>(std::move(points), {count, 3});
}

py::object covariances_array(std::vector<Eigen::Matrix3d>&& covariances) {
  if (covariances.empty()) return py::none();
  const auto count = static_cast<py::ssize_t>(covariances.size());
  return array_of<double>(std::move(covariances), {count, 3, 3});  // symmetric: by rows or columns is the same
}

py::array matrix_array(Eigen::MatrixXd&& matrix) {
  auto* kept = new Eigen::MatrixXd(std::move(matrix));
  const py::capsule owner(kept, [](void* pointer) { delete static_cast<Eigen::MatrixXd*>(pointer); });
  constexpr py::ssize_t kSize = sizeof(double);
  return py::array_t<double>({kept->rows(), kept->cols()}, {kSize, kSize * kept->rows()}, kept->data(), owner);
}

py::array matrix_array(const Eigen::MatrixXd& matrix) { return matrix_array(Eigen::MatrixXd(matrix)); }

std::vector<Eigen::Vector3d> points_from(const py::handle& array, const char* what) {
  return elements_of<Eigen::Vector3d>(doubles_of(array, {-1, 3}, what));
}

std::vector<Eigen::Matrix3d> covariances_from(const py::handle& array, const char* what) {
  return elements_of<Eigen::Matrix3d>(doubles_of(array, {-1, 3, 3}, what));
}

std::vector<double> numbers_from(const py::handle& array, const char* what) {
  return elements_of<double>(doubles_of(array, {-1}, what));
}

Eigen::MatrixXd matrix_from(const py::handle& array, const char* what) {
  const Doubles values = doubles_of(array, {-1, -1}, what);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const RowMajor>(values.data(), values.shape(0), values.shape(1));
}

base::Pose pose_from(const py::handle& array) {
  doubles_of(array, {4, 4}, "a pose");
  return value_of(base::pose_from_matrix(matrix_from(array, "a pose")));
}

ArrayImage::ArrayImage(const py::handle& array, double white_level) {
  if (!py::isinstance<py::array>(array)) throw py::type_error("an image is a numpy array of uint8 or uint16");
  array_ = py::reinterpret_borrow<py::array>(array);
  const bool bytes = py::isinstance<py::array_t<std::uint8_t>>(array_);
  if (array_.ndim() != 2 || (!bytes && !py::isinstance<py::array_t<std::uint16_t>>(array_)))
    throw py::type_error("an image is an array (rows, columns) of uint8 or uint16");
  if (array_.strides(1) != array_.itemsize() || array_.strides(0) < 0) array_ = py::array::ensure(array_, py::array::c_style);
  view_.data = static_cast<const std::byte*>(array_.data());
  view_.width = static_cast<int>(array_.shape(1));
  view_.height = static_cast<int>(array_.shape(0));
  view_.row_stride_bytes = array_.strides(0);
  view_.bits = bytes ? 8 : 16;
  view_.white_level = white_level > 0.0 ? white_level : bytes ? 255.0 : 65535.0;
}

base::Image owned(const base::ImageView& view) {
  base::Image image(view.width, view.height, view.bits);
  image.set_white_level(view.white_level);
  const auto bytes = static_cast<std::size_t>(view.width) * static_cast<std::size_t>(view.bits / 8);
  for (int y = 0; y < view.height; ++y) {
    void* to = view.bits == 8 ? static_cast<void*>(image.row<std::uint8_t>(y)) : image.row<std::uint16_t>(y);
    std::memcpy(to, view.row<std::byte>(y), bytes);
  }
  return image;
}

py::array observations_array(const std::vector<base::Observation>& observations) {
  std::vector<ObservationRow> rows;
  rows.reserve(observations.size());
  for (const base::Observation& one : observations) {
    rows.push_back({one.id,
                    static_cast<std::int8_t>(one.status),
                    {one.centre_px.x(), one.centre_px.y()},
                    {{one.cov_px2(0, 0), one.cov_px2(0, 1)}, {one.cov_px2(1, 0), one.cov_px2(1, 1)}},
                    one.semi_major_px,
                    one.semi_minor_px,
                    one.angle_rad,
                    one.margin});
  }
  const auto count = static_cast<py::ssize_t>(rows.size());
  return array_of<ObservationRow>(std::move(rows), {count});
}

std::vector<base::Observation> observations_from(const py::handle& array) {
  const auto rows = py::array_t<ObservationRow, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!rows || rows.ndim() != 1) {
    PyErr_Clear();
    throw py::type_error("observations are an array of crosstie.OBSERVATION, as detect() gives it");
  }
  std::vector<base::Observation> observations;
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) {
    const ObservationRow& row = rows.at(i);
    if (row.status < 0 || row.status >= static_cast<std::int8_t>(std::size(kStatuses)))
      throw py::value_error(fmt::format("observation {}: there is no Status {}", i, row.status));
    base::Observation& one = observations.emplace_back();
    one.id = row.id;
    one.status = kStatuses[row.status];
    one.centre_px = {row.centre_px[0], row.centre_px[1]};
    one.cov_px2 << row.cov_px2[0][0], row.cov_px2[0][1], row.cov_px2[1][0], row.cov_px2[1][1];
    one.semi_major_px = row.semi_major_px;
    one.semi_minor_px = row.semi_minor_px;
    one.angle_rad = row.angle_rad;
    one.margin = row.margin;
  }
  return observations;
}

std::vector<PointRow> point_rows_from(const py::handle& array) {
  const auto rows = py::array_t<PointRow, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!rows || rows.ndim() != 1) {
    PyErr_Clear();
    throw py::type_error("points with covariances are an array of crosstie.POINT (id, xyz_mm, cov_mm2)");
  }
  std::vector<PointRow> points;
  for (py::ssize_t i = 0; i < rows.shape(0); ++i) points.push_back(rows.at(i));
  return points;
}

void add_arrays(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(ObservationRow, id, status, centre_px, cov_px2, semi_major_px, semi_minor_px, angle_rad, margin);
  PYBIND11_NUMPY_DTYPE(PointRow, id, xyz_mm, cov_mm2);
  module.attr("OBSERVATION") = py::dtype::of<ObservationRow>();
  module.attr("POINT") = py::dtype::of<PointRow>();
  py::dict statuses;
  for (const ObservationStatus status : kStatuses) {
    std::string name(base::status_name(status));
    for (char& c : name) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    statuses[name.c_str()] = static_cast<int>(status);
  }
  py::object status = py::module_::import("enum").attr("IntEnum")("Status", statuses, py::arg("module") = "crosstie");
  status.attr("__doc__") = "What detect() says of a marker: the field `status` of its observations.";
  module.attr("Status") = status;
}

}  // namespace crosstie::python
