#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "markers/detect.h"
#include "tests/support/measured_data.h"

namespace crosstie::markers {
namespace {

using base::ObservationStatus;

std::map<int, Eigen::Vector3d> reference_points(const std::filesystem::path& path) {
  std::map<int, Eigen::Vector3d> points;
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    int id = 0;
    Eigen::Vector3d p;
    if (cells >> id >> p.x() >> p.y() >> p.z()) points[id] = p;
  }
  return points;
}

/// Largest distance of the observations from the plane's best homography, in px. A wrong id lies hundreds of px off and drags
/// the fit with it; lens distortion and the panel's form leave a few.
double largest_homography_residual(const std::vector<Eigen::Vector2d>& plane, const std::vector<Eigen::Vector2d>& pixels) {
  Eigen::MatrixXd a(2 * static_cast<Eigen::Index>(plane.size()), 9);
  for (std::size_t i = 0; i < plane.size(); ++i) {
    const Eigen::Vector3d p(plane[i].x() / 400.0, plane[i].y() / 400.0, 1.0);
    const Eigen::Vector2d q = (pixels[i] - Eigen::Vector2d(1000.0, 667.0)) / 1000.0;
    const auto row = 2 * static_cast<Eigen::Index>(i);
    a.row(row) << p.transpose(), 0.0, 0.0, 0.0, -q.x() * p.transpose();
    a.row(row + 1) << 0.0, 0.0, 0.0, p.transpose(), -q.y() * p.transpose();
  }
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeFullV);
  const Eigen::Matrix<double, 9, 1> h = svd.matrixV().col(8);
  double largest = 0.0;
  for (std::size_t i = 0; i < plane.size(); ++i) {
    const Eigen::Vector3d p(plane[i].x() / 400.0, plane[i].y() / 400.0, 1.0);
    const Eigen::Vector3d q(h.segment<3>(0).dot(p), h.segment<3>(3).dot(p), h.segment<3>(6).dot(p));
    largest = std::max(largest, (1000.0 * q.hnormalized() + Eigen::Vector2d(1000.0, 667.0) - pixels[i]).norm());
  }
  return largest;
}

TEST(MeasuredImages, AiconPanelIsReadWithoutAWrongId) {
  const auto folder = tests::measured_data("aicon-panel");
  if (folder.empty()) GTEST_SKIP() << "no aicon-panel in CROSSTIE_DATA";
  const auto reference = reference_points(folder / "Positions-3D-14bit_lookup.txt");
  const MarkerFamily family = *marker_family("aicon14");
  int coded = 0;
  int images = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".tif") continue;
    ++images;
    const auto image = base::read_image(entry.path());
    ASSERT_TRUE(image) << image.error().message;
    const auto found = detect(image->view(), family);
    ASSERT_TRUE(found);
    std::vector<Eigen::Vector2d> plane, pixels;
    std::set<int> ids;
    for (const base::Observation& observation : found->observations) {
      if (observation.status != ObservationStatus::kCoded) continue;
      EXPECT_TRUE(observation.id >= 2 && observation.id <= 74) << entry.path() << " " << observation.id;
      EXPECT_TRUE(ids.insert(observation.id).second) << entry.path() << " " << observation.id;
      if (observation.id < 2 || observation.id > 71) continue;  // 72-74 are held in front of the panel
      plane.emplace_back(reference.at(observation.id).head<2>());
      pixels.push_back(observation.centre_px);
      ++coded;
    }
    EXPECT_LT(largest_homography_residual(plane, pixels), 12.0) << entry.path();
  }
  EXPECT_EQ(images, 20);
  EXPECT_GE(coded, 1015);
  RecordProperty("coded", coded);
}

TEST(MeasuredImages, HtwPhotoGivesTheKnownIds) {
  const auto folder = tests::measured_data("htw-photo");
  if (folder.empty()) GTEST_SKIP() << "no htw-photo in CROSSTIE_DATA";
  std::set<int> known;
  std::ifstream table(folder / "baseline_detections.csv");
  std::string line;
  std::getline(table, line);
  while (std::getline(table, line)) {
    if (line.empty() || line[0] == ',') continue;
    const int id = std::stoi(line);
    // The ring of 33 reaches beyond the upper border: the baseline guessed what it did not see. The segments of 398 are 2.49 px
    // wide where tilt shortens them most, just below what is read.
    if (id != 33 && id != 398) known.insert(id);
  }
  EXPECT_EQ(known.size(), 61U);
  const auto image = base::read_image(folder / "test_data_example.jpg");
  ASSERT_TRUE(image) << image.error().message;
  const auto found = detect(image->view(), *marker_family("aicon14"));
  ASSERT_TRUE(found);
  std::multiset<int> ids;
  for (const base::Observation& observation : found->observations) {
    if (observation.status == ObservationStatus::kCoded) ids.insert(observation.id);
  }
  EXPECT_EQ(std::set<int>(ids.begin(), ids.end()), known);
  EXPECT_EQ(ids.size(), known.size());
}

}  // namespace
}  // namespace crosstie::markers
