#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/pose.h"
#include "base/table.h"

namespace crosstie::tests {

/// Three columns of a table.
inline std::vector<Eigen::Vector3d> triples(const base::Table& table, const std::array<const char*, 3>& names) {
  std::vector<Eigen::Vector3d> values;
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    Eigen::Vector3d v;
    for (std::size_t k = 0; k < 3; ++k) v(static_cast<Eigen::Index>(k)) = *table.number(row, *table.column(names[k]));
    values.push_back(v);
  }
  return values;
}

inline std::vector<double> column(const base::Table& table, const char* name) {
  std::vector<double> values;
  for (std::size_t row = 0; row < table.rows.size(); ++row) values.push_back(*table.number(row, *table.column(name)));
  return values;
}

/// A pose that a JSON file of the twin or of a result gives by its 16 numbers.
inline base::Pose pose_of(const nlohmann::ordered_json& numbers) {
  const auto values = numbers.get<std::vector<double>>();
  return *base::pose_from_matrix(Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data()));
}

/// A 6x6 covariance from its upper triangle, row by row.
inline base::Matrix6d cov_of(const nlohmann::ordered_json& triangle) {
  base::Matrix6d cov;
  std::size_t at = 0;
  for (Eigen::Index row = 0; row < 6; ++row) {
    for (Eigen::Index col = row; col < 6; ++col) cov(row, col) = cov(col, row) = triangle.at(at++).get<double>();
  }
  return cov;
}

/// The true place of the part of a job of the twin.
inline base::Pose true_machine_from_part(const std::filesystem::path& job) {
  return pose_of(base::read_json(job / "truth" / "wall.json")->at("machine_from_part"));
}

/// The twin's rim in the machine.
struct TrueRim {
  std::vector<Eigen::Vector3d> points, normals, tangents;

  static TrueRim read(const std::filesystem::path& job) {
    const base::Pose pose = true_machine_from_part(job);
    const auto table = base::read_table(job / "truth" / "rim.csv");
    TrueRim rim{triples(*table, {"x_mm", "y_mm", "z_mm"}), triples(*table, {"nx", "ny", "nz"}),
                triples(*table, {"tx", "ty", "tz"})};
    for (Eigen::Vector3d& p : rim.points) p = pose * p;
    for (Eigen::Vector3d& n : rim.normals) n = pose.rotation * n;
    for (Eigen::Vector3d& t : rim.tangents) t = pose.rotation * t;
    return rim;
  }

  [[nodiscard]] std::size_t nearest(const Eigen::Vector3d& p) const {
    std::size_t best = 0;
    for (std::size_t i = 1; i < points.size(); ++i) {
      if ((points[i] - p).squaredNorm() < (points[best] - p).squaredNorm()) best = i;
    }
    return best;
  }
  /// Distance of a point across the rim in the surface, and along the normal, from the straight line through the nearest point.
  [[nodiscard]] Eigen::Vector2d off_mm(const Eigen::Vector3d& p) const {
    const std::size_t best = nearest(p);
    const Eigen::Vector3d d = p - points[best];
    return {normals[best].cross(tangents[best]).dot(d), normals[best].dot(d)};
  }
  /// Normal beside a point and the ways across and along the rim there, interpolated: between two of its points the surface turns by what is tested.
  [[nodiscard]] Eigen::Matrix3d axes_at(const Eigen::Vector3d& p) const {
    const std::size_t best = nearest(p);
    const double along = tangents[best].dot(p - points[best]);
    const std::size_t next = (best + (along > 0.0 ? 1 : points.size() - 1)) % points.size();
    const double share = std::abs(along) / (points[next] - points[best]).norm();
    const Eigen::Vector3d normal = ((1.0 - share) * normals[best] + share * normals[next]).normalized();
    const Eigen::Vector3d tangent = (1.0 - share) * tangents[best] + share * tangents[next];
    const Eigen::Vector3d across = normal.cross(tangent).normalized();
    Eigen::Matrix3d axes;
    axes << across, across.cross(normal), normal;
    return axes;
  }
};

}  // namespace crosstie::tests
