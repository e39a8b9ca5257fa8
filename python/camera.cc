// crosstie.Camera

#include <cmath>
#include <filesystem>
#include <limits>

#include <fmt/core.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "app/lens_word.h"
#include "base/camera.h"
#include "base/camera_file.h"
#include "python/arrays.h"
#include "python/call.h"
#include "python/module.h"

namespace crosstie::python {
namespace {

using base::Camera;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

base::LensModel lens_of(const std::string& word) {
  const auto lens = app::lens_from_word(word);
  if (lens) return *lens;
  std::string words;
  for (const std::string& one : app::lens_words()) words += (words.empty() ? "" : ", ") + one;
  raise({base::ErrorCode::kUsage, fmt::format("the lens is one of {}, not '{}'", words, word)});
}

Camera make(const std::string& lens, int width_px, int height_px, const py::object& parameters, const py::object& covariance) {
  const std::vector<double> values = numbers_from(parameters, "parameters");
  Camera camera =
      value_of(Camera::make(lens_of(lens), width_px, height_px,
                            Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()))));
  if (!covariance.is_none()) {
    Eigen::MatrixXd matrix = matrix_from(covariance, "covariance");
    if (matrix.rows() != camera.parameters().size() || matrix.cols() != matrix.rows())
      throw py::value_error("the covariance has a row and a column for each parameter");
    camera.set_covariance(std::move(matrix));
  }
  return camera;
}

py::array project(const Camera& camera, const py::object& array) {
  const std::vector<Eigen::Vector3d> points = points_from(array, "points");
  py::array_t<double> pixels({static_cast<py::ssize_t>(points.size()), py::ssize_t{2}});
  double* to = pixels.mutable_data();
  {
    const py::gil_scoped_release released;
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector2d pixel = camera.project(point).value_or(Eigen::Vector2d::Constant(kNaN));
      *to++ = pixel.x();
      *to++ = pixel.y();
    }
  }
  return pixels;
}

py::array unproject(const Camera& camera, const py::object& array) {
  const Eigen::MatrixXd pixels = matrix_from(array, "pixels");
  if (pixels.cols() != 2) throw py::value_error("pixels is an array of shape (N, 2)");
  py::array_t<double> rays({static_cast<py::ssize_t>(pixels.rows()), py::ssize_t{3}});
  double* to = rays.mutable_data();
  {
    const py::gil_scoped_release released;
    for (Eigen::Index i = 0; i < pixels.rows(); ++i) {
      const Eigen::Vector3d ray = camera.unproject(pixels.row(i)).value_or(Eigen::Vector3d::Constant(kNaN));
      for (int k = 0; k < 3; ++k) *to++ = ray(k);
    }
  }
  return rays;
}

std::string shown(const Camera& camera) {
  return fmt::format("<crosstie.Camera {} {} x {} px, f {:.2f} {:.2f} px>", base::lens_model_name(camera.model()),
                     camera.width_px(), camera.height_px(), camera.focal_px().x(), camera.focal_px().y());
}

}  // namespace

void add_camera(py::module_& module) {
  py::class_<Camera>(
      module, "Camera",
      "The interior orientation of a camera: lens model, image size, parameters (mrcal's order: fx fy cx cy [px], then\n"
      "the distortion) and, where known, their covariance.\n\n"
      "Pixels: (0, 0) is the centre of the first pixel. Camera frame: x right, y down, z forward, mm.")
      .def(py::init(&make), py::arg("lens"), py::arg("width_px"), py::arg("height_px"), py::arg("parameters"),
           py::arg("covariance") = py::none(),
           "`lens` is pinhole, opencv4, opencv5, opencv8 or opencv12; `covariance` (P, P) in the parameters' units.")
      .def_static(
          "nominal",
          [](int width_px, int height_px, double focal_px, const std::string& lens) {
            return value_of(Camera::nominal(lens_of(lens), width_px, height_px, focal_px));
          },
          py::arg("width_px"), py::arg("height_px"), py::arg("focal_px"), py::arg("lens") = "opencv5",
          "A lens without distortion, its principal point in the image's centre: where an adjustment starts.")
      .def_static(
          "read", [](const std::filesystem::path& path) { return value_of(base::read_camera(path)); }, py::arg("path"),
          "From mrcal's .cameramodel, or OpenCV's or kalibr's YAML.")
      .def(
          "write",
          [](const Camera& camera, const std::filesystem::path& path) { value_of(base::write_cameramodel(path, camera)); },
          py::arg("path"), "As mrcal's .cameramodel, with covariance.")
      .def_property_readonly(
          "lens", [](const Camera& camera) { return app::lens_word(camera.model()); }, "The name of the model.")
      .def_property_readonly("width_px", &Camera::width_px, "Columns of its images.")
      .def_property_readonly("height_px", &Camera::height_px, "Rows of its images.")
      .def_property_readonly(
          "parameters", [](const Camera& camera) { return matrix_array(Eigen::MatrixXd(camera.parameters())).attr("ravel")(); },
          "(P,) in the order of parameter_names.")
      .def_property_readonly(
          "parameter_names",
          [](const Camera& camera) {
            const auto names = base::parameter_names(camera.model());
            return std::vector<std::string>(names.begin(), names.end());
          },
          "fx, fy, cx, cy, k1, ...")
      .def_property_readonly(
          "covariance",
          [](const Camera& camera) -> py::object {
            if (camera.covariance().size() == 0) return py::none();
            return matrix_array(camera.covariance());
          },
          "(P, P) of the parameters; None where unknown.")
      .def("project", &project, py::arg("points"),
           "(N, 3) points in the camera's frame [mm] -> (N, 2) pixels; not a number behind the camera and outside of the "
           "model's domain.")
      .def("unproject", &unproject, py::arg("pixels"),
           "(N, 2) pixels -> (N, 3) directions of unit length in the camera's frame; not a number outside of the model's "
           "domain.")
      .def("__repr__", &shown);
}

}  // namespace crosstie::python
