#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "report/bundle_report.h"
#include "report/detail/html.h"
#include "report/detail/number.h"
#include "report/detection_report.h"
#include "tests/report/markup.h"
#include "tests/report/synthetic_network.h"

namespace crosstie::report {
namespace {

using base::AdjustedNetwork;
using tests::attribute_values;
using tests::markup_error;
using tests::synthetic_context;
using tests::synthetic_network;
using tests::without_code;

constexpr const char* kNasty = "<script>alert(\"1\")</script> & 'x' ]]> \x01 \xff";

void expect_sound(const std::string& page) {
  EXPECT_EQ(markup_error(page), std::nullopt);
  for (const char* name : {"src", "href", "action", "data", "poster"}) {
    for (const std::string& value : attribute_values(without_code(page), name)) {
      EXPECT_EQ(value.find("//"), std::string::npos) << name << "=" << value;
      EXPECT_EQ(value.find("javascript:"), std::string::npos) << value;
    }
  }
  EXPECT_TRUE(tests::contains(page, "default-src &#39;none&#39;")) << "default-src &#39;none&#39;";
  EXPECT_FALSE(tests::contains(page, "unsafe-inline")) << "unsafe-inline";
  const std::string text = without_code(page);
  EXPECT_FALSE(tests::contains(text, "\"nan")) << "\"nan";
  EXPECT_FALSE(tests::contains(text, "nan,")) << "nan,";
  EXPECT_FALSE(tests::contains(text, "inf ")) << "inf ";
  EXPECT_TRUE(attribute_values(text, "style").empty()) << "inline styles are refused by the page's own policy";
}

/// Every anchor that the page links to exists.
void expect_links_lead_somewhere(const std::string& page) {
  const std::string text = without_code(page);
  const std::vector<std::string> ids = attribute_values(text, "id");
  for (const std::string& href : attribute_values(text, "href")) {
    if (!href.starts_with("#")) continue;
    EXPECT_NE(std::find(ids.begin(), ids.end(), href.substr(1)), ids.end()) << href;
  }
  std::vector<std::string> sorted = ids;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(std::adjacent_find(sorted.begin(), sorted.end()), sorted.end()) << "an id stands there twice";
}

TEST(BundleReport, IsSoundAndSaysWhatMatters) {
  const std::string page = bundle_report(synthetic_network(), synthetic_context("adjust"));
  expect_sound(page);
  expect_links_lead_somewhere(page);
  for (const char* text : {"WARNING", "inner constraints", "Chi-square", "U (k = 2)", "moved between images", "not significant",
                           "k2 and k3 (-0.985)", "700.1049", "aaaaaaaaaaaaaaaa"}) {
    EXPECT_TRUE(tests::contains(page, text)) << text;
  }
  // Every table has a caption and heads with a scope; every drawing has a name.
  const std::string text = without_code(page);
  const auto count = [&](const std::string& what) {
    std::size_t n = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
    return n;
  };
  EXPECT_EQ(count("<table>"), count("<caption>"));
  EXPECT_EQ(count("<th "), count("scope=\"col\"") + count("scope=\"row\""));
  EXPECT_GT(count("<svg "), 10u);
  EXPECT_EQ(count("<svg "), count("role=\"img\" aria-label=\""));
}

/// The text of the cell in this column of the row that begins with `key`, in the first table after `section` that has it.
std::string cell(const std::string& page, const std::string& section, const std::string& key, std::size_t column) {
  const std::size_t at = page.find("<section id=\"" + section + "\"");
  if (at == std::string::npos) return "no section";
  const std::size_t row = page.find(">" + key + "</th>", at);
  if (row == std::string::npos || row > page.find("</section>", at)) return "no row";
  std::size_t td = row;
  for (std::size_t c = 0; c < column; ++c) td = page.find("<td", td + 1);
  const std::size_t begin = page.find('>', td) + 1;
  return page.substr(begin, page.find('<', begin) - begin);
}

TEST(BundleReport, BalanceAndRankAreThoseOfTheResult) {
  const AdjustedNetwork network = synthetic_network();
  const std::string page = bundle_report(network, synthetic_context("adjust"));
  const auto number = [](int value) { return detail::counted(value); };
  EXPECT_EQ(cell(page, "adjustment", "Image points (IP)", 1), number(network.observed.image_coordinates));
  EXPECT_EQ(cell(page, "adjustment", "Interior orientation (IO)", 1), "18");
  EXPECT_EQ(cell(page, "adjustment", "Exterior orientation (EO)", 1), "144");
  EXPECT_EQ(cell(page, "adjustment", "Object points (OP)", 1), "132");
  EXPECT_EQ(cell(page, "adjustment", "Redundancy", 1), number(network.redundancy));
  EXPECT_TRUE(tests::contains(page, "294 of 294 unknowns"));
  EXPECT_TRUE(tests::contains(page, "288 = u \u2212 6 of the datum"));
  EXPECT_TRUE(tests::contains(page, "camera left k2, camera left k3"));
  EXPECT_TRUE(tests::contains(page, "3 shifts and 3 rotations")) << "what the datum fixes";
}

TEST(BundleReport, PointsShowEllipsoidAndControl) {
  AdjustedNetwork network = synthetic_network();
  network.points[0].cov_mm2 = Eigen::Vector3d(0.003, 0.002, 0.006).cwiseAbs2().asDiagonal();
  network.points[0].least_redundancy = 0.03;
  const std::string page = bundle_report(network, synthetic_context("adjust"));
  EXPECT_EQ(cell(page, "points", "2", 5), "3.0");   // sx in micrometres
  EXPECT_EQ(cell(page, "points", "2", 8), "6.0");   // U of it
  EXPECT_EQ(cell(page, "points", "2", 11), "6.0");  // the longest semi-axis
  EXPECT_EQ(cell(page, "points", "2", 13), "2.0");  // the shortest
  EXPECT_TRUE(tests::contains(page, "class=\"n warning\" data-v=\"0.03\"")) << "an uncontrolled point is marked";
}

TEST(BundleReport, LensTermsCarryTheirSignificance) {
  const std::string page = bundle_report(synthetic_network(), synthetic_context("adjust"));
  EXPECT_EQ(cell(page, "cameras", "p1", 6), "0.0690");
  EXPECT_EQ(cell(page, "cameras", "p1", 7), "not significant");
  EXPECT_EQ(cell(page, "cameras", "k1", 6), "&lt; 0.0001");
  EXPECT_EQ(cell(page, "cameras", "k1", 7), "significant");
  EXPECT_EQ(cell(page, "cameras", "fx", 6), "") << "no test of a focal length";
}

TEST(BundleReport, RigsAndControlPoints) {
  const AdjustedNetwork network = synthetic_network();
  const std::string page = bundle_report(network, synthetic_context("adjust"));
  EXPECT_TRUE(
      tests::contains(page, detail::with_sigma(network.rigs[0].baseline_mm(), network.rigs[0].baseline_sigma_mm(), "mm")));
  EXPECT_EQ(cell(page, "rigs", "right", 8), "-17.76169");  // -0.31 rad about y
  EXPECT_EQ(cell(page, "rigs", "left", 4), "\u2013") << "the first camera defines the frame";
  EXPECT_EQ(cell(page, "control", "7", 1), "0.012");
  EXPECT_EQ(cell(page, "control", "7", 7), "4.20");
  const std::string without = bundle_report({}, {});
  EXPECT_FALSE(tests::contains(without, "id=\"rigs\""));
  EXPECT_FALSE(tests::contains(without, "id=\"control\""));
}

TEST(BundleReport, TellsWhatWasLeftOutByReason) {
  AdjustedNetwork network = synthetic_network();
  network.rejected = {{"a", 31, "blunder: image point lies 0.31 px off", 18.4},
                      {"b", 32, "blunder: image point lies 0.52 px off", 22.0},
                      {"c", base::kNoId, "image not oriented: no coded marker was read in it", 0.0}};
  network.uncoded = {40, 31, 8, {{"a", {1.0, 2.0}, true}, {"b", {1.0, 2.0}, false}}};
  const std::string page = bundle_report(network, synthetic_context("adjust"));
  EXPECT_EQ(cell(page, "rejected", "blunder", 1), "2");
  EXPECT_EQ(cell(page, "rejected", "blunder", 2), "31, 32");
  EXPECT_EQ(cell(page, "rejected", "image not oriented", 1), "1");
  EXPECT_TRUE(tests::contains(page, "Fit more than one target</dt><dd>1<"));
}

TEST(BundleReport, TargetsWithoutACodeAreDrawnAsRings) {
  AdjustedNetwork network = synthetic_network();
  EXPECT_FALSE(tests::contains(bundle_report(network, {}), "\"ring\":true}"));
  network.points[3].kind = "uncoded";
  const std::string page = bundle_report(network, {});
  EXPECT_TRUE(tests::contains(page, "\"ring\":true}"));
  EXPECT_TRUE(tests::contains(page, "class=\"ring\""));
}

TEST(BundleReport, SameInputGivesTheSameBytes) {
  EXPECT_EQ(bundle_report(synthetic_network(), synthetic_context("adjust")),
            bundle_report(synthetic_network(), synthetic_context("adjust")));
  EXPECT_NE(bundle_report(synthetic_network(1), synthetic_context("adjust")),
            bundle_report(synthetic_network(2), synthetic_context("adjust")));
}

TEST(BundleReport, EscapesEveryString) {
  AdjustedNetwork network = synthetic_network();
  network.datum = network.scale = kNasty;
  network.images[0].name = kNasty;
  network.points[0].kind = kNasty;
  network.rejected[0].image = network.rejected[0].reason = kNasty;
  network.scale_bars[0].bar.certificate = kNasty;
  network.warnings.push_back({kNasty, kNasty, kNasty});
  for (auto& image : network.images) {
    if (image.camera == "left") image.camera = kNasty;
  }
  network.cameras[0].name = kNasty;
  ReportContext context = synthetic_context("adjust");
  context.title = context.job = context.options_json = context.envelope.verb = context.envelope.frame = kNasty;
  context.envelope.inputs.push_back({kNasty, kNasty});
  context.envelope.verdicts.push_back({kNasty, 1.0, 2.0, kNasty, kNasty, base::VerdictLevel::kFail});
  context.envelope.warnings.push_back({kNasty, kNasty, kNasty});
  const std::string page = bundle_report(network, context);
  expect_sound(page);
  EXPECT_FALSE(tests::contains(page, "<script>alert")) << "<script>alert";
  EXPECT_FALSE(tests::contains(page, "\x01")) << "\x01";
  EXPECT_TRUE(tests::contains(page, "&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt; &amp; &#39;x&#39; ]]&gt;"))
      << "&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt; &amp; &#39;x&#39; ]]&gt;";
}

TEST(BundleReport, DegenerateNetworks) {
  const ReportContext context = synthetic_context("adjust");
  const std::string empty = bundle_report({}, {});
  expect_sound(empty);
  expect_links_lead_somewhere(empty);
  EXPECT_TRUE(tests::contains(empty, "NOT JUDGED")) << "NOT JUDGED";
  EXPECT_TRUE(tests::contains(empty, "There is no adjusted point")) << "There is no adjusted point";

  AdjustedNetwork one;
  one.points.push_back({7});
  expect_sound(bundle_report(one, context));

  AdjustedNetwork zeros = synthetic_network();
  zeros.sigma0 = zeros.sigma0_px = 0.0;
  for (auto& point : zeros.points) point.cov_mm2.setZero();
  for (auto& image : zeros.images) image.cov.setZero();
  for (auto& camera : zeros.cameras) camera.camera.set_covariance({});
  for (auto& residual : zeros.residuals) {
    residual.residual_px.setZero();
    residual.sigma_px.setZero();
    residual.redundancy.setZero();
  }
  expect_sound(bundle_report(zeros, context));

  AdjustedNetwork wild = synthetic_network();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  wild.sigma0 = nan;
  wild.points[0].xyz_mm.setConstant(nan);
  wild.points[1].cov_mm2.setConstant(infinite);
  wild.points[2].xyz_mm.x() = 1e300;
  wild.points[3].angle_rad = nan;
  wild.residuals[0].residual_px.setConstant(nan);
  wild.residuals[1].measured_px.setConstant(infinite);
  wild.images[0].cov.setConstant(nan);
  wild.images[1].network_from_camera.translation_mm.setConstant(nan);
  expect_sound(bundle_report(wild, context));
}

TEST(BundleReport, TheWorstVerdictIsTheBanner) {
  ReportContext context = synthetic_context("adjust");
  const auto banner = [&] { return bundle_report({}, context).substr(0, 60000); };
  EXPECT_TRUE(tests::contains(banner(), "class=\"banner warning\"")) << "class=\"banner warning\"";
  context.envelope.verdicts[1].level = base::VerdictLevel::kOk;
  EXPECT_TRUE(tests::contains(banner(), "class=\"banner ok\"")) << "class=\"banner ok\"";
  context.envelope.verdicts[0].level = base::VerdictLevel::kFail;
  EXPECT_TRUE(tests::contains(banner(), "class=\"banner fail\"")) << "class=\"banner fail\"";
}

TEST(DetectionReport, IsSoundWithNastyNamesAndOverlays) {
  std::vector<base::ImageObservations> images(3);
  images[0] = {"a", "left", "ring10", 100, 80, 0.02, 0.6, 0.0, {}};
  images[1] = {kNasty, kNasty, "ring10", 100, 80, 0.0, 0.0, 0.0, {}};
  for (int id = 0; id < 5; ++id) {
    base::Observation one;
    one.id = id;
    one.status = id == 3 ? base::ObservationStatus::kAmbiguous : base::ObservationStatus::kCoded;
    one.cov_px2.setIdentity();
    images[1].observations.push_back(one);
  }
  const std::string page = detection_report(images, {"overlay/a.png", "over\"lay&.png", ""}, synthetic_context("detect"));
  expect_sound(page);
  EXPECT_TRUE(tests::contains(page, "src=\"over&quot;lay&amp;.png\"")) << "src=\"over&quot;lay&amp;.png\"";
  EXPECT_TRUE(tests::contains(page, "4 different ids")) << "4 different ids";
  expect_sound(detection_report({}, {}, {}));
}

TEST(Markup, TheCheckerItselfSeesFaults) {
  EXPECT_EQ(markup_error("<p class=\"a\">x &amp; y<br/></p>"), std::nullopt);
  for (const char* bad :
       {"<p>", "<p></b>", "<p>a & b</p>", "<p>&nbsp;</p>", "<p a=\"1\" a=\"2\"></p>", "<p>a < b</p>", "<p a=1></p>"}) {
    EXPECT_NE(markup_error(bad), std::nullopt) << bad;
  }
}

TEST(Html, EscapeKeepsUtf8AndReplacesWhatIsNone) {
  EXPECT_EQ(detail::escape("\u00b5m \u2013 \U0001F4F7"), "\u00b5m \u2013 \U0001F4F7");
  EXPECT_EQ(detail::escape("a\xc3"), "a\uFFFD");
  EXPECT_EQ(detail::escape("\xed\xa0\x80"), "\uFFFD\uFFFD\uFFFD");  // a surrogate
  EXPECT_EQ(detail::escape("\xc0\x80"), "\uFFFD\uFFFD");            // an overlong zero
  EXPECT_EQ(detail::json_quoted("a\"\\</script>\n"), "\"a\\\"\\\\\\u003c/script\\u003e\\u000a\"");
}

}  // namespace
}  // namespace crosstie::report
