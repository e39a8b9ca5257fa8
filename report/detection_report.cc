#include "report/detection_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>

#include "report/detail/charts.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detail/page.h"
#include "report/detail/svg.h"

namespace crosstie::report {
namespace {

using base::ImageObservations;
using base::Observation;
using base::ObservationStatus;
using detail::fixed;
using detail::number_cell;
using detail::text_cell;

constexpr std::array<ObservationStatus, 5> kStates = {ObservationStatus::kCoded, ObservationStatus::kUncoded,
                                                      ObservationStatus::kAmbiguous, ObservationStatus::kUnreadable,
                                                      ObservationStatus::kRefused};
constexpr double kSaturated = 0.01;  // of all pixels: from here on glare is worth a look
constexpr double kDark = 0.5;

int count(const ImageObservations& image, ObservationStatus status) {
  return static_cast<int>(std::count_if(image.observations.begin(), image.observations.end(),
                                        [&](const Observation& one) { return one.status == status; }));
}

double sigma_px(const Observation& one) { return std::sqrt(0.5 * one.cov_px2.trace()); }

std::vector<detail::KeyFigure> key_figures(const std::vector<ImageObservations>& images) {
  std::array<int, kStates.size()> totals{};
  std::set<int> ids;
  std::vector<double> sigmas;
  for (const ImageObservations& image : images) {
    for (std::size_t i = 0; i < kStates.size(); ++i) totals[i] += count(image, kStates[i]);
    for (const Observation& one : image.observations) {
      if (one.status != ObservationStatus::kCoded) continue;
      ids.insert(one.id);
      sigmas.push_back(sigma_px(one));
    }
  }
  const double sigma = detail::median(sigmas);
  return {
      {"Images", std::to_string(images.size()), images.empty() ? "" : fmt::format("family {}", images.front().family), ""},
      {"Coded markers read", detail::counted(totals[0]), fmt::format("{} different ids", ids.size()), ""},
      {"Sigma of a centre (median)", fmt::format("{} px", detail::significant(sigma, 2)), detail::expanded(sigma, "px"), ""},
      {"Not read", detail::counted(totals[2] + totals[3]), fmt::format("{} ambiguous, {} unreadable", totals[2], totals[3]),
       ""},
      {"Refused", detail::counted(totals[4]), "read, but not in use in this job", ""},
      {"Dots without a code", detail::counted(totals[1]), "", ""}};
}

std::string image_table(const std::vector<ImageObservations>& images) {
  detail::HtmlTable table(
      "What was found in each image. Sigma is the median predicted for the centres of its coded markers. Marked: more than "
      "1 % of all pixels saturated, more than half of them dark.",
      {{"Image", "", "", false},
       {"Camera", "", "", false},
       {"Size", "px", "", false},
       {"Coded", ""},
       {"Uncoded", ""},
       {"Ambiguous", ""},
       {"Unreadable", ""},
       {"Refused", ""},
       {"Dot radius", "px", "median semi-major axis"},
       {"Sigma", "px"},
       {"Worst margin", "", "0: undecided, 1: as clear as can be"},
       {"Saturated", "%"},
       {"Dark", "%"}});
  for (const ImageObservations& image : images) {
    std::vector<double> sigmas;
    std::vector<double> radii;
    double margin = 1.0;
    for (const Observation& one : image.observations) {
      if (one.status != ObservationStatus::kCoded) continue;
      sigmas.push_back(sigma_px(one));
      radii.push_back(one.semi_major_px);
      margin = std::min(margin, one.margin);
    }
    std::vector<detail::Cell> row = {{image.image, "", "", fmt::format("#{}", detail::anchor("i-", image.image))},
                                     text_cell(image.camera),
                                     text_cell(fmt::format("{} x {}", image.width_px, image.height_px))};
    for (const ObservationStatus status : kStates) {
      const int n = count(image, status);
      row.push_back(number_cell(std::to_string(n), n));
    }
    row.push_back(sigmas.empty() ? text_cell("\u2013") : number_cell(fixed(detail::median(radii), 1), detail::median(radii)));
    row.push_back(sigmas.empty() ? text_cell("\u2013")
                                 : number_cell(detail::significant(detail::median(sigmas), 2), detail::median(sigmas)));
    row.push_back(sigmas.empty() ? text_cell("\u2013") : number_cell(fixed(margin, 2), margin));
    row.push_back(number_cell(fixed(100.0 * image.saturated_fraction, 2), image.saturated_fraction,
                              image.saturated_fraction > kSaturated ? "warning" : ""));
    row.push_back(
        number_cell(fixed(100.0 * image.dark_fraction, 1), image.dark_fraction, image.dark_fraction > kDark ? "warning" : ""));
    table.add_row(std::move(row));
  }
  return table.html();
}

/// Which id was seen in which image: a column per image, a row per id.
std::string visibility(const std::vector<ImageObservations>& images) {
  std::map<int, std::map<std::size_t, ObservationStatus>> seen;
  for (std::size_t i = 0; i < images.size(); ++i) {
    for (const Observation& one : images[i].observations) {
      if (one.id == base::kNoId || one.status == ObservationStatus::kUncoded) continue;
      const auto [at, fresh] = seen[one.id].try_emplace(i, one.status);
      if (!fresh && one.status == ObservationStatus::kCoded) at->second = one.status;
    }
  }
  if (seen.empty()) return detail::paragraph("No code was read.");
  constexpr double kLeft_px = 44.0;
  constexpr double kTop_px = 110.0;
  constexpr double kRow_px = 11.0;
  const double column_px = std::clamp(1000.0 / static_cast<double>(images.size()), 7.0, 34.0);
  detail::Svg svg(kLeft_px + column_px * static_cast<double>(images.size()) + 60.0,
                  kTop_px + kRow_px * static_cast<double>(seen.size()) + 8.0, "Which id was seen in which image",
                  fmt::format("{} ids in {} images", seen.size(), images.size()));
  for (std::size_t i = 0; i < images.size(); ++i) {
    const double x = kLeft_px + column_px * (static_cast<double>(i) + 0.5) + 3.0;
    svg.text(x, kTop_px - 6.0, images[i].image.substr(0, 20), "start", "id", -60.0);
  }
  double y = kTop_px;
  for (const auto& [id, where] : seen) {
    svg.text(kLeft_px - 6.0, y + 0.8 * kRow_px, std::to_string(id), "end", "id");
    for (const auto& [image, status] : where) {
      svg.rect(kLeft_px + column_px * static_cast<double>(image) + 0.5, y + 0.5, column_px - 1.0, kRow_px - 1.0,
               status == ObservationStatus::kCoded ? "seen" : "doubtful", "",
               fmt::format("{} in {}: {}", id, images[image].image, base::status_name(status)));
    }
    svg.text(kLeft_px + column_px * static_cast<double>(images.size()) + 6.0, y + 0.8 * kRow_px, std::to_string(where.size()),
             "start", "id");
    y += kRow_px;
  }
  return detail::figure(svg.str(), "Blue: read and in use. Orange: ambiguous or refused. At the right, in how many images.",
                        true);
}

std::string overlays(const std::vector<ImageObservations>& images, const std::vector<std::string>& hrefs) {
  std::string html = "<div class=\"thumbs\">\n";
  for (std::size_t i = 0; i < std::min(images.size(), hrefs.size()); ++i) {
    if (hrefs[i].empty()) continue;
    html += fmt::format(
        "<figure id=\"{0}\"><a href=\"{1}\"><img src=\"{1}\" alt=\"Markers found in {2}\" loading=\"lazy\"/></a>"
        "<figcaption>{2}: {3} coded</figcaption></figure>\n",
        detail::escape(detail::anchor("i-", images[i].image)), detail::escape(hrefs[i]), detail::escape(images[i].image),
        count(images[i], ObservationStatus::kCoded));
  }
  return html + "</div>\n";
}

std::string spread(const std::vector<ImageObservations>& images) {
  std::vector<int> radii;
  std::map<int, int> sightings;
  for (const ImageObservations& image : images) {
    for (const Observation& one : image.observations) {
      if (one.status != ObservationStatus::kCoded || !std::isfinite(one.semi_major_px)) continue;
      radii.push_back(static_cast<int>(std::lround(std::clamp(one.semi_major_px, 0.0, 1e6))));
      ++sightings[one.id];
    }
  }
  std::vector<int> per_id;
  for (const auto& [id, times] : sightings) per_id.push_back(times);
  return detail::figures(
      {detail::figure(detail::count_bars(per_id, "Sightings per id", "images", "ids"), "In how many images each id was read."),
       detail::figure(detail::count_bars(radii, "Size of the dots", "semi-major axis [px]", "markers"),
                      "Dots of less than about 4 px are measured poorly.")});
}

}  // namespace

std::string detection_report(const std::vector<ImageObservations>& images, const std::vector<std::string>& overlay_hrefs,
                             const ReportContext& context) {
  detail::Page page(context);
  page.key_figures(key_figures(images));
  page.section("images", "Images", images.empty() ? detail::paragraph("There is no image.") : image_table(images));
  page.section("spread", "Sightings and sizes", spread(images));
  page.section("visibility", "Which id in which image", visibility(images));
  const bool any =
      std::any_of(overlay_hrefs.begin(), overlay_hrefs.end(), [](const std::string& href) { return !href.empty(); });
  if (any) page.section("overlays", "Pictures", overlays(images, overlay_hrefs));
  return page.html();
}

}  // namespace crosstie::report
