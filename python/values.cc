#include "python/values.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <pybind11/numpy.h>
#include <pybind11/stl.h>
#include <nlohmann/json.hpp>

#include "python/arrays.h"

namespace crosstie::python {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t kPose = 16;

bool is_covariance(const std::string& key) {
  return key == "cov" || key.starts_with("cov_") || key.ends_with("_cov") || key.find("_cov_") != std::string::npos;
}

/// Rows of a symmetric matrix whose upper triangle has `size` numbers; 0: there is none.
py::ssize_t rows_of_triangle(std::size_t size) {
  const auto rows = static_cast<std::size_t>((std::sqrt(8.0 * static_cast<double>(size) + 1.0) - 1.0) / 2.0 + 0.5);
  return rows * (rows + 1) / 2 == size ? static_cast<py::ssize_t>(rows) : 0;
}

/// A list of numbers under its key.
py::object array_of_numbers(const ordered_json& json, const std::string& key) {
  const auto size = static_cast<py::ssize_t>(json.size());
  const bool whole = std::all_of(json.begin(), json.end(), [](const auto& value) { return value.is_number_integer(); });
  if (whole) {
    py::array_t<std::int64_t> integers(size);
    for (py::ssize_t i = 0; i < size; ++i)
      integers.mutable_at(i) = json[static_cast<std::size_t>(i)].template get<std::int64_t>();
    if (!is_covariance(key) && !(key.find("_from_") != std::string::npos && json.size() == kPose)) return integers;
  }
  const auto number = [&](py::ssize_t i) {
    const ordered_json& value = json[static_cast<std::size_t>(i)];
    return value.is_null() ? std::numeric_limits<double>::quiet_NaN() : value.get<double>();
  };
  if (const py::ssize_t rows = is_covariance(key) ? rows_of_triangle(json.size()) : 0; rows > 0) {
    py::array_t<double> matrix({rows, rows});
    py::ssize_t at = 0;
    for (py::ssize_t i = 0; i < rows; ++i) {
      for (py::ssize_t j = i; j < rows; ++j) matrix.mutable_at(i, j) = matrix.mutable_at(j, i) = number(at++);
    }
    return matrix;
  }
  py::array_t<double> values(size);
  for (py::ssize_t i = 0; i < size; ++i) values.mutable_at(i) = number(i);
  if (key.find("_from_") != std::string::npos && json.size() == kPose) return values.reshape({4, 4});
  return values;
}

py::object value_under(const ordered_json& json, const std::string& key) {
  switch (json.type()) {
    case ordered_json::value_t::object: {
      py::dict dict;
      for (const auto& [name, value] : json.items()) dict[py::str(name)] = value_under(value, name);
      return dict;
    }
    case ordered_json::value_t::array: {
      const auto is_number = [](const auto& value) { return value.is_number() || value.is_null(); };
      const bool numbers = std::all_of(json.begin(), json.end(), is_number) &&
                           std::any_of(json.begin(), json.end(), [](const auto& value) { return value.is_number(); });
      if (numbers) return array_of_numbers(json, key);
      py::list list;
      for (const ordered_json& value : json) list.append(value_under(value, ""));
      return list;
    }
    case ordered_json::value_t::string:
      return py::str(json.get<std::string>());
    case ordered_json::value_t::boolean:
      return py::bool_(json.get<bool>());
    case ordered_json::value_t::number_integer:
      return py::int_(json.get<std::int64_t>());
    case ordered_json::value_t::number_unsigned:
      return py::int_(json.get<std::uint64_t>());
    case ordered_json::value_t::number_float:
      return py::float_(json.get<double>());
    default:
      return py::none();
  }
}

}  // namespace

py::object python_of(const ordered_json& json) { return value_under(json, ""); }

py::dict cloud_dict(base::Cloud&& cloud) {
  const auto count = static_cast<py::ssize_t>(cloud.points.size());
  py::dict dict;
  dict["frame"] = cloud.frame;
  dict["points"] = array_of<double>(std::move(cloud.points), {count, 3});
  dict["normals"] = points_array(std::move(cloud.normals));
  dict["cov_mm2"] = covariances_array(std::move(cloud.cov_mm2));
  py::dict fields;
  for (base::CloudField& field : cloud.fields) fields[py::str(field.name)] = array_of<double>(std::move(field.values), {count});
  dict["fields"] = fields;
  return dict;
}

base::Cloud cloud_from(const py::dict& dict) {
  base::Cloud cloud;
  const auto given = [&](const char* key) { return dict.contains(key) && !dict[key].is_none(); };
  cloud.points = points_from(dict["points"], "points");
  if (given("frame")) cloud.frame = dict["frame"].cast<std::string>();
  if (given("normals")) cloud.normals = points_from(dict["normals"], "normals");
  if (given("cov_mm2")) cloud.cov_mm2 = covariances_from(dict["cov_mm2"], "cov_mm2");
  if (given("fields")) {
    for (const auto& [name, values] : dict["fields"].cast<py::dict>()) {
      auto field = name.cast<std::string>();
      auto numbers = numbers_from(values, field.c_str());
      cloud.fields.push_back({std::move(field), std::move(numbers)});
    }
  }
  const auto fits = [&](std::size_t size) { return size == 0 || size == cloud.points.size(); };
  bool all = fits(cloud.normals.size()) && fits(cloud.cov_mm2.size());
  for (const base::CloudField& field : cloud.fields) all = all && field.values.size() == cloud.points.size();
  if (!all) throw py::value_error("normals, cov_mm2 and fields of a cloud are as many as its points");
  return cloud;
}

py::list warnings_list(const std::vector<base::Warning>& warnings) {
  py::list list;
  for (const base::Warning& warning : warnings)
    list.append(
        py::dict(py::arg("code") = warning.code, py::arg("subject") = warning.subject, py::arg("message") = warning.message));
  return list;
}

}  // namespace crosstie::python
