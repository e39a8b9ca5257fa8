// The result of stitch as JSON and back.

#include "base/stitching_document.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/npy.h"
#include "base/result_document.h"
#include "base/stitching_reader.h"
#include "tests/support/synthetic_stitching.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

void write(const Stitching& result, const std::filesystem::path& folder) {
  const ResultEnvelope envelope{"stitch", result.frame, {}, {}, {}};
  ASSERT_TRUE(write_json(folder / "result.json", result_json(envelope, {}, stitching_json(result))));
  ASSERT_TRUE(write_covariance(folder, {result.covariance, result.labels}));
}

TEST(StitchingDocument, KeepsItsKeys) {
  const nlohmann::ordered_json json = stitching_json(tests::synthetic_stitching());
  EXPECT_EQ(json["stations"][0]["machine_from_rig"].size(), 16U);
  EXPECT_EQ(json["stations"][0]["cov"].size(), 21U);
  EXPECT_EQ(json["stations"][0]["directions"].size(), 6U);
  EXPECT_EQ(json["stations"][0]["directions"][2]["name"], "radial");
  for (const char* source : {"markers", "reference", "axis", "surface"}) {
    EXPECT_TRUE(json["stations"][0]["directions"][2]["share"].contains(source));
  }
  for (const char* key : {"a", "b", "mean_mm", "sigma_mm", "normalised"}) EXPECT_TRUE(json["overlap"][0].contains(key)) << key;
  EXPECT_TRUE(json["drift"][1]["free_sigma_mm"][2].is_null()) << "nothing joins them: no number";
}

TEST(StitchingDocument, GivesStationsHeadAndCovarianceBack) {
  const tests::TemporaryFolder folder;
  const Stitching written = tests::synthetic_stitching();
  write(written, folder.path());
  const auto read = read_stitching(folder.path());
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->frame, "machine");
  EXPECT_EQ(read->segment.kind, written.segment.kind);
  ASSERT_EQ(read->stations.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_LT(difference(read->stations[k].machine_from_rig, written.stations[k].machine_from_rig).norm(), 1e-12);
    EXPECT_EQ(read->stations[k].cov, written.stations[k].cov);
    EXPECT_EQ(read->stations[k].axis_mm, written.stations[k].axis_mm);
    EXPECT_EQ(read->stations[k].directions[5].name, "yaw");
    EXPECT_EQ(read->stations[k].directions_in_machine, written.stations[k].directions_in_machine);
  }
  EXPECT_EQ(read->covariance, written.covariance);
  EXPECT_EQ(read->labels, written.labels);
  ASSERT_TRUE(read->head);
  EXPECT_EQ(read->head->left.parameters(), written.head->left.parameters());
  EXPECT_EQ(read->head->cov, written.head->cov);
  EXPECT_EQ(read->overlaps[1].b, 2);
  EXPECT_EQ(read->markers[0].stations, written.markers[0].stations);
  EXPECT_FALSE(read->markers[2].in_reference);
  EXPECT_EQ(read->machine_from_part->translation_mm, Eigen::Vector3d(1.0, 2.0, 3.0));
}

TEST(StitchingDocument, RefusesACovarianceThatIsNotItsOwn) {
  const tests::TemporaryFolder folder;
  write(tests::synthetic_stitching(), folder.path());
  ASSERT_TRUE(write_covariance(folder.path(), {Eigen::MatrixXd::Identity(2, 2), {"a [mm]", "b [mm]"}}));
  const auto read = read_stitching(folder.path());
  ASSERT_FALSE(read);
  EXPECT_NE(read.error().message.find("covariance"), std::string::npos);
}

}  // namespace
}  // namespace crosstie::base
