#include "edge/nominal_file.h"

#include <fmt/core.h>

#include "base/file.h"
#include "base/measured_points.h"
#include "base/ply.h"
#include "base/table.h"

namespace crosstie::edge {
namespace {

using base::ErrorCode;
using base::fail;
using base::Result;

constexpr double kSamePlace = 1e-6;  // of the extent

/// The columns nx, ny, nz of a table, or the normals of a PLY; nothing where there are none.
Result<std::vector<Eigen::Vector3d>> read_normals(const std::filesystem::path& path) {
  if (path.extension() == ".ply") {
    auto cloud = base::read_ply(path);
    if (!cloud) return fail(std::move(cloud));
    return std::move(cloud->normals);
  }
  std::vector<Eigen::Vector3d> normals;
  const auto table = base::read_table(path);
  if (!table) return normals;  // numbers without a header
  const auto x = table->column("nx");
  const auto y = table->column("ny");
  const auto z = table->column("nz");
  if (!x && !y && !z) return normals;
  if (!x || !y || !z) return fail(ErrorCode::kBadInput, fmt::format("{}: nx, ny and nz are not all there", base::shown(path)));
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    Eigen::Vector3d n;
    int axis = 0;
    for (const std::size_t column : {*x, *y, *z}) {
      const auto value = table->number(row, column);
      if (!value) return tl::unexpected(value.error());
      n(axis++) = *value;
    }
    normals.push_back(n);
  }
  return normals;
}

}  // namespace

Result<Nominal> read_nominal(const std::filesystem::path& path, const NominalFileOptions& options) {
  auto points = base::read_measured_points(path, {options.unit, {}});
  if (!points) return fail(std::move(points));
  auto normals = read_normals(path);
  if (!normals) return fail(std::move(normals));
  Nominal nominal;
  nominal.kind = NominalKind::kPoints;
  nominal.points_mm = std::move(points->points_mm);
  nominal.normals = *std::move(normals);
  nominal.closed = options.closed;
  nominal.spline = options.spline;
  if (!nominal.normals.empty() && nominal.normals.size() != nominal.points_mm.size()) {
    return fail(ErrorCode::kBadInput, fmt::format("{}: {} normals for {} points", base::shown(path), nominal.normals.size(),
                                                  nominal.points_mm.size()));
  }
  double extent = 0.0;
  for (const auto& p : nominal.points_mm) extent = std::max(extent, (p - nominal.points_mm[0]).norm());
  if (nominal.closed && nominal.points_mm.size() > 3 &&
      (nominal.points_mm.back() - nominal.points_mm.front()).norm() < kSamePlace * extent) {
    nominal.points_mm.pop_back();
    if (!nominal.normals.empty()) nominal.normals.pop_back();
  }
  if (const auto good = NominalCurve::make(nominal); !good) {
    return fail(good.error().code, fmt::format("{}: {}", base::shown(path), good.error().message));
  }
  return nominal;
}

}  // namespace crosstie::edge
