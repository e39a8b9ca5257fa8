// crosstie fit: a shape through measured points

#include <algorithm>
#include <cmath>
#include <filesystem>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/fit_result.h"
#include "app/result_folder.h"
#include "app/verb.h"
#include "base/file.h"
#include "base/json_file.h"
#include "base/measured_points.h"
#include "base/result_document.h"
#include "base/table.h"
#include "base/text.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;
using nlohmann::ordered_json;

Result<base::MeasuredPoints> read_points(const fs::path& path, const Arguments& arguments) {
  base::MeasuredPointsOptions options;
  options.unit = arguments.get("--unit").value_or("");
  if (const auto columns = arguments.get("--columns")) {
    for (const std::string_view name : base::split(*columns, ',')) options.columns.emplace_back(base::trim(name));
    if (options.columns.size() != 3) {
      return base::fail(ErrorCode::kUsage, fmt::format("--columns names three columns, such as x,y,z, not '{}'", *columns));
    }
  }
  auto points = base::read_measured_points(path, options);
  if (!points && points.error().code == ErrorCode::kUsage && options.unit.empty()) {
    points.error().message += " (--unit mm)";
  }
  return points;
}

/// What the options say of the points and the radius; `covariances` are those of the file and must outlive the result.
Result<math::ShapeFitOptions> fit_options(const Arguments& arguments, const std::vector<Eigen::Matrix3d>& covariances) {
  math::ShapeFitOptions options;
  options.robust = arguments.has("--robust");
  const auto sigma = arguments.number("--sigma-mm");
  if (!sigma) return tl::unexpected(sigma.error());
  const auto radius = arguments.number("--radius-mm");
  if (!radius) return tl::unexpected(radius.error());
  const auto radius_sigma = arguments.number("--radius-sigma-mm");
  if (!radius_sigma) return tl::unexpected(radius_sigma.error());
  options.sigma_mm = *sigma;
  if (!*sigma) options.cov_mm2 = covariances;
  if (*radius) options.radius = {**radius, radius_sigma->value_or(0.0)};
  if (*radius_sigma && !*radius) return base::fail(ErrorCode::kUsage, "--radius-sigma-mm goes with --radius-mm");
  return options;
}

ordered_json effective_options(const Arguments& arguments, const math::ShapeFitOptions& options) {
  ordered_json json;
  json["shape"] = *arguments.get("SHAPE");
  json["columns"] = arguments.get("--columns").value_or("");
  json["unit"] = arguments.get("--unit").value_or("");
  json["sigma_mm"] = options.sigma_mm ? ordered_json(*options.sigma_mm) : ordered_json();
  json["sigmas_of_points"] = !options.cov_mm2.empty();
  json["radius_mm"] = options.radius ? ordered_json(options.radius->radius_mm) : ordered_json();
  json["radius_sigma_mm"] = options.radius ? ordered_json(options.radius->sigma_mm) : ordered_json();
  json["robust"] = options.robust;
  json["max_w"] = options.max_w;
  return json;
}

/// Distances of all points with what became of them.
Result<> write_residuals(const fs::path& path, const base::MeasuredPoints& points, const math::ShapeQuality& quality) {
  base::Table table;
  table.columns = {"row", "x_mm", "y_mm", "z_mm", "residual_mm", "w", "status"};
  auto rejected = quality.rejected.begin();
  for (std::size_t i = 0; i < points.points_mm.size(); ++i) {
    std::vector<std::string> row = {std::to_string(i + 1)};
    for (int k = 0; k < 3; ++k) row.push_back(base::format_double(points.points_mm[i](k)));
    row.push_back(base::format_double(quality.residuals_mm[i]));
    if (rejected != quality.rejected.end() && rejected->index == i) {
      row.push_back(base::format_double(rejected->w));
      row.emplace_back(rejected->reason == math::RejectedPointReason::kNoConsensus ? "no_consensus" : "residual");
      ++rejected;
    } else {
      row.insert(row.end(), {"", "used"});
    }
    table.rows.push_back(std::move(row));
  }
  return base::write_table(path, table);
}

Result<> write_result(const fs::path& out, const base::MeasuredPoints& points, const FittedShape& fit,
                      const ordered_json& result) {
  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  if (auto written = write_residuals(folder->path() / "residuals.csv", points, fit.quality); !written) return written;
  if (auto written = base::write_json(folder->path() / "result.json", result); !written) return written;
  return folder->commit();
}

/// Two digits of the sigma.
int decimals_of(double sigma) {
  if (!(sigma > 0.0) || !std::isfinite(sigma)) return 4;
  return std::clamp(1 - static_cast<int>(std::floor(std::log10(sigma))), 0, 12);
}

void print_table(const FittedShape& fit, Session& session) {
  session.print(fmt::format("{} through {} of {} points, redundancy {}", fit.shape, fit.quality.count, fit.points,
                            fit.quality.redundancy));
  session.print(fmt::format("{:<12} {:<4} {:>18} {:>14} {:>14}", "", "", "value", "sigma", "U (k=2)"));
  for (const FitFigure& figure : figures_of(fit)) {
    const double sigma = figure.sigma.value_or(0.0);
    const int decimals = decimals_of(figure.shown_sigma);
    std::string line = fmt::format("{:<12} {:<4} {:>18.{}f}", figure.name, figure.unit, figure.value, decimals);
    if (figure.shown_sigma > 0.0) {
      line += fmt::format(" {:>14.{}f} {:>14.{}f}", sigma, decimals, 2.0 * sigma, decimals);
    } else if (figure.sigma) {
      line += fmt::format(" {:>14} {:>14}", std::isnan(sigma) ? "unknown" : "held", "");
    }
    session.print(line);
  }
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const fs::path path = *arguments.get("FILE");
  const auto points = read_points(path, arguments);
  if (!points) return tl::unexpected(points.error());
  const auto options = fit_options(arguments, points->cov_mm2);
  if (!options) return tl::unexpected(options.error());
  const auto fit = fit_shape(*arguments.get("SHAPE"), points->points_mm, *options);
  if (!fit) return base::fail(fit.error().code, fmt::format("{}: {}", base::shown(path), fit.error().message));

  base::ResultEnvelope envelope{"fit", points->frame, {}, {}, fit->quality.warnings};
  auto input = hashed_input(path, fs::current_path());
  if (!input) return base::fail(std::move(input));
  envelope.inputs.push_back(*std::move(input));
  const ordered_json result = base::result_json(envelope, effective_options(arguments, *options), fit_json(*fit));
  for (const base::Warning& warning : fit->quality.warnings) session.say("warning: " + warning.message);
  if (!fit->quality.rejected.empty()) {
    session.say(fmt::format("{} of {} points do not belong to the {} and take no part", fit->quality.rejected.size(),
                            fit->points, fit->shape));
  }
  if (const auto out = arguments.get("--out")) {
    if (auto written = write_result(*out, *points, *fit, result); !written) return base::fail(std::move(written));
    session.say((fs::path(*out) / "result.json").string());
  }
  if (arguments.has("--json")) {
    session.print(result.dump(2));
  } else {
    print_table(*fit, session);
  }
  return Outcome::kOk;
}

}  // namespace

Verb fit_verb() {
  return {"fit",
          "fit a line, plane, circle, sphere, cylinder or cone to measured points, with sigmas",
          "  $ crosstie fit sphere ball.xyz --unit m --robust\n"
          "  2468 of 6474 points do not belong to the sphere and take no part\n"
          "  sphere through 4006 of 6474 points, redundancy 4002\n"
          "                                 value          sigma        U (k=2)\n"
          "  centre x     mm           -5895.8241         0.0079         0.0158\n"
          "  centre y     mm            3628.9487         0.0057         0.0114\n"
          "  centre z     mm           -1561.2874         0.0048         0.0096\n"
          "  diameter     mm              100.011          0.013          0.026\n"
          "  rms          mm               0.1288\n"
          "  form         mm               0.8392",
          {{"SHAPE", "SHAPE", "line, plane, circle, sphere, cylinder or cone", true, false, 1, shape_names()},
           {"FILE", "FILE", "list of points, table, plain x y z text, NIST .ds or PLY", true, false},
           {"--columns", "NAMES", "the three columns of the coordinates, such as X,Y,Z; of files without a header 2,3,4", false,
            false},
           {"--unit", "UNIT", "mm, m or inch, where the file does not say it", false, false, 1, {"mm", "m", "inch"}},
           {"--sigma-mm", "MM",
            "standard deviation of each coordinate of a point; default: the file's, else from the residuals", false, false},
           {"--radius-mm", "MM", "known radius of a circle, sphere or cylinder: it is held", false, false},
           {"--radius-sigma-mm", "MM", "its standard deviation: it is an observation then", false, false},
           {"--robust", "", "find points that do not belong to the shape (mounts, strays) and leave them out", false, false},
           {"--json", "", "print the result as JSON instead of the table", false, false},
           {"--out", "DIR", "folder for result.json and residuals.csv; replaced as a whole", false, false}},
          run};
}

}  // namespace crosstie::app
