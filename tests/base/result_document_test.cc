#include "base/result_document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/table.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::HasSubstr;
using tests::TemporaryFolder;
using Json = nlohmann::ordered_json;

std::vector<std::string> keys_of(const Json& json) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : json.items()) keys.push_back(key);
  return keys;
}

/// The keys that docs/formats.md promises for every version.
void expect_keys(const Json& json, const std::vector<const char*>& promised) {
  for (const char* key : promised) EXPECT_TRUE(json.contains(key)) << key;
}

AdjustedNetwork some_network() {
  AdjustedNetwork network;
  network.datum = "inner constraints";
  network.sigma0 = 1.25;
  Camera camera = *Camera::nominal(LensModel::kOpenCv5, 640, 480, 800.0);
  camera.set_covariance(Eigen::MatrixXd::Identity(9, 9) * 0.25);
  network.cameras.push_back({"left", camera, true, 0.75, Eigen::VectorXd::Constant(9, std::nan(""))});
  network.cameras.back().significance_p(8) = 0.25;
  AdjustedImage image;
  image.name = "a";
  image.camera = "left";
  image.network_from_camera = {Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ())), {10, 20, 30}};
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) image.cov(i, j) = 10 * std::min(i, j) + std::max(i, j);
  }
  network.images.push_back(image);
  for (const int id : {11, 52}) {
    AdjustedPoint point;
    point.id = id;
    point.xyz_mm = {id + 0.1, 2.0 / 3.0, -1.0};
    point.cov_mm2 << 4, 1, 2, 1, 9, 3, 2, 3, 16;
    network.points.push_back(point);
  }
  AdjustedScaleBar bar;
  bar.bar.id_a = 11;
  bar.bar.id_b = 52;
  bar.bar.role = ScaleBarRole::kCheck;
  network.scale_bars.push_back(bar);
  network.rejected.push_back({"a", 72, "moved between images", 31.5});
  AdjustedObservation observation;
  observation.image = 0;
  observation.point = 1;
  observation.measured_px = {100.5, 200.25};
  observation.residual_px = {0.01, -0.02};
  network.residuals.push_back(observation);
  return network;
}

TEST(ResultDocument, EnvelopeComesFirst) {
  ResultEnvelope envelope;
  envelope.verb = "adjust";
  envelope.frame = "network";
  envelope.inputs = {{"images/a.png", "00ff"}};
  envelope.verdicts = {{"sigma0", 1.2, 1.5, "", "job", VerdictLevel::kWarning}};
  envelope.warnings = {{"few_rays", "7", "point 7 has two rays"}};
  const Json json = result_json(envelope, {{"max_residual_px", 0.5}}, {{"sigma0", 1.2}});
  const auto keys = keys_of(json);
  const std::vector<std::string> expected = {"format", "verb",    "version",  "unit",     "frame",
                                             "inputs", "options", "verdicts", "warnings", "sigma0"};
  EXPECT_EQ(keys, expected);
  EXPECT_EQ(json["format"], "crosstie-result/1");
  EXPECT_EQ(json["unit"], "mm");
  EXPECT_EQ(json["inputs"][0]["sha256"], "00ff");
  EXPECT_EQ(json["verdicts"][0]["level"], "WARNING");
  EXPECT_EQ(json["warnings"][0]["code"], "few_rays");
  EXPECT_EQ(result_json(envelope, nullptr, Json::object())["options"], Json::object());
}

TEST(ResultDocument, AdjustHasThePromisedKeys) {
  const Json json = network_json(some_network());
  expect_keys(json, {"datum", "sigma0", "sigma0_px", "observations", "unknowns", "conditions", "redundancy", "chi2_p",
                     "iterations", "points", "images", "cameras", "scale_bars", "rejected"});
  expect_keys(json, {"observed", "estimated", "last_step", "structural_rank", "rank"});
  EXPECT_EQ(json["cameras"][0]["coverage"], 0.75);
  ASSERT_EQ(json["cameras"][0]["significance_p"].size(), 9U);
  EXPECT_TRUE(json["cameras"][0]["significance_p"][7].is_null());
  EXPECT_EQ(json["cameras"][0]["significance_p"][8], 0.25);
  expect_keys(json["points"][0], {"max_px", "max_w", "least_redundancy"});
  expect_keys(json["points"][0], {"id", "kind", "xyz_mm", "cov_mm2", "rays", "angle_rad"});
  expect_keys(json["images"][0], {"name", "camera", "network_from_camera", "cov", "rms_px", "rays"});
  expect_keys(json["cameras"][0], {"name", "model", "params", "sigmas"});
  expect_keys(json["scale_bars"][0], {"a", "b", "length_mm", "measured_mm", "sigma_mm", "role"});
  expect_keys(json["rejected"][0], {"image", "id", "reason", "w"});
  EXPECT_EQ(json["points"][0]["cov_mm2"], Json::parse("[4.0, 1.0, 2.0, 9.0, 3.0, 16.0]")) << "the upper triangle, row by row";
  EXPECT_EQ(json["images"][0]["cov"].size(), 21U);
  EXPECT_EQ(json["images"][0]["cov"][6], 11.0) << "the second row begins with its diagonal";
  const Json& m = json["images"][0]["network_from_camera"];
  ASSERT_EQ(m.size(), 16U);
  EXPECT_NEAR(m[1].get<double>(), -std::sin(0.5), 1e-15) << "row by row";
  EXPECT_EQ(m[3], 10.0);
  EXPECT_EQ(m[15], 1.0);
  EXPECT_EQ(json["cameras"][0]["params"].size(), 9U);
  EXPECT_EQ(json["cameras"][0]["sigmas"][8], 0.5);
  EXPECT_EQ(json["scale_bars"][0]["role"], "check");
}

TEST(ResultDocument, PointsComeBackWithTheirCovariances) {
  const TemporaryFolder folder;
  ResultEnvelope envelope;
  envelope.verb = "adjust";
  envelope.frame = "network";
  const AdjustedNetwork network = some_network();
  const Json good = result_json(envelope, {}, network_json(network));
  ASSERT_TRUE(write_json(folder / "result.json", good));
  const auto points = points_from_network_json(folder / "result.json");
  ASSERT_TRUE(points) << points.error().message;
  ASSERT_EQ(points->points.size(), 2U);
  EXPECT_EQ(points->points[1].xyz_mm, network.points[1].xyz_mm) << "bit by bit";
  EXPECT_EQ(*points->points[1].cov_mm2, network.points[1].cov_mm2);

  const auto refused = [&](const std::function<void(Json&)>& damage, const char* message) {
    Json json = good;
    damage(json);
    EXPECT_TRUE(write_json(folder / "bad.json", json));
    const auto result = points_from_network_json(folder / "bad.json");
    ASSERT_FALSE(result) << message;
    EXPECT_EQ(result.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(result.error().message, HasSubstr(message));
  };
  refused([](Json& j) { j["format"] = "crosstie-result/2"; }, "format");
  refused([](Json& j) { j["verb"] = "detect"; }, "not the result of adjust");
  refused([](Json& j) { j["unit"] = "m"; }, "unit");
  refused([](Json& j) { j.erase("points"); }, "no list of points");
  refused([](Json& j) { j["points"][1]["xyz_mm"] = Json::parse("[1, 2]"); }, "point 2");
  refused([](Json& j) { j["points"][1]["xyz_mm"][0] = nullptr; }, "point 2");
  refused([](Json& j) { j["points"][1]["cov_mm2"] = "none"; }, "point 2");
  refused([](Json& j) { j["points"][1]["id"] = 1.5; }, "point 2");
  refused([](Json& j) { j["points"][1]["id"] = -1; }, "point 2");
  refused([](Json& j) { j["points"][1]["id"] = 11; }, "occurs twice");
  refused([](Json& j) { j = Json::array(); }, "no result of crosstie");
}

TEST(ResultDocument, VerifyHasThePromisedKeys) {
  Verification verification;
  verification.points.resize(3);
  verification.points[2].used = false;
  verification.lengths.push_back({11, 52, 1000.0, 1000.02, 0.01, 0.05});
  const Json json = verification_json(verification);
  expect_keys(json, {"count", "rms_mm", "max_mm", "rms3d_mm", "normalised_rms", "transform", "lengths"});
  EXPECT_EQ(json["count"], 2);
  EXPECT_EQ(json["rms_mm"].size(), 3U);
  EXPECT_EQ(json["transform"].size(), 16U);
  expect_keys(json["lengths"][0], {"a", "b", "nominal_mm", "measured_mm", "error_mm", "mpe_mm"});
  EXPECT_NEAR(json["lengths"][0]["error_mm"].get<double>(), 0.02, 1e-12);
}

std::vector<ImageObservations> some_observations() {
  std::vector<ImageObservations> images(2);
  images[0].image = "b, left";
  images[0].family = "ring10";
  images[1].image = "a";
  images[1].family = "ring10";
  for (int i = 0; i < 5; ++i) {
    Observation o;
    o.status = static_cast<ObservationStatus>(i);
    o.id = o.status == ObservationStatus::kUncoded ? kNoId : i + 3;
    o.centre_px = {100.0 / 3.0 + i, 7.0};
    o.cov_px2 << 4e-4, 1e-5, 1e-5, 3e-4;
    o.semi_major_px = 8.5;
    o.semi_minor_px = 6.5;
    o.angle_rad = -0.25;
    o.margin = 0.75;
    images[static_cast<std::size_t>(i % 2)].observations.push_back(o);
  }
  return images;
}

TEST(ResultDocument, DetectCountsWhatWasFound) {
  const Json json = detection_json(some_observations(), false);
  expect_keys(json["images"][0], {"name", "width", "height", "count", "saturated_fraction", "dark_fraction", "millis"});
  EXPECT_EQ(json["images"][0]["count"], 1);
  EXPECT_TRUE(json["images"][0]["millis"].is_null());
  EXPECT_TRUE(detection_json(some_observations(), true)["images"][0]["millis"].is_number());
}

TEST(ResultDocument, ObservationsComeBackBitByBit) {
  const TemporaryFolder folder;
  const auto images = some_observations();
  ASSERT_TRUE(write_observations(folder / "observations.csv", images));
  EXPECT_TRUE(tests::read_all(folder / "observations.csv")
                  .starts_with("image,family,id,x_px,y_px,cov_xx,cov_xy,cov_yy,a_px,b_px,angle_rad,margin,status\n"));
  const auto again = read_observations(folder / "observations.csv");
  ASSERT_TRUE(again) << again.error().message;
  ASSERT_EQ(again->size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ((*again)[i].image, images[i].image);
    ASSERT_EQ((*again)[i].observations.size(), images[i].observations.size());
    for (std::size_t k = 0; k < images[i].observations.size(); ++k) {
      const Observation& a = images[i].observations[k];
      const Observation& b = (*again)[i].observations[k];
      EXPECT_EQ(a.id, b.id);
      EXPECT_EQ(a.status, b.status);
      EXPECT_EQ(a.centre_px, b.centre_px);
      EXPECT_EQ(a.cov_px2, b.cov_px2);
      EXPECT_EQ(a.semi_minor_px, b.semi_minor_px);
      EXPECT_EQ(a.angle_rad, b.angle_rad);
      EXPECT_EQ(a.margin, b.margin);
    }
  }
}

TEST(ResultDocument, DamagedObservationsAreRefused) {
  const TemporaryFolder folder;
  const std::string header = "image,family,id,x_px,y_px,cov_xx,cov_xy,cov_yy,a_px,b_px,angle_rad,margin,status\n";
  const std::pair<std::string, const char*> cases[] = {
      {header + "a,ring10,1,1,2,1,0,1,8,6,0,1,fine\n", "o.csv:2: unknown status"},
      {header + "a,ring10,-1,1,2,1,0,1,8,6,0,1,coded\n", "o.csv:2: a coded marker without an id"},
      {header + "a,ring10,-2,1,2,1,0,1,8,6,0,1,uncoded\n", "o.csv:2: id -2"},
      {header + "a,ring10,1,1,2,1,5,1,8,6,0,1,coded\n", "semidefinite"},
      {header + "a,ring10,1,1,2,1,0,1,8,6,0,1,coded\na,aicon14,2,1,2,1,0,1,8,6,0,1,coded\n", "two families"},
      {header + "a,ring10,1,nan,2,1,0,1,8,6,0,1,coded\n", "o.csv:2: x_px"},
      {"image,id\na,1\n", "family is missing"},
  };
  for (const auto& [text, message] : cases) {
    const auto images = read_observations(folder.write("o.csv", text));
    ASSERT_FALSE(images) << text;
    EXPECT_THAT(images.error().message, HasSubstr(message));
  }
}

TEST(ResultDocument, ResidualsAreATable) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_residuals(folder / "residuals.csv", some_network()));
  const auto table = read_table(folder / "residuals.csv");
  ASSERT_TRUE(table) << table.error().message;
  ASSERT_EQ(table->rows.size(), 1U);
  EXPECT_EQ(table->rows[0][0], "a");
  EXPECT_EQ(table->rows[0][1], "52");
  EXPECT_EQ(*table->number(0, *table->column("residual_y_px")), -0.02);
}

}  // namespace
}  // namespace crosstie::base
