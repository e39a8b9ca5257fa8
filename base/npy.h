#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/result.h"

namespace crosstie::base {

/// Writes a matrix as NumPy's .npy, version 1.0: float64, little-endian, C order, two dimensions; atomically.
Result<> write_npy(const std::filesystem::path& path, const Eigen::MatrixXd& matrix);

/// Reads what write_npy() writes, and Fortran order, too. The shape is checked against the file's size before anything is
/// allocated; values that are not finite are Errors.
Result<Eigen::MatrixXd> read_npy(const std::filesystem::path& path);

/// A full covariance matrix with the names of its parameters, each ending with its unit: "point 11 x [mm]".
struct LabelledCovariance {
  Eigen::MatrixXd matrix;
  std::vector<std::string> labels;
};

/// Writes covariance.npy and covariance.json {format, labels, units} into a folder; the matrix is square of the labels' number.
Result<> write_covariance(const std::filesystem::path& folder, const LabelledCovariance& covariance);
Result<LabelledCovariance> read_covariance(const std::filesystem::path& folder);

}  // namespace crosstie::base
