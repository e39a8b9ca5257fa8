#include "base/cloud_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/file.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

bool holds_ids(const CloudField& field) {
  return field.name == "id" && std::all_of(field.values.begin(), field.values.end(), [](double v) {
           return v == std::floor(v) && v >= 0.0 && v <= std::numeric_limits<int>::max();
         });
}

}  // namespace

Result<> write_cloud_table(const std::filesystem::path& path, const Cloud& cloud) {
  const char separator = path.extension() == ".txt" ? ' ' : ',';
  const auto ids = std::find_if(cloud.fields.begin(), cloud.fields.end(), holds_ids);
  // In a list of points it would be taken for a misspelt sigma_x_mm, and the covariances say it.
  const bool is_list = ids != cloud.fields.end();
  const auto is_shown = [&](const CloudField& field) {
    return &field != std::to_address(ids) && !(is_list && field.name == "sigma_mm" && !cloud.cov_mm2.empty());
  };
  std::string text;
  const auto cell = [&](std::string_view word) {
    if (!text.empty() && text.back() != '\n') text += separator;
    text += word;
  };
  if (is_list) cell("id");
  for (const char* name : {"x_mm", "y_mm", "z_mm"}) cell(name);
  for (const char* name : {"nx", "ny", "nz"}) {
    if (!cloud.normals.empty()) cell(name);
  }
  for (const char* name : {"cov_xx_mm2", "cov_xy_mm2", "cov_xz_mm2", "cov_yy_mm2", "cov_yz_mm2", "cov_zz_mm2"}) {
    if (!cloud.cov_mm2.empty()) cell(name);
  }
  for (const CloudField& field : cloud.fields) {
    if (is_shown(field)) cell(field.name);
  }
  text += '\n';
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (is_list) cell(std::to_string(static_cast<int>(ids->values[i])));
    for (const double value : cloud.points[i]) cell(format_double(value));
    for (int k = 0; k < 3 && !cloud.normals.empty(); ++k) cell(format_double(cloud.normals[i][k]));
    for (int r = 0; r < 3 && !cloud.cov_mm2.empty(); ++r) {
      for (int c = r; c < 3; ++c) cell(format_double(cloud.cov_mm2[i](r, c)));
    }
    for (const CloudField& field : cloud.fields) {
      if (is_shown(field)) cell(format_double(field.values[i]));
    }
    text += '\n';
  }
  return write_file_atomically(path, text);
}

}  // namespace crosstie::base
