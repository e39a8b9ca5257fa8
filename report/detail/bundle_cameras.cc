#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "report/detail/bundle_sections.h"
#include "report/detail/correlation.h"
#include "report/detail/html.h"
#include "report/detail/number.h"

namespace crosstie::report::detail {
namespace {

using base::AdjustedCamera;

constexpr double kFlaggedCorrelation = 0.95;
constexpr double kSignificant = 0.05;
constexpr Eigen::Index kFirstDistortion = 4;

/// Probability that a normal variable of mean 0 comes at least `t` sigmas away.
double two_sided_probability(double t) { return std::erfc(std::abs(t) / std::numbers::sqrt2); }

std::string parameter_table(const AdjustedCamera& one) {
  const base::Camera& camera = one.camera;
  const auto names = base::parameter_names(camera.model());
  const bool known = camera.covariance().size() > 0;
  HtmlTable table(
      fmt::format("Camera {}, {}, {} x {} px{}. A distortion term whose t is small cannot be told from zero; p is the "
                  "probability of such a value if it were.",
                  one.name, base::lens_model_name(camera.model()), camera.width_px(), camera.height_px(),
                  one.estimated ? "" : ", taken as given"),
      {{"Parameter", "", "", false},
       {"Value", ""},
       {"Sigma", ""},
       {"U", "", "k = 2"},
       {"Unit", "", "", false},
       {"t", "", "value over sigma"},
       {"p", ""},
       {"Significance", "", "at the 5 % level", false}});
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    const double value = camera.parameters()(index);
    const double sigma = known ? std::sqrt(std::max(0.0, camera.covariance()(index, index))) : 0.0;
    const int decimals = decimals_for_sigma(sigma, 6);
    const bool distortion = index >= kFirstDistortion;
    const double t = sigma > 0.0 ? value / sigma : 0.0;
    const double p = two_sided_probability(t);
    std::vector<Cell> row = {text_cell(std::string(names[i])), number_cell(fixed(value, decimals), value)};
    if (sigma > 0.0) {
      row.push_back(number_cell(fixed(sigma, decimals), sigma));
      row.push_back(number_cell(fixed(2.0 * sigma, decimals), 2.0 * sigma));
    } else {
      row.insert(row.end(), 2, text_cell("\u2013"));
    }
    row.push_back(text_cell(distortion ? "1" : "px"));
    if (distortion && sigma > 0.0) {
      row.push_back(number_cell(significant(t, 3), std::abs(t)));
      row.push_back(number_cell(p < 1e-4 ? "< 0.0001" : fixed(p, 4), p));
      row.push_back(text_cell(p < kSignificant ? "significant" : "not significant", p < kSignificant ? "" : "muted"));
    } else {
      row.insert(row.end(), 3, text_cell(""));
    }
    table.add_row(std::move(row));
  }
  return table.html();
}

std::string correlations(const AdjustedCamera& one) {
  const Eigen::MatrixXd correlation = correlation_matrix(one.camera.covariance());
  std::vector<std::string> names;
  for (const std::string_view name : base::parameter_names(one.camera.model())) names.emplace_back(name);
  std::string flagged;
  for (Eigen::Index i = 0; i < correlation.rows(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      if (std::abs(correlation(i, j)) <= kFlaggedCorrelation) continue;
      flagged += fmt::format("{}{} and {} ({})", flagged.empty() ? "" : ", ", names[static_cast<std::size_t>(j)],
                             names[static_cast<std::size_t>(i)], fixed(correlation(i, j), 3));
    }
  }
  return figure(correlation_map(correlation, names, fmt::format("Correlations of camera {}", one.name), kFlaggedCorrelation),
                flagged.empty()
                    ? fmt::format("Correlations of the parameters of {}; none beyond {}.", one.name, kFlaggedCorrelation)
                    : fmt::format("Correlations of the parameters of {}. Beyond {}: {}. The data hardly tell these apart; "
                                  "their single values mean little, their joint effect is what was measured.",
                                  one.name, kFlaggedCorrelation, flagged));
}

}  // namespace

std::string bundle_cameras_section(const base::AdjustedNetwork& network) {
  std::string html = paragraph(
      "Order and formulae of the parameters are mrcal's and OpenCV's; pixel (0, 0) is the centre of the first "
      "pixel.",
      "muted");
  std::vector<std::string> maps;
  for (const AdjustedCamera& camera : network.cameras) {
    html += fmt::format("<h3>Camera {}</h3>\n", escape(camera.name)) + parameter_table(camera);
    if (camera.camera.covariance().size() > 0) maps.push_back(correlations(camera));
  }
  return html + (maps.empty() ? "" : figures(maps));
}

}  // namespace crosstie::report::detail
