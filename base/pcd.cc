#include "base/pcd.h"

#include <array>
#include <cmath>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "base/file.h"

namespace crosstie::base {
namespace {

constexpr std::array<std::string_view, 3> kNormals = {"normal_x", "normal_y", "normal_z"};
constexpr std::array<std::string_view, 6> kCovariances = {"cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz"};

/// False for a finite value that a float cannot hold.
bool append(std::string& bytes, double value) {
  const auto narrow = static_cast<float>(value);
  std::array<char, sizeof narrow> buffer = {};
  std::memcpy(buffer.data(), &narrow, sizeof narrow);
  bytes.append(buffer.data(), buffer.size());
  return std::isfinite(narrow) || !std::isfinite(value);
}

bool is_name(std::string_view name) { return !name.empty() && name.find_first_of(" \t\r\n") == std::string_view::npos; }

}  // namespace

Result<> write_pcd(const std::filesystem::path& path, const Cloud& cloud) {
  const std::size_t count = cloud.points.size();
  std::vector<std::string> names = {"x", "y", "z"};
  if (!cloud.normals.empty()) names.insert(names.end(), kNormals.begin(), kNormals.end());
  if (!cloud.cov_mm2.empty()) names.insert(names.end(), kCovariances.begin(), kCovariances.end());
  bool whole =
      (cloud.normals.empty() || cloud.normals.size() == count) && (cloud.cov_mm2.empty() || cloud.cov_mm2.size() == count);
  for (const CloudField& field : cloud.fields) {
    whole = whole && field.values.size() == count && is_name(field.name);
    names.push_back(field.name);
  }
  if (!whole || cloud.frame.find('\n') != std::string::npos)
    return fail(ErrorCode::kInternal,
                fmt::format("cannot write {}: the lists of a cloud differ in length, or a name is none", shown(path)));

  std::string fields, sizes, types, counts;
  for (const std::string& name : names) {
    fields += " " + name;
    sizes += " 4";
    types += " F";
    counts += " 1";
  }
  std::string bytes = "# .PCD v0.7 - Point Cloud Data file format\n# unit mm\n";
  if (!cloud.frame.empty()) bytes += fmt::format("# frame {}\n", cloud.frame);
  bytes += fmt::format(
      "VERSION 0.7\nFIELDS{}\nSIZE{}\nTYPE{}\nCOUNT{}\nWIDTH {}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {}\nDATA binary\n",
      fields, sizes, types, counts, count, count);
  bytes.reserve(bytes.size() + count * names.size() * sizeof(float));
  bool held = true;
  for (std::size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) held &= append(bytes, cloud.points[i][k]);
    for (int k = 0; k < 3 && !cloud.normals.empty(); ++k) held &= append(bytes, cloud.normals[i][k]);
    for (int r = 0; r < 3 && !cloud.cov_mm2.empty(); ++r) {
      for (int c = r; c < 3; ++c) held &= append(bytes, cloud.cov_mm2[i](r, c));
    }
    for (const CloudField& field : cloud.fields) held &= append(bytes, field.values[i]);
  }
  if (!held) return fail(ErrorCode::kBadInput, fmt::format("cannot write {}: a value is too large for a float", shown(path)));
  return write_file_atomically(path, bytes);
}

}  // namespace crosstie::base
