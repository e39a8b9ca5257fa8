#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/calibration_reader.h"
#include "base/json_file.h"
#include "base/npy.h"
#include "base/result_document.h"
#include "tests/support/synthetic_calibration.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using nlohmann::ordered_json;
using testing::HasSubstr;

void write(const std::filesystem::path& folder, const Calibration& calibration) {
  const ResultEnvelope envelope{"calibrate", "rig", {}, {}, calibration.warnings};
  ASSERT_TRUE(write_json(folder / "result.json", result_json(envelope, ordered_json::object(), calibration_json(calibration))));
  ASSERT_TRUE(write_covariance(folder, {calibration.covariance, calibration.labels}));
}

TEST(CalibrationDocument, KeepsTheKeysThatOthersRead) {
  const ordered_json json = calibration_json(tests::synthetic_calibration());
  const ordered_json& camera = json.at("cameras").at(0);
  for (const char* key : {"name", "model", "params", "sigmas", "rms_px", "rms_heldout_px", "views"}) {
    EXPECT_TRUE(camera.contains(key)) << key;
  }
  EXPECT_EQ(camera.at("model"), "LENSMODEL_OPENCV5");
  EXPECT_EQ(camera.at("params").size(), 9U);
  EXPECT_EQ(json.at("rig").at("right_from_left").size(), 16U);
  EXPECT_EQ(json.at("rig").at("cov").size(), 21U) << "the upper triangle";
  EXPECT_EQ(json.at("rig").at("right_from_left").at(3), -119.3) << "row by row";
  EXPECT_EQ(json.at("board").at("certificate").at("valid_until"), "2027-03-01");
}

TEST(CalibrationDocument, ACameraWithoutARigAndWithoutValidationHasNulls) {
  Calibration calibration = tests::synthetic_calibration();
  calibration.rig.reset();
  calibration.validation.reset();
  calibration.second_opinion.reset();
  calibration.cameras[0].rms_heldout_px = 0.0;
  const ordered_json json = calibration_json(calibration);
  EXPECT_TRUE(json.at("rig").is_null());
  EXPECT_TRUE(json.at("validation").is_null());
  EXPECT_TRUE(json.at("second_opinion").is_null());
  EXPECT_TRUE(json.at("cameras").at(0).at("rms_heldout_px").is_null());
}

TEST(CalibrationReader, ReadsBackWhatLaterVerbsNeed) {
  const tests::TemporaryFolder folder;
  const Calibration written = tests::synthetic_calibration();
  write(folder.path(), written);
  const auto read = read_calibration(folder.path());
  ASSERT_TRUE(read) << read.error().message;
  ASSERT_EQ(read->cameras.size(), 2U);
  for (std::size_t c = 0; c < 2; ++c) {
    EXPECT_EQ(read->cameras[c].name, written.cameras[c].name);
    EXPECT_EQ(read->cameras[c].camera.parameters(), written.cameras[c].camera.parameters());
    EXPECT_EQ(read->cameras[c].camera.covariance(), written.cameras[c].camera.covariance());
    EXPECT_EQ(read->cameras[c].temperature_c, 31.5);
    for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(640, 512), Eigen::Vector2d(3, 3), Eigen::Vector2d(1270, 40)}) {
      EXPECT_EQ(read->cameras[c].area.contains(pixel), written.cameras[c].area.contains(pixel));
    }
  }
  ASSERT_TRUE(read->rig);
  EXPECT_TRUE(read->rig->right_from_left.matrix().isApprox(written.rig->right_from_left.matrix(), 1e-14));
  EXPECT_EQ(read->rig->cov, written.rig->cov);
  EXPECT_EQ(read->board.board.certificate.number, "B-17");
  EXPECT_EQ(read->covariance, written.covariance);
  EXPECT_EQ(read->labels, written.labels);
}

TEST(CalibrationReader, JoinsTheCovarianceOfLensesAndRig) {
  const Calibration calibration = tests::synthetic_calibration();
  const auto joint = joint_covariance(calibration, {"right", "left"}, true);
  ASSERT_TRUE(joint) << joint.error().message;
  ASSERT_EQ(joint->rows(), 24);
  const Eigen::MatrixXd of_right = joint->topLeftCorner(9, 9);
  const Eigen::MatrixXd of_left = joint->block(9, 9, 9, 9);
  const Eigen::MatrixXd of_rig = joint->bottomRightCorner(6, 6);
  EXPECT_EQ(of_right, calibration.cameras[1].camera.covariance());
  EXPECT_EQ(of_left, calibration.cameras[0].camera.covariance());
  EXPECT_EQ(of_rig, calibration.rig->cov);
  EXPECT_EQ((*joint)(9, 21), calibration.covariance(0, 21)) << "focal length of the left camera with the rig's x";
  EXPECT_THAT(joint_covariance(calibration, {"middle"}, false).error().message, HasSubstr("no camera middle"));
}

TEST(CalibrationReader, RefusesWhatIsNoCalibration) {
  const tests::TemporaryFolder folder;
  const Calibration calibration = tests::synthetic_calibration();
  EXPECT_EQ(read_calibration(folder.path()).error().code, ErrorCode::kFileSystem);
  write(folder.path(), calibration);
  ordered_json json = *read_json(folder / "result.json");
  const auto refusal = [&](const ordered_json& changed) -> std::string {
    EXPECT_TRUE(write_json(folder / "result.json", changed));
    const auto read = read_calibration(folder.path());
    if (read) return "";
    EXPECT_EQ(read.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(read.error().message, HasSubstr("result.json"));
    return read.error().message;
  };
  ordered_json changed = json;
  changed["verb"] = "adjust";
  EXPECT_THAT(refusal(changed), HasSubstr("not the result of calibrate"));
  changed = json;
  changed["cameras"][0]["params"].push_back(1.0);
  EXPECT_THAT(refusal(changed), HasSubstr("9 numbers"));
  changed = json;
  changed["rig"]["left"] = "right";
  EXPECT_THAT(refusal(changed), HasSubstr("rig"));
  changed = json;
  changed["cameras"][0]["area"]["counts"][3] = -1;
  EXPECT_THAT(refusal(changed), HasSubstr("count"));
  changed = json;
  changed["board"]["certificate"]["valid_until"] = "soon";
  EXPECT_THAT(refusal(changed), HasSubstr("no date"));
  EXPECT_TRUE(write_json(folder / "result.json", json));
  ASSERT_TRUE(write_covariance(folder.path(), {Eigen::MatrixXd::Identity(1, 1), {"camera other fx [px]"}}));
  EXPECT_THAT(read_calibration(folder.path()).error().message, HasSubstr("covariance.json names no parameter of camera left"));
}

}  // namespace
}  // namespace crosstie::base
