// The result of commission as JSON and back.

#include "base/commissioning_reader.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/npy.h"
#include "base/result_document.h"
#include "base/sphere_list.h"
#include "tests/support/synthetic_commissioning.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

void write(const Commissioning& result, const std::filesystem::path& folder) {
  const ResultEnvelope envelope{"commission", "machine", {}, {}, result.warnings};
  ASSERT_TRUE(write_json(folder / "result.json", result_json(envelope, {}, commissioning_json(result))));
  ASSERT_TRUE(write_covariance(folder, {result.covariance, result.labels}));
}

TEST(CommissioningDocument, KeepsItsKeys) {
  const nlohmann::ordered_json json = commissioning_json(tests::synthetic_commissioning());
  EXPECT_EQ(json["rig"]["right_from_left"].size(), 16U);
  EXPECT_EQ(json["rig"]["cov"].size(), 21U);
  EXPECT_EQ(json["axis"]["direction_in_machine"].size(), 3U);
  EXPECT_EQ(json["axis"]["direction_cov"].size(), 6U);
  EXPECT_EQ(json["axis"]["scale_ppm"], 48.0);
  EXPECT_EQ(json["axis"]["terms"].size(), 6U);
  EXPECT_EQ(json["axis"]["terms"][0]["coefficients"][0], 0.0) << "what takes no part is 0";
  EXPECT_EQ(json["axis"]["terms"][2]["coefficients"][0], -0.0004) << "what is not significant is drawn to 0";
  EXPECT_EQ(json["axis"]["terms"][2]["significant"], false);
  EXPECT_EQ(json["axis"]["terms"][1]["significant"], true);
  EXPECT_EQ(json["machine_from_rig_at_zero"].size(), 16U);
  EXPECT_EQ(json["cov"].size(), 21U);
  EXPECT_EQ(json["spheres"].size(), 4U);
  EXPECT_EQ(json["checked_at"][2]["machine_from_rig"].size(), 16U);
  for (const char* key : {"residual_mm", "sigma_mm"}) EXPECT_EQ(json["spheres"][0][key].size(), 3U);
}

TEST(CommissioningDocument, GivesTheHeadAtAnyReadingBackAsItWas) {
  const tests::TemporaryFolder folder;
  const Commissioning written = tests::synthetic_commissioning();
  write(written, folder.path());
  const auto read = read_commissioning(folder.path());
  ASSERT_TRUE(read) << read.error().message;
  for (const double reading : {-100.0, 0.0, 123.4, 900.0}) {
    const auto before = written.frame.at(reading);
    const auto after = read->frame.at(reading);
    ASSERT_TRUE(before && after);
    EXPECT_LT(difference(before->machine_from_rig, after->machine_from_rig).norm(), 1e-12);
    EXPECT_LT((before->cov - after->cov).norm(), 1e-12 * before->cov.norm());
    EXPECT_LT((before->stop_cov - after->stop_cov).norm(), 1e-12 * before->stop_cov.norm());
  }
  EXPECT_TRUE(read->frame.at(900.9)) << "a stop does not repeat its reading to the last digit: 0.1 % of the travel";
  EXPECT_TRUE(read->frame.at(-100.9));
  EXPECT_FALSE(read->frame.at(901.1)) << "nothing is known beyond the travel";
  EXPECT_FALSE(read->frame.at(-101.1));
  EXPECT_EQ(read->head.cov, written.head.cov);
  EXPECT_EQ(read->head.left.parameters(), written.head.left.parameters());
  EXPECT_EQ(read->head.temperature_c, written.head.temperature_c);
  EXPECT_EQ(read->labels, written.labels);
  ASSERT_EQ(read->markers.size(), written.markers.size());
  EXPECT_EQ(read->markers[3].xyz_mm, written.markers[3].xyz_mm);
}

TEST(CommissioningDocument, OtherResultsAreRefused) {
  const tests::TemporaryFolder folder;
  const ResultEnvelope envelope{"adjust", "machine", {}, {}, {}};
  ASSERT_TRUE(write_json(folder / "result.json", result_json(envelope, {}, {})));
  const auto read = read_commissioning(folder.path());
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().code, ErrorCode::kBadInput);
}

TEST(SphereList, ReadsBallsWithDiametersAndMasks) {
  const tests::TemporaryFolder folder;
  folder.write("cross.csv",
               "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm,diameter_mm\n2,1,2,3,0.01,0.01,0.02,38.1\n1,4,5,6,0.01,0.01,"
               "0.02,30\n");
  const auto spheres = read_reference_spheres(folder / "cross.csv");
  ASSERT_TRUE(spheres) << spheres.error().message;
  ASSERT_EQ(spheres->size(), 2U);
  EXPECT_EQ((*spheres)[0].id, 1);
  EXPECT_EQ((*spheres)[0].diameter_mm, 30.0);
  EXPECT_EQ((*spheres)[1].diameter_mm, 38.1);
  folder.write("probe.csv", "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm,axes\n1,1,2,3,0.01,0.01,0.01,yz\n");
  const auto probed = read_probed_spheres(folder / "probe.csv");
  ASSERT_TRUE(probed) << probed.error().message;
  EXPECT_EQ((*probed)[0].axes, (std::array{false, true, true}));
  folder.write("hits.csv", "sphere,x_mm,y_mm,z_mm\n7,0,0,1\n3,1,0,0\n7,0,1,0\n");
  const auto hits = read_probe_hits(folder / "hits.csv");
  ASSERT_TRUE(hits) << hits.error().message;
  ASSERT_EQ(hits->size(), 2U);
  EXPECT_EQ((*hits)[1].id, 7);
  EXPECT_EQ((*hits)[1].tips_mm.size(), 2U);
}

TEST(SphereList, WhatIsWrongIsNamedWithItsLine) {
  const tests::TemporaryFolder folder;
  const auto refused = [&](const std::string& text, const std::string& part) {
    folder.write("s.csv", text);
    const auto spheres = read_reference_spheres(folder / "s.csv");
    ASSERT_FALSE(spheres) << text;
    EXPECT_EQ(spheres.error().code, ErrorCode::kBadInput);
    EXPECT_NE(spheres.error().message.find(part), std::string::npos) << spheres.error().message;
  };
  refused("id,x_mm,y_mm,z_mm\n1,2,3,4\n", "no sigmas");
  refused("id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm,diameter_mm\n1,2,3,4,0.1,0.1,0.1,-3\n", ":2:");
  refused("id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n", "no sphere");
  folder.write("h.csv", "id,x_mm,y_mm,z_mm\n1,2,3,4\n");
  const auto hits = read_probe_hits(folder / "h.csv");
  ASSERT_FALSE(hits);
  EXPECT_NE(hits.error().message.find("column sphere"), std::string::npos) << hits.error().message;
}

}  // namespace
}  // namespace crosstie::base
