#pragma once

#include <cstdint>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <Eigen/Core>

#include "base/image.h"
#include "base/observation.h"
#include "base/pose.h"

namespace crosstie::python {

namespace py = pybind11;

/// A row of an array of observations, as crosstie.OBSERVATION has it.
struct ObservationRow {
  std::int32_t id;
  std::int8_t status;
  double centre_px[2];
  double cov_px2[2][2];
  double semi_major_px;
  double semi_minor_px;
  double angle_rad;
  double margin;
};

/// A point with its covariance, as crosstie.POINT has it.
struct PointRow {
  std::int32_t id;
  double xyz_mm[3];
  double cov_mm2[3][3];
};

/// An array that owns `values` without a copy. `Container` holds `Scalar`s one after the other (Vector3d, ...).
template <typename Scalar, typename Container>
py::array array_of(Container&& values, std::vector<py::ssize_t> shape) {
  auto* kept = new Container(std::move(values));
  const py::capsule owner(kept, [](void* pointer) { delete static_cast<Container*>(pointer); });
  return py::array_t<Scalar>(std::move(shape), reinterpret_cast<const Scalar*>(kept->data()), owner);
}

/// (N, 3) and (N, 3, 3) arrays; None where there is nothing.
py::object points_array(std::vector<Eigen::Vector3d>&& points);
py::object covariances_array(std::vector<Eigen::Matrix3d>&& covariances);
/// (rows, columns), the matrix's own memory.
py::array matrix_array(Eigen::MatrixXd&& matrix);
py::array matrix_array(const Eigen::MatrixXd& matrix);

/// From (N, 3) of any real type. TypeError or ValueError for other shapes, naming `what`.
std::vector<Eigen::Vector3d> points_from(const py::handle& array, const char* what);
std::vector<Eigen::Matrix3d> covariances_from(const py::handle& array, const char* what);
std::vector<double> numbers_from(const py::handle& array, const char* what);
Eigen::MatrixXd matrix_from(const py::handle& array, const char* what);
/// From (4, 4), rigid.
base::Pose pose_from(const py::handle& array);

/// A grey-level image in an array (rows, columns) of uint8 or uint16, looked at where it is; a copy only where its columns do not lie
/// side by side. The array lives as long as this does.
class ArrayImage {
 public:
  /// TypeError for other arrays. `white_level` 0: that of the type.
  ArrayImage(const py::handle& array, double white_level);
  [[nodiscard]] const base::ImageView& view() const { return view_; }

 private:
  py::array array_;
  base::ImageView view_;
};
/// A copy that owns its samples.
base::Image owned(const base::ImageView& view);

py::array observations_array(const std::vector<base::Observation>& observations);
std::vector<base::Observation> observations_from(const py::handle& array);
std::vector<PointRow> point_rows_from(const py::handle& array);

/// Adds the dtypes and what their numbers mean: OBSERVATION, POINT, Status.
void add_arrays(py::module_& module);

}  // namespace crosstie::python
