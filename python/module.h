#pragma once

#include <pybind11/pybind11.h>

namespace crosstie::python {

namespace py = pybind11;

// Each adds its functions to the module.
void add_camera(py::module_& module);
void add_detect(py::module_& module);
void add_adjust(py::module_& module);
void add_scan(py::module_& module);
void add_stitch(py::module_& module);
void add_fit(py::module_& module);
void add_files(py::module_& module);

}  // namespace crosstie::python
