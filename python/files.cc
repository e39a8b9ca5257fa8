// crosstie.read_result(), read_cloud(), write_cloud(), read_image()

#include <filesystem>

#include <pybind11/stl/filesystem.h>
#include <nlohmann/json.hpp>

#include "base/envelope_reader.h"
#include "base/image.h"
#include "base/json_file.h"
#include "base/npy.h"
#include "base/ply.h"
#include "python/arrays.h"
#include "python/call.h"
#include "python/module.h"
#include "python/values.h"

namespace crosstie::python {
namespace {

namespace fs = std::filesystem;

py::dict read_result(const fs::path& folder) {
  value_of(base::read_envelope(folder));
  py::dict result = python_of(value_of(base::read_json(folder / "result.json")));
  std::error_code ignored;
  if (fs::exists(folder / "covariance.npy", ignored)) {
    auto covariance = call([&](const base::Progress&) { return base::read_covariance(folder); });
    result["covariance"] = matrix_array(std::move(covariance.matrix));
    result["covariance_labels"] = py::cast(covariance.labels);
  }
  return result;
}

py::dict read_cloud(const fs::path& path) {
  return cloud_dict(call([&](const base::Progress&) { return base::read_ply(path); }));
}

void write_cloud(const fs::path& path, const py::dict& dict) {
  const base::Cloud cloud = cloud_from(dict);
  call([&](const base::Progress&) { return base::write_ply(path, cloud); });
}

py::array read_image(const fs::path& path) {
  base::Image image = call([&](const base::Progress&) { return base::read_image(path); });
  const std::vector<py::ssize_t> shape = {image.height(), image.width()};
  auto* kept = new base::Image(std::move(image));
  const py::capsule owner(kept, [](void* pointer) { delete static_cast<base::Image*>(pointer); });
  if (kept->bits() == 8) return py::array_t<std::uint8_t>(shape, kept->row<std::uint8_t>(0), owner);
  return py::array_t<std::uint16_t>(shape, kept->row<std::uint16_t>(0), owner);
}

}  // namespace

void add_files(py::module_& module) {
  module.def(
      "read_result", &read_result, py::arg("folder"),
      "The result of any verb from its folder (results/adjust, ...): result.json as a dict with the keys of "
      "docs/formats.md.\n\n"
      "Lists of numbers are arrays, A_from_B are (4, 4), covariances are whole symmetric matrices. Where the verb wrote it,\n"
      "`covariance` (P, P) is the full covariance and `covariance_labels` names its parameters, 'point 11 x [mm]'.");
  module.def("read_cloud", &read_cloud, py::arg("path"),
             "A cloud from a PLY file: {'frame', 'points' (N, 3) [mm], 'normals' (N, 3) or None, 'cov_mm2' (N, 3, 3) or None,\n"
             "'fields': {'sigma_mm': (N,), ...}}.");
  module.def("write_cloud", &write_cloud, py::arg("path"), py::arg("cloud"),
             "Writes such a dict (of which only 'points' must be there) as a binary PLY, atomically.");
  module.def("read_image", &read_image, py::arg("path"),
             "PNG, TIFF, BMP, PGM or JPEG as grey levels: (rows, columns) of uint8 or uint16. Damaged files are refused.");
}

}  // namespace crosstie::python
