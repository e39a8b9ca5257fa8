// Chains of cameras as kalibr writes them.
#include "base/kalibr.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/camera_file.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using crosstie::tests::TemporaryFolder;
using testing::HasSubstr;

/// The form of kalibr's own example of a stereo pair, with numbers of ours.
const std::string kChain = R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.2834, 0.0739, 0.00019, 1.76e-05]
  distortion_model: radtan
  intrinsics: [458.654, 457.296, 367.215, 248.375]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cn_cnm1:
  - [0.8, 0.0, 0.6, -0.11]
  - [0.0, 1.0, 0.0, 0.0004]
  - [-0.6, 0.0, 0.8,
     -0.0008]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: pinhole
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [457.587, 456.134, 379.999, 255.238]
  resolution: [752, 480]
  rostopic: /cam1/image_raw
)";

std::string refusal(const std::string& from, const std::string& to) {
  std::string text = kChain;
  const std::size_t at = text.find(from);
  if (at == std::string::npos) return "the chain does not hold what is to be changed";
  text.replace(at, from.size(), to);
  const auto chain = parse_kalibr_chain("chain.yaml", text);
  if (chain) return "";
  EXPECT_EQ(chain.error().code, ErrorCode::kBadInput);
  return chain.error().message;
}

TEST(Kalibr, ReadsCamerasAndTheirPoses) {
  const auto chain = parse_kalibr_chain("chain.yaml", kChain);
  ASSERT_TRUE(chain) << chain.error().message;
  ASSERT_EQ(chain->size(), 2U);
  const KalibrCamera& left = (*chain)[0];
  EXPECT_EQ(left.name, "cam0");
  EXPECT_EQ(left.camera.model(), LensModel::kOpenCv4);
  EXPECT_EQ(left.camera.width_px(), 752);
  EXPECT_FALSE(left.camera_from_previous);
  Eigen::VectorXd expected(8);
  expected << 458.654, 457.296, 367.215, 248.375, -0.2834, 0.0739, 0.00019, 1.76e-05;
  EXPECT_EQ(left.camera.parameters(), expected);
  // radtan by hand, of the point (0.2, -0.1, 1).
  const double x = 0.2;
  const double y = -0.1;
  const double r2 = x * x + y * y;
  const double radial = 1.0 - 0.2834 * r2 + 0.0739 * r2 * r2;
  const double u = x * radial + 2.0 * 0.00019 * x * y + 1.76e-05 * (r2 + 2.0 * x * x);
  const auto pixel = left.camera.project({200.0, -100.0, 1000.0});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x(), 458.654 * u + 367.215, 1e-9);
  const KalibrCamera& right = (*chain)[1];
  EXPECT_EQ(right.camera.model(), LensModel::kPinhole);
  ASSERT_TRUE(right.camera_from_previous);
  const Eigen::Vector3d moved = *right.camera_from_previous * Eigen::Vector3d(0.0, 0.0, 1000.0);
  EXPECT_NEAR((moved - Eigen::Vector3d(600.0 - 110.0, 0.4, 800.0 - 0.8)).norm(), 0.0, 1e-9);
}

TEST(Kalibr, IsACameraFile) {
  const TemporaryFolder folder;
  const auto path = folder.write("camchain.yaml", kChain);
  EXPECT_EQ(read_named_camera(path, "cam1")->model(), LensModel::kPinhole);
  const auto several = read_camera(path);
  ASSERT_FALSE(several);
  EXPECT_THAT(several.error().message, HasSubstr("cam0, cam1"));
  EXPECT_FALSE(read_named_camera(path, "cam2"));
  const auto alone = folder.write("one.yaml", kChain.substr(0, kChain.find("cam1:")));
  EXPECT_EQ(read_camera(alone)->focal_px().x(), 458.654);
}

TEST(Kalibr, RefusesWhatItWouldHaveToGuess) {
  EXPECT_THAT(refusal("radtan", "equidistant"), HasSubstr("equidistant"));
  EXPECT_THAT(refusal("pinhole", "omni"), HasSubstr("omni"));
  EXPECT_THAT(refusal("[752, 480]", "[752]"), HasSubstr("chain.yaml:7: cam0: resolution takes 2"));
  EXPECT_THAT(refusal("[752, 480]", "[752.5, 480]"), HasSubstr("752.5"));
  EXPECT_THAT(refusal("[458.654,", "[nan,"), HasSubstr("intrinsics"));
  EXPECT_THAT(refusal("[458.654,", "[-458.654,"), HasSubstr("cam0"));
  EXPECT_THAT(refusal("  intrinsics", "  intrinsic"), HasSubstr("intrinsics is missing"));
  EXPECT_THAT(refusal("[0.8, 0.0, 0.6,", "[0.9, 0.0, 0.6,"), HasSubstr("no rotation"));
  EXPECT_THAT(refusal("cam1:", "cam0:"), HasSubstr("cam0 occurs twice"));
  EXPECT_THAT(refusal("[0.0, 0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0, 1.0"), HasSubstr("chain.yaml:"));
}

}  // namespace
}  // namespace crosstie::base
