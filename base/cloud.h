#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace crosstie::base {

/// A scalar that every point of a cloud carries, under the name that viewers show ("sigma_mm").
struct CloudField {
  std::string name;
  std::vector<double> values;
};

/// Points in mm in a named frame, with optional normals, covariances and scalar fields; every list is empty or as long as
/// `points`.
struct Cloud {
  std::string frame;  ///< "network", "rig", "machine", ...
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> normals;
  std::vector<Eigen::Matrix3d> cov_mm2;
  std::vector<CloudField> fields;
};

}  // namespace crosstie::base
