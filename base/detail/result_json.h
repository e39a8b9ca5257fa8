#pragma once

#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <nlohmann/json.hpp>

#include "base/pose.h"
#include "base/result.h"

namespace crosstie::base::detail {

using Json = nlohmann::ordered_json;

inline constexpr std::string_view kResultFormat = "crosstie-result/1";

/// The numbers of a vector as a list.
template <typename Vector>
Json list_json(const Vector& values) {
  Json json = Json::array();
  for (Eigen::Index i = 0; i < values.size(); ++i) json.push_back(values[i]);
  return json;
}

/// The upper triangle of a symmetric matrix, row by row.
template <typename Matrix>
Json upper_triangle_json(const Matrix& m) {
  Json json = Json::array();
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    for (Eigen::Index j = i; j < m.cols(); ++j) json.push_back(m(i, j));
  }
  return json;
}

/// A pose as 16 numbers, row by row.
Json matrix_json(const Pose& pose);

Json warnings_json(const std::vector<Warning>& warnings);

}  // namespace crosstie::base::detail
