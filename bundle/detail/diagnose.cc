#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "bundle/detail/components.h"
#include "bundle/detail/diagnose.h"
#include "bundle/detail/outcome.h"

namespace crosstie::bundle::detail {
namespace {

using base::AdjustedNetwork;
using base::Warning;

constexpr int kFewRays = 3;
constexpr double kSmallAngle_rad = 20.0 * std::numbers::pi / 180.0;
constexpr double kUncontrolled = 0.05;  // redundancy number under which a blunder would hardly show
constexpr double kContradiction = 3.3;  // sigmas
constexpr double kUnlikely = 0.001;

/// Uncoded targets can be many, and nobody chose them one by one: those that are weak are told together.
void about_uncoded(AdjustedNetwork& result) {
  int weak = 0;
  int all = 0;
  for (const auto& point : result.points) {
    if (point.kind != "uncoded") continue;
    ++all;
    weak += point.angle_rad < kSmallAngle_rad ? 1 : 0;
  }
  if (weak == 0) return;
  result.warnings.push_back(
      {"small_angle", "uncoded",
       fmt::format("the rays to {} of {} uncoded targets meet at less than {:.0f} degrees, their depth is "
                   "weak; points.csv has the angle of each",
                   weak, all, kSmallAngle_rad * 180.0 / std::numbers::pi)});
}

void about_points(AdjustedNetwork& result) {
  for (const auto& point : result.points) {
    if (point.kind == "uncoded") continue;
    if (point.rays < kFewRays) {
      result.warnings.push_back(
          {"few_rays", fmt::format("{}", point.id),
           fmt::format("point {} is seen in {} images only; a wrong one would not show. Take more images of it", point.id,
                       point.rays)});
    } else if (point.angle_rad < kSmallAngle_rad) {
      result.warnings.push_back(
          {"small_angle", fmt::format("{}", point.id),
           fmt::format("the rays to point {} meet at {:.0f} degrees at most, its depth is weak. Take images from "
                       "further to the side",
                       point.id, point.angle_rad * 180.0 / std::numbers::pi)});
    }
  }
}

void about_images(AdjustedNetwork& result) {
  std::vector<int> weak(result.images.size(), 0);
  for (const auto& observation : result.residuals) {
    if (observation.redundancy.minCoeff() < kUncontrolled) ++weak[static_cast<std::size_t>(observation.image)];
  }
  for (std::size_t i = 0; i < weak.size(); ++i) {
    if (weak[i] == 0) continue;
    result.warnings.push_back(
        {"weakly_controlled", result.images[i].name,
         fmt::format("{} of the {} image points of {} are hardly controlled by others: a blunder in them would "
                     "not show",
                     weak[i], result.images[i].rays, result.images[i].name)});
  }
}

void about_scale(AdjustedNetwork& result) {
  int used = 0;
  for (const auto& bar : result.scale_bars) used += bar.bar.role == base::ScaleBarRole::kUsed ? 1 : 0;
  const auto name = [](const base::AdjustedScaleBar& bar) { return fmt::format("{}-{}", bar.bar.id_a, bar.bar.id_b); };
  if (used == 1 && result.scale_bars.size() == 1) {
    result.warnings.push_back({"one_scale_bar", name(result.scale_bars.front()),
                               "one scale bar gives the scale and nothing checks it; measure a second length"});
  }
  const bool contradiction = std::any_of(result.scale_bars.begin(), result.scale_bars.end(), [](const auto& bar) {
    return bar.bar.role == base::ScaleBarRole::kUsed && std::abs(bar.w) > kContradiction;
  });
  std::string contradicting;
  for (const auto& bar : result.scale_bars) {
    // Of two bars nobody can tell which is wrong.
    if (bar.bar.role == base::ScaleBarRole::kUsed && (std::abs(bar.w) > kContradiction || (contradiction && used == 2))) {
      contradicting += fmt::format("{}{} ({:+.4f} mm, {:.1f} sigma)", contradicting.empty() ? "" : ", ", name(bar),
                                   bar.measured_mm - bar.bar.length_at_temperature_mm(), bar.w);
    } else if (bar.bar.role == base::ScaleBarRole::kCheck && std::abs(bar.w) > kContradiction) {
      result.warnings.push_back({"check_bar", name(bar),
                                 fmt::format("the check bar {} is measured {:+.4f} mm off, {:.1f} of its sigmas", name(bar),
                                             bar.measured_mm - bar.bar.length_at_temperature_mm(), bar.w)});
    }
  }
  if (!contradicting.empty()) {
    result.warnings.push_back({"contradicting_bars", contradicting,
                               "these scale bars contradict each other or the images: " + contradicting +
                                   ". Compare lengths, units, ids and temperatures with the certificates"});
  }
}

void about_control(AdjustedNetwork& result) {
  std::string contradicting;
  for (const auto& point : result.control) {
    if (point.w <= kContradiction) continue;
    contradicting += fmt::format("{}{} ({:+.4f} {:+.4f} {:+.4f} mm, w {:.1f})", contradicting.empty() ? "" : ", ", point.id,
                                 point.residual_mm.x(), point.residual_mm.y(), point.residual_mm.z(), point.w);
  }
  if (!contradicting.empty()) {
    result.warnings.push_back({"contradicting_control", contradicting,
                               "these control points contradict each other or the images: " + contradicting +
                                   ". Compare coordinates, units, ids and sigmas with their source"});
  }
}

/// Image points that lie where another id is: two targets were swapped, or an id was misread.
void about_wrong_ids(AdjustedNetwork& result) {
  std::string found;
  for (const auto& rejected : result.rejected) {
    const std::size_t at = rejected.reason.find("at the place of id");
    if (at == std::string::npos) continue;
    found += fmt::format("{}{} in {} ({})", found.empty() ? "" : ", ", rejected.id, rejected.image, rejected.reason.substr(at));
  }
  if (found.empty()) return;
  result.warnings.push_back(
      {"wrong_ids", found, "these image points lie where other ids are expected and were left out: " + found});
}

void about_weights(const Weights& weights, AdjustedNetwork& result) {
  const bool uncoded =
      std::any_of(result.points.begin(), result.points.end(), [](const auto& point) { return point.kind == "uncoded"; });
  if (weights.estimated() && (result.model_sigma_px > 0.0 || (uncoded && result.uncoded_model_sigma_px > 0.0))) {
    result.warnings.push_back(
        {"sigma_estimated", "",
         fmt::format("{:.4f} px{} were added to the detector's sigmas so that they agree with the residuals; sigma0 is 1 "
                     "by that, and its test says nothing",
                     result.model_sigma_px,
                     uncoded ? fmt::format(" (uncoded targets: {:.4f} px)", result.uncoded_model_sigma_px) : "")});
  } else if (result.redundancy > 0 && result.chi2_p < kUnlikely) {
    result.warnings.push_back(
        {"sigma0_test", "",
         fmt::format("sigma0 is {:.2f}: the a priori sigmas are too {} by that factor; the covariances are scaled by it",
                     result.sigma0, result.sigma0 > 1.0 ? "small" : "large")});
  }
}

}  // namespace

void diagnose(const Survey& survey, const State& state, const Weights& weights, AdjustedNetwork& result) {
  result.warnings.insert(result.warnings.end(), survey.warnings.begin(), survey.warnings.end());
  about_scale(result);
  about_control(result);
  about_lenses(survey, state, result);
  about_views(survey, result);
  about_images(result);
  about_points(result);
  about_uncoded(result);
  about_weights(weights, result);
  about_components(result);
  about_wrong_ids(result);
  std::size_t total = survey.rays.size();
  std::size_t moved = 0;
  std::string moved_ids;
  int last = base::kNoId;
  for (const auto& rejected : result.rejected) {
    if (!rejected.reason.starts_with("moved between images")) continue;
    ++moved;
    if (rejected.id != last && moved_ids.find(fmt::format(" {},", rejected.id)) == std::string::npos) {
      moved_ids += fmt::format(" {},", rejected.id);
    }
    last = rejected.id;
  }
  if (moved > 0) {
    moved_ids.pop_back();
    result.warnings.push_back(
        {"moved_points", moved_ids.substr(1), "these targets moved between the images and were left out:" + moved_ids});
  }
  constexpr double kSuspicious = 0.03;
  const std::size_t outliers = result.rejected.size() - moved;
  if (total > 0 && static_cast<double>(outliers) > kSuspicious * static_cast<double>(total)) {
    result.warnings.push_back(
        {"many_rejected", "",
         fmt::format("{} of {} image points were rejected; more than 3 % is suspicious. Look at the reasons", outliers,
                     total)});
  }
  for (std::size_t i = 0; i < survey.images.size(); ++i) {
    if (state.poses[i]) continue;
    result.warnings.push_back(
        {"image_not_oriented", survey.images[i], survey.images[i] + " could not be oriented and was left out"});
  }
}

}  // namespace crosstie::bundle::detail
