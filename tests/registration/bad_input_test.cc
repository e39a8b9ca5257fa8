// What goes wrong at the machine: it is named, and where enough is left the rest is used.

#include <algorithm>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "math/distributions.h"
#include "registration/stitch.h"
#include "tests/registration/synthetic_shell.h"
#include "tests/support/normalised_square.h"

namespace crosstie::registration {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct Row {
  std::vector<base::Pose> truth;
  std::vector<Eigen::Vector3d> places;
  StitchInput input;
};

/// Three scans in a row with eight markers in each overlap.
Row make_row(std::uint64_t seed, bool surfaces = false) {
  const tests::Shell shell;
  tests::Scanner scanner(seed);
  Row row;
  for (int i = 0; i < 16; ++i) {
    row.places.push_back(shell.at((i < 8 ? 200.0 : 600.0) + scanner.uniform(-90.0, 90.0), scanner.uniform(-300.0, 300.0)));
  }
  for (int k = 0; k < 3; ++k) {
    const tests::Window window{.along_mm = 400.0 * k, .length_mm = 600.0};
    row.truth.push_back(scanner.pose(shell, window));
    StationScan& station = row.input.stations.emplace_back();
    station.name = std::string(1, static_cast<char>('a' + k));
    for (std::size_t i = 0; i < row.places.size(); ++i) {
      if (std::abs(row.places[i].x() - window.along_mm) < 300.0) {
        station.markers.push_back(scanner.sighting(static_cast<int>(i), row.places[i], row.truth.back(), 0.03));
      }
    }
    if (!surfaces) continue;
    station.surface = *Surface::make(scanner.cloud(shell, window, row.truth.back(), 4000, 0.03));
  }
  return row;
}

Sighting& sighting(Row& row, std::size_t station, int id) {
  auto& markers = row.input.stations[station].markers;
  return *std::find_if(markers.begin(), markers.end(), [&](const Sighting& s) { return s.id == id; });
}

MarkerReference reference_of(const Row& row, double sigma) {
  MarkerReference reference;
  const auto size = 3 * static_cast<Eigen::Index>(row.places.size());
  reference.points.xyz_mm.resize(size);
  for (std::size_t i = 0; i < row.places.size(); ++i) {
    reference.points.ids.push_back(static_cast<int>(i));
    reference.points.xyz_mm.segment<3>(3 * static_cast<Eigen::Index>(i)) = row.places[i];
  }
  reference.points.cov_mm2 = sigma * sigma * Eigen::MatrixXd::Identity(size, size);
  return reference;
}

/// All stations are where they are, as far as their covariance tells.
void expect_true_poses(const Row& row, const base::Stitching& result) {
  const base::Pose frame_from_machine = result.frame == "machine" ? base::Pose{} : row.truth[0].inverse();
  for (std::size_t k = result.frame == "machine" ? 0 : 1; k < row.truth.size(); ++k) {
    const base::StitchedStation& station = result.stations[k];
    EXPECT_LT(tests::normalised_square(station.machine_from_rig, frame_from_machine * row.truth[k], station.cov),
              math::chi_square_quantile(0.9999, 6.0))
        << station.name;
  }
}

TEST(BadInput, TooFewCommonMarkers) {
  Row row = make_row(1);
  auto& markers = row.input.stations[2].markers;
  markers.erase(markers.begin() + 2, markers.end());
  const auto result = stitch(row.input);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kNoUniqueSolution);
  EXPECT_THAT(result.error().message, AllOf(HasSubstr("station 'c'"), HasSubstr("shares 2 with station 'b'")));
}

TEST(BadInput, IdsSwappedInOneStationAreNamed) {
  Row row = make_row(2);
  std::swap(sighting(row, 1, 3).p_in_rig_mm, sighting(row, 1, 5).p_in_rig_mm);
  const auto result = stitch(row.input);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_EQ(result->rejected.size(), 4U) << "with two stations alone nobody knows which of them is right";
  for (const base::RejectedSighting& one : result->rejected) {
    EXPECT_THAT(one.id, testing::AnyOf(3, 5));
    EXPECT_THAT(one.reason, HasSubstr("ids 3 and 5 are swapped"));
  }
  expect_true_poses(row, *result);

  row.input.reference = reference_of(row, 0.015);
  const auto with_list = stitch(row.input);
  ASSERT_TRUE(with_list) << with_list.error().message;
  ASSERT_EQ(with_list->rejected.size(), 2U);
  for (const base::RejectedSighting& one : with_list->rejected) {
    EXPECT_EQ(one.station, 1);
    EXPECT_THAT(one.reason, HasSubstr("ids 3 and 5 are swapped in station 'b'"));
  }
}

TEST(BadInput, AMarkerThatMovedIsNamed) {
  Row row = make_row(3);
  row.input.reference = reference_of(row, 0.015);
  sighting(row, 2, 12).p_in_rig_mm += Eigen::Vector3d(4.0, -3.0, 0.0);
  const auto result = stitch(row.input);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_EQ(result->rejected.size(), 1U);
  EXPECT_EQ(result->rejected[0].station, 2);
  EXPECT_EQ(result->rejected[0].id, 12);
  EXPECT_NEAR(result->rejected[0].distance_mm, 5.0, 0.3);
  EXPECT_THAT(result->rejected[0].reason, HasSubstr("moved"));
  expect_true_poses(row, *result);
}

TEST(BadInput, AMarkerThatMovedLittleIsFoundByItsResidual) {
  Row row = make_row(4);
  row.input.reference = reference_of(row, 0.015);
  sighting(row, 1, 9).p_in_rig_mm += Eigen::Vector3d(0.25, 0.0, 0.0);
  const auto result = stitch(row.input);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_EQ(result->rejected.size(), 1U);
  EXPECT_EQ(result->rejected[0].station, 1);
  EXPECT_EQ(result->rejected[0].id, 9);
  EXPECT_GT(result->rejected[0].w, 3.0);
}

TEST(BadInput, APlaceOfTheListThatIsWrongIsNamed) {
  Row row = make_row(5);
  row.input.reference = reference_of(row, 0.015);
  row.input.reference->points.xyz_mm(3 * 10) += 2.0;
  const auto result = stitch(row.input);
  ASSERT_TRUE(result) << result.error().message;
  ASSERT_EQ(result->rejected.size(), 1U);
  EXPECT_EQ(result->rejected[0].station, -1);
  EXPECT_EQ(result->rejected[0].id, 10);
  EXPECT_THAT(result->rejected[0].reason, HasSubstr("after its coordinates were measured"));
}

TEST(BadInput, AListOfAnotherUnitIsRefused) {
  Row row = make_row(6);
  row.input.reference = reference_of(row, 0.015);
  row.input.reference->points.xyz_mm /= 25.4;
  const auto result = stitch(row.input);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kBadInput);
  EXPECT_THAT(result.error().message, AllOf(HasSubstr("list of reference coordinates"), HasSubstr("another unit")));
}

TEST(BadInput, ACopyOfAScanIsRefused) {
  Row row = make_row(7, true);
  row.input.stations[2].surface = row.input.stations[1].surface;
  const auto result = stitch(row.input);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, base::ErrorCode::kBadInput);
  EXPECT_THAT(result.error().message, AllOf(HasSubstr("'b' and 'c'"), HasSubstr("same scan")));
}

TEST(BadInput, AStationWithoutOverlapIsNamed) {
  Row row = make_row(8, true);
  row.input.reference = reference_of(row, 0.015);
  const tests::Shell shell;
  tests::Scanner scanner(80);
  // The third one looks elsewhere; its markers still tie it.
  row.input.stations[2].surface =
      *Surface::make(scanner.cloud(shell, {.along_mm = 1800.0, .length_mm = 300.0}, row.truth[2], 4000, 0.03));
  const auto result = stitch(row.input);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_EQ(result->overlaps.size(), 1U);
  const auto named =
      std::find_if(result->warnings.begin(), result->warnings.end(), [](const auto& w) { return w.code == "no_overlap"; });
  ASSERT_NE(named, result->warnings.end());
  EXPECT_EQ(named->subject, "c");
}

TEST(BadInput, NamesAndIdsThatComeTwice) {
  Row row = make_row(9);
  row.input.stations[1].name = "a";
  EXPECT_THAT(stitch(row.input).error().message, HasSubstr("'a' comes twice"));
  row = make_row(9);
  row.input.stations[1].markers[1].id = row.input.stations[1].markers[0].id;
  EXPECT_THAT(stitch(row.input).error().message, HasSubstr("twice"));
}

}  // namespace
}  // namespace crosstie::registration
