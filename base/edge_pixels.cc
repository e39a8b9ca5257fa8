#include "base/edge_pixels.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "base/file.h"
#include "base/table.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

constexpr std::array<std::string_view, kEdgeClassCount> kNames = {"material", "shadow", "paint"};
const std::vector<std::string> kColumns = {"camera",   "x_px",     "y_px",    "out_x", "out_y",
                                           "sigma_px", "noise_px", "band_px", "step",  "class"};

constexpr std::size_t kMostCameras = 64;

/// Four decimals of a pixel are plenty, and keep the file small.
std::string decimals(double value) { return fmt::format("{:.4f}", value); }

Result<EdgePixel> read_row(const Table& table, std::size_t row, const std::vector<std::size_t>& at) {
  const auto bad = [&](std::string_view what) {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(table.path), table.lines[row], what));
  };
  std::array<double, 8> v{};
  for (std::size_t i = 0; i < v.size(); ++i) {
    auto value = table.number(row, at[1 + i]);
    if (!value) return fail(std::move(value));
    v[i] = *value;
  }
  EdgePixel pixel;
  pixel.at_px = {v[0], v[1]};
  pixel.out = {v[2], v[3]};
  pixel.sigma_px = v[4];
  pixel.noise_px = v[5];
  pixel.band_px = v[6];
  pixel.step = v[7];
  const auto kind = edge_class_from_name(table.rows[row][at[9]]);
  if (!kind) return bad(fmt::format("unknown class \"{}\"", table.rows[row][at[9]].substr(0, 40)));
  pixel.kind = *kind;
  if (!(std::abs(pixel.out.norm() - 1.0) < 1e-3)) return bad("out_x, out_y is no direction of unit length");
  pixel.out.normalize();
  if (!(pixel.sigma_px > 0.0)) return bad("sigma_px is not positive");
  if (!(pixel.noise_px >= 0.0 && pixel.band_px >= 0.0)) return bad("noise_px or band_px is negative");
  return pixel;
}

}  // namespace

std::string_view edge_class_name(EdgeClass kind) { return kNames[static_cast<std::size_t>(kind)]; }

std::optional<EdgeClass> edge_class_from_name(std::string_view name) {
  const auto found = std::find(kNames.begin(), kNames.end(), name);
  if (found == kNames.end()) return std::nullopt;
  return static_cast<EdgeClass>(found - kNames.begin());
}

std::array<std::int64_t, kEdgeClassCount> EdgePixels::counts() const {
  std::array<std::int64_t, kEdgeClassCount> result = {};
  for (const EdgePixel& pixel : pixels) ++result[static_cast<std::size_t>(pixel.kind)];
  return result;
}

Result<> write_edge_pixels(const std::filesystem::path& path, const std::vector<EdgePixels>& cameras) {
  Table table;
  table.path = path;
  table.columns = kColumns;
  for (const EdgePixels& camera : cameras) {
    for (const EdgePixel& pixel : camera.pixels) {
      table.rows.push_back({camera.camera, decimals(pixel.at_px.x()), decimals(pixel.at_px.y()), decimals(pixel.out.x()),
                            decimals(pixel.out.y()), decimals(std::max(pixel.sigma_px, 1e-4)), decimals(pixel.noise_px),
                            decimals(pixel.band_px), fmt::format("{:.2f}", pixel.step),
                            std::string(edge_class_name(pixel.kind))});
    }
  }
  return write_table(path, table);
}

Result<std::vector<EdgePixels>> read_edge_pixels(const std::filesystem::path& path) {
  auto table = read_table(path);
  if (!table) return fail(std::move(table));
  std::vector<std::size_t> at;
  for (const std::string& name : kColumns) {
    const auto column = table->column(name);
    if (!column) return fail(ErrorCode::kBadInput, fmt::format("{}: the column {} is missing", shown(path), name));
    at.push_back(*column);
  }
  std::vector<EdgePixels> cameras;
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    const std::string& name = table->rows[row][at[0]];
    auto camera = std::find_if(cameras.begin(), cameras.end(), [&](const EdgePixels& c) { return c.camera == name; });
    if (camera == cameras.end()) {
      if (cameras.size() == kMostCameras) {
        return fail(ErrorCode::kBadInput,
                    fmt::format("{}:{}: more than {} cameras", shown(path), table->lines[row], kMostCameras));
      }
      cameras.emplace_back();
      cameras.back().camera = name;
      camera = cameras.end() - 1;
    }
    auto pixel = read_row(*table, row, at);
    if (!pixel) return fail(std::move(pixel));
    camera->pixels.push_back(*pixel);
  }
  return cameras;
}

}  // namespace crosstie::base
