#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <pybind11/pybind11.h>
#include <nlohmann/json_fwd.hpp>

#include "base/cloud.h"
#include "base/result.h"

namespace crosstie::python {

namespace py = pybind11;

/// JSON as dicts, lists and numpy arrays: a list of numbers is an array (null among them: not a number), a matrix A_from_B of 16 numbers
/// is (4, 4), and the upper triangle of a covariance ("cov" in its name) is the whole symmetric matrix.
py::object python_of(const nlohmann::ordered_json& json);

/// {"frame", "points" (N, 3), "normals" (N, 3) or None, "cov_mm2" (N, 3, 3) or None, "fields" {name: (N,)}}: the cloud's own memory.
py::dict cloud_dict(base::Cloud&& cloud);
/// A copy of such a dict; KeyError without points.
base::Cloud cloud_from(const py::dict& cloud);

/// [{"code", "subject", "message"}]
py::list warnings_list(const std::vector<base::Warning>& warnings);

}  // namespace crosstie::python
