// observations.csv of base/result_document.h.
#include <algorithm>
#include <array>
#include <map>

#include <fmt/format.h>

#include "base/file.h"
#include "base/result_document.h"
#include "base/table.h"
#include "base/text.h"

namespace crosstie::base {
namespace {

const std::vector<std::string> kColumns = {"image",  "family", "id",   "x_px",      "y_px",   "cov_xx", "cov_xy",
                                           "cov_yy", "a_px",   "b_px", "angle_rad", "margin", "status"};

std::optional<ObservationStatus> status_from_name(std::string_view name) {
  for (const auto status : {ObservationStatus::kCoded, ObservationStatus::kUncoded, ObservationStatus::kAmbiguous,
                            ObservationStatus::kUnreadable, ObservationStatus::kRefused}) {
    if (status_name(status) == name) return status;
  }
  return std::nullopt;
}

Result<Observation> read_row(const Table& table, std::size_t row, const std::array<std::size_t, 13>& at) {
  const auto bad = [&](std::string_view what) {
    return fail(ErrorCode::kBadInput, fmt::format("{}:{}: {}", shown(table.path), table.lines[row], what));
  };
  Observation o;
  auto id = table.integer(row, at[2]);
  if (!id) return fail(std::move(id));
  o.id = *id;
  std::array<double, 9> v{};
  for (std::size_t i = 0; i < v.size(); ++i) {
    auto value = table.number(row, at[3 + i]);
    if (!value) return fail(std::move(value));
    v[i] = *value;
  }
  o.centre_px = {v[0], v[1]};
  o.cov_px2 << v[2], v[3], v[3], v[4];
  o.semi_major_px = v[5];
  o.semi_minor_px = v[6];
  o.angle_rad = v[7];
  o.margin = v[8];
  const auto status = status_from_name(table.rows[row][at[12]]);
  if (!status) return bad(fmt::format("unknown status \"{}\"", table.rows[row][at[12]].substr(0, 40)));
  o.status = *status;
  if (o.status == ObservationStatus::kCoded && o.id < 0) return bad("a coded marker without an id");
  if (o.id < kNoId) return bad(fmt::format("id {}: ids are 0 or larger, {} where there is none", o.id, kNoId));
  if (o.cov_px2(0, 0) < 0.0 || o.cov_px2.determinant() < 0.0) return bad("the covariance is not positive semidefinite");
  return o;
}

}  // namespace

Result<> write_observations(const std::filesystem::path& path, const std::vector<ImageObservations>& images) {
  Table table;
  table.path = path;
  table.columns = kColumns;
  for (const ImageObservations& image : images) {
    for (const Observation& o : image.observations) {
      std::vector<std::string> row = {image.image, image.family, std::to_string(o.id)};
      for (const double value : {o.centre_px.x(), o.centre_px.y(), o.cov_px2(0, 0), o.cov_px2(0, 1), o.cov_px2(1, 1),
                                 o.semi_major_px, o.semi_minor_px, o.angle_rad, o.margin}) {
        row.push_back(format_double(value));
      }
      row.emplace_back(status_name(o.status));
      table.rows.push_back(std::move(row));
    }
  }
  return write_table(path, table);
}

Result<std::vector<ImageObservations>> read_observations(const std::filesystem::path& path) {
  auto table = read_table(path);
  if (!table) return fail(std::move(table));
  std::array<std::size_t, 13> at{};
  for (std::size_t i = 0; i < at.size(); ++i) {
    const auto column = table->column(kColumns[i]);
    if (!column) return fail(ErrorCode::kBadInput, fmt::format("{}: the column {} is missing", shown(path), kColumns[i]));
    at[i] = *column;
  }
  std::vector<ImageObservations> images;
  std::map<std::string, std::size_t> index;
  for (std::size_t row = 0; row < table->rows.size(); ++row) {
    const auto& cells = table->rows[row];
    const auto [found, is_new] = index.emplace(cells[at[0]], images.size());
    if (is_new) {
      images.emplace_back();
      images.back().image = cells[at[0]];
      images.back().family = cells[at[1]];
    }
    ImageObservations& image = images[found->second];
    if (image.family != cells[at[1]]) {
      return fail(ErrorCode::kBadInput, fmt::format("{}:{}: image {} has two families, {} and {}", shown(path),
                                                    table->lines[row], image.image, image.family, cells[at[1]]));
    }
    auto observation = read_row(*table, row, at);
    if (!observation) return fail(std::move(observation));
    image.observations.push_back(*observation);
  }
  return images;
}

}  // namespace crosstie::base
