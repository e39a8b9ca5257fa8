#include "base/lens_model.h"

#include <algorithm>
#include <array>
#include <deque>
#include <vector>

#include <fmt/format.h>

#include "base/text.h"

namespace crosstie::base {
namespace {

using Names = std::span<const std::string_view>;

struct ModelName {
  LensModel model;
  std::string_view name;
};
constexpr ModelName kModelNames[] = {{LensModel::kPinhole, "LENSMODEL_PINHOLE"},   {LensModel::kOpenCv4, "LENSMODEL_OPENCV4"},
                                     {LensModel::kOpenCv5, "LENSMODEL_OPENCV5"},   {LensModel::kOpenCv8, "LENSMODEL_OPENCV8"},
                                     {LensModel::kOpenCv12, "LENSMODEL_OPENCV12"}, {LensModel::kAicon, "AICON"}};
constexpr std::string_view kSplinedName = "LENSMODEL_SPLINED_STEREOGRAPHIC";
constexpr std::array<std::string_view, 4> kSplineKeys = {"order", "Nx", "Ny", "fov_x_deg"};

constexpr std::array<std::string_view, 16> kParameterNames = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2",
                                                              "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"};
constexpr std::array<std::string_view, 16> kParameterUnits = {"px", "px", "px", "px"};
constexpr std::array<std::string_view, 15> kAiconNames = {
    "c", "xh", "yh", "A1", "A2", "A3", "B1", "B2", "C1", "C2", "r0", "sensor_width", "sensor_height", "columns", "rows"};
constexpr std::array<std::string_view, 15> kAiconUnits = {"mm", "mm", "mm", "1/mm^2", "1/mm^4", "1/mm^6", "1/mm", "1/mm",
                                                          "",   "",   "mm", "mm",     "mm",     "px",     "px"};

/// Names and units of the largest splined model; the others' are their beginning.
class SplineParameters {
 public:
  SplineParameters() {
    names_.assign(kParameterNames.begin(), kParameterNames.begin() + 4);
    for (int i = 0; i < LensModel::kMaxControlPoints; ++i) {
      for (const char direction : {'u', 'v'}) names_.emplace_back(texts_.emplace_back(fmt::format("{}{}", direction, i)));
    }
    units_.assign(names_.size(), "");
    std::fill_n(units_.begin(), 4, "px");
  }
  [[nodiscard]] Names names() const { return names_; }
  [[nodiscard]] Names units() const { return units_; }

 private:
  std::deque<std::string> texts_;
  std::vector<std::string_view> names_;
  std::vector<std::string_view> units_;
};

const SplineParameters& spline_parameters() {
  static const SplineParameters all;
  return all;
}

/// The number after `key` and "=" at the front of `rest`, which is taken off.
std::optional<int> taken(std::string_view& rest, std::string_view key) {
  if (!rest.starts_with('_')) return std::nullopt;
  rest.remove_prefix(1);
  if (!rest.starts_with(key) || !rest.substr(key.size()).starts_with('=')) return std::nullopt;
  rest.remove_prefix(key.size() + 1);
  const std::size_t digits = std::min(rest.find_first_not_of("0123456789"), rest.size());
  if (digits == 0 || digits > 5) return std::nullopt;
  const auto value = parse_double(rest.substr(0, digits));
  rest.remove_prefix(digits);
  return value ? std::optional<int>(static_cast<int>(*value)) : std::nullopt;
}

}  // namespace

Result<LensModel> LensModel::splined(const SplineGrid& grid) {
  const auto refuse = [](std::string why) { return fail(ErrorCode::kBadInput, "a splined lens model with " + std::move(why)); };
  if (grid.order != 2 && grid.order != 3) return refuse(fmt::format("order {}; 2 and 3 are known", grid.order));
  const int least = grid.order + 1;
  if (grid.columns < least || grid.rows < least || grid.columns > kMaxControlPoints / grid.rows) {
    return refuse(fmt::format("{} x {} control points; at least {} x {} and at most {} in all are possible", grid.columns,
                              grid.rows, least, least, kMaxControlPoints));
  }
  if (grid.fov_x_degrees < 1 || grid.fov_x_degrees > 350) {
    return refuse(fmt::format("a field of view of {} degrees; 1 to 350 are possible", grid.fov_x_degrees));
  }
  LensModel model(Kind::kSplined);
  model.order_ = static_cast<std::uint8_t>(grid.order);
  model.columns_ = static_cast<std::uint16_t>(grid.columns);
  model.rows_ = static_cast<std::uint16_t>(grid.rows);
  model.fov_x_degrees_ = static_cast<std::uint16_t>(grid.fov_x_degrees);
  return model;
}

int parameter_count(LensModel model) {
  switch (model) {
    case LensModel::kPinhole:
      return 4;
    case LensModel::kOpenCv4:
      return 8;
    case LensModel::kOpenCv5:
      return 9;
    case LensModel::kOpenCv8:
      return 12;
    case LensModel::kOpenCv12:
      return 16;
    case LensModel::kAicon:
      return 15;
    case LensModel::Kind::kSplined:
      return 4 + 2 * model.grid().columns * model.grid().rows;
  }
  return 4;
}

int adjustable_count(LensModel model) { return model == LensModel::kAicon ? 10 : parameter_count(model); }

std::string lens_model_name(LensModel model) {
  for (const ModelName& entry : kModelNames) {
    if (entry.model == model) return std::string(entry.name);
  }
  const SplineGrid grid = model.grid();
  return fmt::format("{}_{}={}_{}={}_{}={}_{}={}", kSplinedName, kSplineKeys[0], grid.order, kSplineKeys[1], grid.columns,
                     kSplineKeys[2], grid.rows, kSplineKeys[3], grid.fov_x_degrees);
}

std::optional<LensModel> lens_model_from_name(std::string_view name) {
  for (const ModelName& entry : kModelNames) {
    if (entry.name == name) return entry.model;
  }
  if (!name.starts_with(kSplinedName)) return std::nullopt;
  name.remove_prefix(kSplinedName.size());
  std::array<int, 4> values{};
  for (std::size_t i = 0; i < values.size(); ++i) {
    const auto value = taken(name, kSplineKeys[i]);
    if (!value) return std::nullopt;
    values[i] = *value;
  }
  if (!name.empty()) return std::nullopt;
  const auto model = LensModel::splined({values[0], values[1], values[2], values[3]});
  return model ? std::optional<LensModel>(*model) : std::nullopt;
}

Names parameter_names(LensModel model) {
  const Names all = model == LensModel::kAicon ? Names(kAiconNames)
                    : model.is_splined()       ? spline_parameters().names()
                                               : Names(kParameterNames);
  return all.first(static_cast<std::size_t>(parameter_count(model)));
}

Names parameter_units(LensModel model) {
  const Names all = model == LensModel::kAicon ? Names(kAiconUnits)
                    : model.is_splined()       ? spline_parameters().units()
                                               : Names(kParameterUnits);
  return all.first(static_cast<std::size_t>(parameter_count(model)));
}

}  // namespace crosstie::base
