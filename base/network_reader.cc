#include "base/network_reader.h"

#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/detail/result_reading.h"
#include "base/file.h"
#include "base/table.h"

namespace crosstie::base {
namespace {

using detail::Json;
using detail::numbers;
using detail::symmetric;
using detail::Unreadable;

AdjustedCamera camera_of(const Json& json) { return {json.at("name"), detail::lens_of(json), json.at("estimated")}; }

AdjustedImage image_of(const Json& json) {
  AdjustedImage image;
  image.name = json.at("name");
  image.camera = json.at("camera");
  image.network_from_camera = detail::pose_of(json.at("network_from_camera"));
  image.cov = symmetric(json.at("cov"), 6);
  image.rms_px = json.at("rms_px");
  image.rays = json.at("rays");
  return image;
}

AdjustedPoint point_of(const Json& json) {
  AdjustedPoint point;
  point.id = json.at("id");
  point.kind = json.at("kind");
  point.xyz_mm = numbers(json.at("xyz_mm"), 3);
  point.cov_mm2 = symmetric(json.at("cov_mm2"), 3);
  point.rays = json.at("rays");
  point.angle_rad = json.at("angle_rad");
  return point;
}

AdjustedNetwork network_of(const Json& json) {
  detail::check_verb(json, "adjust");
  AdjustedNetwork network;
  network.datum = json.at("datum");
  network.scale = json.value("scale", "");
  network.sigma0 = json.at("sigma0");
  network.sigma0_px = json.at("sigma0_px");
  network.observations = json.at("observations");
  network.unknowns = json.at("unknowns");
  network.conditions = json.at("conditions");
  network.redundancy = json.at("redundancy");
  for (const Json& camera : json.at("cameras")) network.cameras.push_back(camera_of(camera));
  for (const Json& image : json.at("images")) network.images.push_back(image_of(image));
  for (const Json& point : json.at("points")) network.points.push_back(point_of(point));
  for (const AdjustedImage& image : network.images) {
    const bool known = std::any_of(network.cameras.begin(), network.cameras.end(),
                                   [&](const AdjustedCamera& camera) { return camera.name == image.camera; });
    if (!known) throw Unreadable(fmt::format("image {} has the unknown camera {}", image.name, image.camera));
  }
  return network;
}

/// The columns of residuals.csv that are read, in this order.
constexpr std::array kNumberColumns = {
    "x_px", "y_px", "residual_x_px", "residual_y_px", "sigma_x_px", "sigma_y_px", "redundancy_x", "redundancy_y", "w"};

Result<> read_residuals(const std::filesystem::path& path, AdjustedNetwork& network) {
  const auto table = read_table(path);
  if (!table) return tl::unexpected<Error>(table.error());
  const auto bad = [&](int line, std::string_view what) {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(path), line, what));
  };
  const auto image_column = table->column("image");
  const auto id_column = table->column("id");
  if (!image_column || !id_column) return bad(1, "the columns image and id are missing");
  std::array<std::size_t, kNumberColumns.size()> columns{};
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const auto column = table->column(kNumberColumns[i]);
    if (!column) return bad(1, fmt::format("the column {} is missing", kNumberColumns[i]));
    columns[i] = *column;
  }
  std::map<std::string, int> images;
  std::map<int, int> points;
  for (const AdjustedImage& image : network.images) images.emplace(image.name, static_cast<int>(images.size()));
  for (const AdjustedPoint& point : network.points) points.emplace(point.id, static_cast<int>(points.size()));
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    const auto id = table->integer(row, *id_column);
    if (!id) return tl::unexpected<Error>(id.error());
    const auto image = images.find(table->rows[row][*image_column]);
    const auto point = points.find(*id);
    if (image == images.end()) return bad(table->lines[row], "the result knows no such image");
    if (point == points.end()) return bad(table->lines[row], fmt::format("the result knows no point {}", *id));
    std::array<double, kNumberColumns.size()> values{};
    for (std::size_t i = 0; i < values.size(); ++i) {
      const auto value = table->number(row, columns[i]);
      if (!value) return tl::unexpected<Error>(value.error());
      values[i] = *value;
    }
    network.residuals.push_back({image->second,
                                 point->second,
                                 {values[0], values[1]},
                                 {values[2], values[3]},
                                 {values[4], values[5]},
                                 {values[6], values[7]},
                                 values[8]});
  }
  return {};
}

}  // namespace

Result<AdjustedNetwork> read_adjusted_network(const std::filesystem::path& folder) {
  auto network = detail::read_result(folder, network_of);
  if (!network) return network;
  if (auto read = read_residuals(folder / "residuals.csv", *network); !read) return fail(std::move(read));
  return network;
}

}  // namespace crosstie::base
