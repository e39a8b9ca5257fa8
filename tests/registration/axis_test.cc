// Stations on a commissioned axis: head and frame are wrong by what their covariance allows, the same for all stations; the places of all
// stations must be wrong by what the result says.

#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "math/distributions.h"
#include "registration/merge.h"
#include "registration/stitch.h"
#include "tests/registration/synthetic_shell.h"
#include "tests/support/normalised_square.h"

namespace crosstie::registration {
namespace {

constexpr int kStations = 4;

CommissionedHead make_head() {
  const auto camera = base::Camera::nominal(base::LensModel::kPinhole, 2448, 2048, 1700.0);
  EXPECT_TRUE(camera);
  CommissionedHead head{{.left = *camera,
                         .right = *camera,
                         .right_from_left = {Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())), {}}},
                        {},
                        {}};
  head.head.right_from_left.translation_mm = -(head.head.right_from_left.rotation * Eigen::Vector3d(800.0, 0.0, 0.0));
  base::LinearAxis& axis = head.frame.axis;
  axis.from_mm = 0.0;
  axis.to_mm = 1500.0;
  axis.stop_sigma_mm = 0.01;
  axis.stop_sigma_rad = 1e-5;
  axis.reading_sigma_mm = 0.005;
  head.frame.machine_from_rig_at_middle = {Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX())),
                                           {350.0, 0.0, 2150.0 + 1300.0}};
  head.frame.across << 0.0, 0.0, 1.0, 0.0, 0.0, 1.0;
  const Eigen::Index parameters = head.head.parameter_count();
  Eigen::VectorXd sigma(parameters + 9);
  sigma << Eigen::VectorXd::Constant(parameters - 6, 0.08), Eigen::Vector3d::Constant(1.5e-5), Eigen::Vector3d::Constant(0.02),
      Eigen::Vector3d::Constant(2e-5), Eigen::Vector3d::Constant(0.04), 1.5e-5, 1.5e-5, 12.0;
  // Correlated throughout, as a commissioning's are.
  Eigen::MatrixXd correlation = Eigen::MatrixXd::Identity(sigma.size(), sigma.size());
  for (Eigen::Index i = 0; i < sigma.size(); ++i) {
    for (Eigen::Index k = 0; k < sigma.size(); ++k)
      correlation(i, k) = (i == k ? 0.6 : 0.0) + 0.4 * (i % 2 == k % 2 ? 1.0 : -1.0);
  }
  head.cov = sigma.asDiagonal() * correlation * sigma.asDiagonal();
  head.head.cov = head.cov.topLeftCorner(parameters, parameters);
  head.frame.cov = head.cov.bottomRightCorner(9, 9);
  return head;
}

/// What the commissioned head makes of the pixels in which the true one sees a point: of a scan the place on the left ray that is nearest to the
/// right one, of a marker the middle between both rays.
std::optional<Eigen::Vector3d> as_measured(const base::Head& stated, const base::Head& truth, const Eigen::Vector3d& p_in_rig,
                                           bool marker) {
  const auto left = truth.left.project(p_in_rig);
  const auto right = truth.right.project(truth.right_from_left * p_in_rig);
  if (!left || !right) return {};
  const auto a = stated.left.unproject(*left);
  const auto ray = stated.right.unproject(*right);
  if (!a || !ray) return {};
  const base::Pose rig_from_right = stated.right_from_left.inverse();
  const Eigen::Vector3d b = rig_from_right.rotation * *ray;
  const Eigen::Vector3d& c = rig_from_right.translation_mm;
  const double ab = a->dot(b);
  const Eigen::Vector3d on_left = (a->dot(c) - ab * b.dot(c)) / (1.0 - ab * ab) * *a;
  if (!marker) return on_left;
  return Eigen::Vector3d(0.5 * (on_left + c + (ab * a->dot(c) - b.dot(c)) / (1.0 - ab * ab) * b));
}

struct Travel {
  std::vector<base::Pose> truth;
  base::Head true_head;
  StitchInput input;
  std::vector<base::Cloud> clouds;
};

Travel make_travel(std::uint64_t seed, const CommissionedHead& stated, int points) {
  const tests::Shell shell;
  tests::Scanner scanner(seed);
  const Eigen::MatrixXd root = stated.cov.llt().matrixL();
  Eigen::VectorXd draw(root.rows());
  for (double& value : draw) value = scanner.normal();
  const Eigen::VectorXd error = root * draw;
  const Eigen::Index lens = base::parameter_count(stated.head.left.model());
  Travel travel{{}, stated.head, {}, {}};
  travel.true_head.left =
      *base::Camera::make(stated.head.left.model(), 2448, 2048, stated.head.left.parameters() + error.head(lens));
  travel.true_head.right =
      *base::Camera::make(stated.head.right.model(), 2448, 2048, stated.head.right.parameters() + error.segment(lens, lens));
  travel.true_head.right_from_left = base::perturbed(stated.head.right_from_left, error.segment<6>(2 * lens));
  travel.input.commissioned = stated;
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < 30; ++i) places.push_back(shell.at(scanner.uniform(150.0, 2150.0), scanner.uniform(-180.0, 180.0)));
  for (int k = 0; k < kStations; ++k) {
    StationScan& station = travel.input.stations.emplace_back();
    station.name = fmt::format("x{}", k);
    station.axis_mm = 500.0 * k;
    const auto at = stated.frame.at(*station.axis_mm);
    EXPECT_TRUE(at);
    Eigen::Matrix<double, 6, 1> stop;
    for (double& value : stop) value = scanner.normal();
    const base::Matrix6d stop_root = (at->stop_cov + 1e-18 * base::Matrix6d::Identity()).llt().matrixL();
    travel.truth.push_back(
        base::perturbed(at->machine_from_rig, stated.frame.jacobian(*station.axis_mm) * error.tail<9>() + stop_root * stop));
    const base::Pose& pose = travel.truth.back();
    const tests::Window window{.along_mm = pose.translation_mm.x() + 400.0, .length_mm = 700.0, .height_mm = 400.0};
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (std::abs(places[i].x() - window.along_mm) > 340.0) continue;
      const auto seen = as_measured(stated.head, travel.true_head, pose.inverse() * places[i], true);
      if (seen)
        station.markers.push_back({static_cast<int>(i), *seen + scanner.normal3(0.01), 1e-4 * Eigen::Matrix3d::Identity()});
    }
    base::Cloud cloud = scanner.cloud(shell, window, pose, points, 0.02);
    for (Eigen::Vector3d& point : cloud.points)
      point = as_measured(stated.head, travel.true_head, point, false).value_or(point);
    cloud.fields.push_back({"sigma_mm", std::vector<double>(cloud.points.size(), 0.02)});
    auto surface = Surface::make(cloud);
    EXPECT_TRUE(surface) << surface.error().message;
    station.surface = *std::move(surface);
    travel.clouds.push_back(std::move(cloud));
  }
  return travel;
}

TEST(Axis, SharedErrorsOfHeadAndFrameNeverAverageDown) {
  const bool study = std::getenv("CROSSTIE_STUDY") != nullptr;
  const int draws = study ? 300 : 25;
  const CommissionedHead stated = make_head();
  double joint = 0.0;
  double head = 0.0;
  double merged = 0.0;
  double cells = 0.0;
  double stated_share = 0.0;
  for (int seed = 1; seed <= draws; ++seed) {
    const Travel travel = make_travel(static_cast<std::uint64_t>(seed), stated, 1000);
    const auto result = stitch(travel.input);
    ASSERT_TRUE(result) << seed << ": " << result.error().message;
    EXPECT_EQ(result->frame, "machine");
    Eigen::VectorXd error(6 * kStations);
    for (int k = 0; k < kStations; ++k) {
      error.segment<6>(6 * k) = base::difference(result->stations[static_cast<std::size_t>(k)].machine_from_rig,
                                                 travel.truth[static_cast<std::size_t>(k)]);
    }
    joint += tests::normalised_square(error, result->covariance.topLeftCorner(error.size(), error.size()));
    const Eigen::Index lens = base::parameter_count(stated.head.left.model());
    Eigen::VectorXd off(2 * lens + 6);
    off << travel.true_head.left.parameters() - result->head->left.parameters(),
        travel.true_head.right.parameters() - result->head->right.parameters(),
        base::difference(result->head->right_from_left, travel.true_head.right_from_left);
    head += tests::normalised_square(off, result->head->cov);
    stated_share += result->stations[1].directions[2].share.axis + result->stations[1].directions[2].share.calibration;
    if (seed > 20) continue;
    // The merged cloud: its points lie on the shell to within their covariance.
    CloudMerger merger(*result, {.cell_mm = 20.0}, stated.head);
    for (int k = 0; k < kStations; ++k) ASSERT_TRUE(merger.add(k, travel.clouds[static_cast<std::size_t>(k)]));
    const base::Cloud cloud = merger.finish();
    for (std::size_t i = 0; i < cloud.points.size(); i += 50) {
      const Eigen::Vector3d radial = Eigen::Vector3d(0.0, cloud.points[i].y(), cloud.points[i].z());
      merged += std::pow(radial.norm() - 2150.0, 2) / radial.normalized().dot(cloud.cov_mm2[i] * radial.normalized());
      cells += 1.0;
    }
  }
  const Eigen::Index parameters = stated.head.parameter_count();
  std::printf(
      "axis: mean square of all poses %.1f of %d, of the head %.1f of %d, of merged points %.2f; axis and calibration make "
      "%.0f %% of "
      "the radial variance\n",
      joint / draws, 6 * kStations, head / draws, static_cast<int>(parameters), merged / cells, 100.0 * stated_share / draws);
  EXPECT_GT(joint, math::chi_square_quantile(0.0005, 6.0 * kStations * draws));
  EXPECT_LT(joint, math::chi_square_quantile(0.9995, 6.0 * kStations * draws));
  EXPECT_GT(head, math::chi_square_quantile(0.0005, static_cast<double>(parameters) * draws));
  EXPECT_LT(head, math::chi_square_quantile(0.9995, static_cast<double>(parameters) * draws));
  EXPECT_GT(merged / cells, 0.5) << "points of one draw share their error: a factor of two is what 20 draws tell";
  EXPECT_LT(merged / cells, 2.0);
}

TEST(Axis, AStationWithoutMarkersOrOverlapStandsOnTheAxis) {
  const CommissionedHead stated = make_head();
  Travel travel = make_travel(1, stated, 1500);
  travel.input.stations[3].markers.clear();
  travel.input.stations.erase(travel.input.stations.begin() + 2);
  const auto result = stitch(travel.input);
  ASSERT_TRUE(result) << result.error().message;
  const base::StitchedStation& last = result->stations[2];
  EXPECT_GT(last.directions[0].share.axis, 0.8) << "the rest is what the others tell of the frame on which it stands";
  const base::HeadPose at = *stated.frame.at(1500.0);
  EXPECT_LT((last.cov - at.cov - at.stop_cov).norm(), 0.5 * (at.cov + at.stop_cov).norm());
}

TEST(Axis, AReadingOutsideOfTheTravelIsRefused) {
  const CommissionedHead stated = make_head();
  Travel travel = make_travel(1, stated, 1500);
  travel.input.stations[3].axis_mm = 1700.0;
  const auto result = stitch(travel.input);
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("'x3'"), std::string::npos);
}

}  // namespace
}  // namespace crosstie::registration
