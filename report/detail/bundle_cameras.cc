#include <algorithm>
#include <cmath>

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

std::string parameter_table(const AdjustedCamera& one, int redundancy) {
  const base::Camera& camera = one.camera;
  const auto names = base::parameter_names(camera.model());
  const bool known = camera.covariance().size() > 0;
  const auto units = base::parameter_units(camera.model());
  HtmlTable table(
      fmt::format("Camera {}, {}, {} x {} px{}. A distortion term whose t is small cannot be told from zero; p is the "
                  "probability of such a value if it were (Student's t, {} degrees of freedom).",
                  one.name, base::lens_model_name(camera.model()), camera.width_px(), camera.height_px(),
                  one.estimated ? "" : ", taken as given", counted(redundancy)),
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
    // Below nine decimals only significant digits can be read.
    const bool tiny = sigma > 0.0 && sigma < 1e-8;
    const int decimals = decimals_for_sigma(sigma, 6);
    const auto shown = [&](double number, int digits) { return tiny ? significant(number, digits) : fixed(number, decimals); };
    const bool tested = index < one.significance_p.size() && std::isfinite(one.significance_p(index)) && sigma > 0.0;
    const double p = tested ? one.significance_p(index) : 1.0;
    std::vector<Cell> row = {text_cell(std::string(names[i])),
                             number_cell(sigma > 0.0 ? shown(value, 6) : plain(value, 8), value)};
    if (sigma > 0.0) {
      row.push_back(number_cell(shown(sigma, 2), sigma));
      row.push_back(number_cell(shown(2.0 * sigma, 2), 2.0 * sigma));
    } else {
      row.insert(row.end(), 2, text_cell("\u2013"));
    }
    row.push_back(text_cell(units[i].empty() ? "1" : std::string(units[i])));
    if (tested) {
      const double t = value / sigma;
      row.push_back(number_cell(significant(t, 3), t));
      row.push_back(number_cell(p < 1e-4 ? "< 0.0001" : fixed(p, 4), p));
      row.push_back(text_cell(p < kSignificant ? "significant" : "not significant", p < kSignificant ? "" : "warning"));
    } else {
      row.insert(row.end(), 3, text_cell(""));
    }
    table.add_row(std::move(row));
  }
  return table.html();
}

std::string correlations(const AdjustedCamera& one) {
  // Constants of a model and parameters that were held have no variance and no correlation.
  const Eigen::MatrixXd& cov = one.camera.covariance();
  std::vector<Eigen::Index> free;
  std::vector<std::string> names;
  for (Eigen::Index i = 0; i < cov.rows(); ++i) {
    if (!(cov(i, i) > 0.0)) continue;
    free.push_back(i);
    names.emplace_back(base::parameter_names(one.camera.model())[static_cast<std::size_t>(i)]);
  }
  if (free.empty()) return "";
  const Eigen::MatrixXd correlation = correlation_matrix(cov(free, free));
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
  const bool aicon = std::any_of(network.cameras.begin(), network.cameras.end(),
                                 [](const AdjustedCamera& camera) { return camera.camera.model() == base::LensModel::kAicon; });
  std::string html = paragraph(
      aicon ? "Order and formulae of the parameters are AICON's, on the sensor in mm; the last of them are constants of the "
              "model."
            : "Order and formulae of the parameters are mrcal's and OpenCV's; pixel (0, 0) is the centre of the first pixel.",
      "muted");
  std::vector<std::string> maps;
  for (const AdjustedCamera& camera : network.cameras) {
    html += fmt::format("<h3>Camera {}</h3>\n", escape(camera.name)) + parameter_table(camera, network.redundancy);
    if (camera.camera.covariance().size() == 0) continue;
    if (std::string map = correlations(camera); !map.empty()) maps.push_back(std::move(map));
  }
  return html + (maps.empty() ? "" : figures(maps));
}

}  // namespace crosstie::report::detail
