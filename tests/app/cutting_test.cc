// What a job says of hole, part and path, up to the files of the path.

#include <cmath>
#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "app/job.h"
#include "app/nominal_input.h"
#include "app/part_position.h"
#include "app/path_files.h"
#include "edge/nominal.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using ::testing::HasSubstr;
using tests::TemporaryFolder;

Job job_of(const TemporaryFolder& folder, const std::string& sections) {
  folder.write("job.toml", "format = \"crosstie-job/1\"\nname = \"door\"\n" + sections);
  const auto job = read_job(folder.path());
  EXPECT_TRUE(job.has_value()) << job.error().message;
  return job.value_or(Job{});
}

const std::string kTower =
    "[part]\nposition = \"tower\"\naxis_point_mm = [0, 0, 0]\naxis_direction = [1, 0, 0]\naxis_in_machine = [1, 0, 0]\n"
    "radius_mm = 2150.0\nhalf_angle_rad = 0.01\n";
const std::string kDoor = "[hole]\nnominal = \"oval\"\nlength_mm = 2000.0\nwidth_mm = 800.0\nlength_direction = [1, 0, 0]\n";

TEST(NominalInput, AnOutlineOnATowerIsItsSaddleCurve) {
  const TemporaryFolder folder;
  const double radius = 2150.0 + 1500.0 * std::tan(0.01);
  const Job job =
      job_of(folder, kTower + kDoor + "centre_mm = [1500, 0, " + std::to_string(radius) + "]\nnormal = [0, 0, 1]\n");
  const auto input = nominal_input(job);
  ASSERT_TRUE(input.has_value()) << input.error().message;
  ASSERT_TRUE(input->nominal.saddle.has_value());
  ASSERT_TRUE(input->frame_from_hole.has_value());
  EXPECT_EQ(input->frame, "part");
  const auto curve = edge::NominalCurve::make(input->nominal);
  ASSERT_TRUE(curve.has_value());
  for (double s = 0.0; s < curve->length_mm(); s += 100.0) {
    const Eigen::Vector3d p = *input->frame_from_hole * curve->at(s).point_mm;
    EXPECT_NEAR(std::hypot(p.y(), p.z()), 2150.0 + p.x() * std::tan(0.01), 1e-5) << "on the part's shell";
    const Eigen::Vector3d normal = input->frame_from_hole->rotation * curve->at(s).normal;
    EXPECT_GT(normal.z(), 0.9);
  }
  EXPECT_NEAR((*input->frame_from_hole * curve->at(0.0).point_mm).x(), 1500.0 + 1000.0 * std::cos(0.01), 1.0)
      << "its length along the tower";
}

TEST(NominalInput, ACentreBesideTheShellIsRefused) {
  const TemporaryFolder folder;
  auto input = nominal_input(job_of(folder, kTower + kDoor + "centre_mm = [1500, 0, 2250]\nnormal = [0, 0, 1]\n"));
  ASSERT_FALSE(input.has_value());
  EXPECT_EQ(input.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(input.error().message, HasSubstr("the centre lies on the shell"));
  input = nominal_input(job_of(folder, kTower + kDoor + "centre_mm = [1500, 0, 2165]\nnormal = [0, 0, -1]\n"));
  ASSERT_FALSE(input.has_value());
  EXPECT_THAT(input.error().message, HasSubstr("off the tower's normal"));
  input = nominal_input(job_of(folder, "[hole]\nnominal = \"absent.csv\"\n"));
  ASSERT_FALSE(input.has_value());
  EXPECT_EQ(input.error().code, ErrorCode::kFileSystem);
  input = nominal_input(job_of(folder, ""));
  ASSERT_FALSE(input.has_value());
  EXPECT_THAT(input.error().message, HasSubstr("no [hole] nominal"));
}

TEST(NominalInput, AListTakesItsNormalsFromTheTower) {
  const TemporaryFolder folder;
  std::string list = "x_mm,y_mm,z_mm\n";
  for (int i = 0; i < 24; ++i) {
    const double phi = 2.0 * std::numbers::pi * i / 24;
    const double y = 300.0 * std::sin(phi);
    list += std::to_string(1000.0 + 300.0 * std::cos(phi)) + "," + std::to_string(y) + "," +
            std::to_string(std::sqrt(2150.0 * 2150.0 - y * y)) + "\n";
  }
  folder.write("door.csv", list);
  const auto input = nominal_input(job_of(folder, kTower + "[hole]\nnominal = \"door.csv\"\n"));
  ASSERT_TRUE(input.has_value()) << input.error().message;
  ASSERT_EQ(input->nominal.normals.size(), 24U);
  EXPECT_GT(input->nominal.normals[6].z(), 0.98);
  EXPECT_GT(input->nominal.normals[6].y(), 0.1);
}

TEST(PartPosition, RpsPointsOfTwoListsHoldThePart) {
  const TemporaryFolder folder;
  folder.write("rps.csv", "id,x_mm,y_mm,z_mm,axes\n1,0,0,0,xyz\n2,1500,0,0,yz\n3,0,900,0,z\n9,5,5,5,x\n");
  folder.write(
      "probed.csv",
      "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n1,100,200,300,0.01,0.01,0.01\n2,100,1700,300,0.01,0.01,0.01\n"
      "3,-800,200,300,0.01,0.01,0.01\n4,0,0,0,0.01,0.01,0.01\n");
  const Job job = job_of(folder, "[part]\nposition = \"rps\"\npoints = \"rps.csv\"\nmeasured = \"probed.csv\"\n");
  const auto part = part_position(job, {}, std::nullopt);
  ASSERT_TRUE(part.has_value()) << part.error().message;
  EXPECT_EQ(part->source, "rps");
  EXPECT_EQ(part->redundancy, 0);
  EXPECT_NEAR((part->machine_from_part * Eigen::Vector3d(1500, 0, 0) - Eigen::Vector3d(100, 1700, 300)).norm(), 0.0, 1e-9);
  ASSERT_EQ(part_files(job).size(), 2U);
}

TEST(PartPosition, MarkersInThePartHoldItWhereStitchFoundThem) {
  const TemporaryFolder folder;
  const Job job = job_of(folder, "[hole]\nnominal = \"circle\"\nmarkers = \"markers.csv\"\n[part]\nposition = \"markers\"\n");
  EXPECT_TRUE(job.hole->markers_in_part);
  MeasuredPart measured;
  auto part = part_position(job, measured, std::nullopt);
  ASSERT_FALSE(part.has_value());
  EXPECT_THAT(part.error().message, HasSubstr("stitch did not find where they lie"));
  measured.tied_by_stitch = base::Pose{Eigen::Quaterniond::Identity(), {1.0, 2.0, 3.0}};
  measured.tied_cov = 0.01 * base::Matrix6d::Identity();
  part = part_position(job, measured, std::nullopt);
  ASSERT_TRUE(part.has_value()) << part.error().message;
  EXPECT_EQ(part->source, "markers");
  EXPECT_EQ(part->machine_from_part.translation_mm, Eigen::Vector3d(1.0, 2.0, 3.0));
  EXPECT_EQ(part->covariance, measured.tied_cov);
  // Markers in the machine's frame say nothing of the part.
  folder.write("job.toml",
               "format = \"crosstie-job/1\"\nname = \"door\"\n[hole]\nnominal = \"circle\"\nmarkers = \"markers.csv\"\n"
               "markers_frame = \"machine\"\n[part]\nposition = \"markers\"\n");
  const auto refused = read_job(folder.path());
  ASSERT_FALSE(refused.has_value());
  EXPECT_THAT(refused.error().message, HasSubstr("[hole] markers in the part's frame"));
}

TEST(PartPosition, WhatIsMissingIsNamed) {
  const TemporaryFolder folder;
  folder.write("known.csv", "id,x_mm,y_mm,z_mm\n1,0,0,0\n2,1500,0,0\n3,0,900,0\n");
  const Job markers = job_of(folder, "[part]\nposition = \"markers\"\npoints = \"known.csv\"\n");
  auto part = part_position(markers, {}, std::nullopt);
  ASSERT_FALSE(part.has_value());
  EXPECT_THAT(part.error().message, HasSubstr("none of the part's points"));
  const Job tower = job_of(folder, kTower);
  part = part_position(tower, {}, std::nullopt);
  ASSERT_FALSE(part.has_value());
  EXPECT_THAT(part.error().message, HasSubstr("centre_mm"));
  part = part_position(tower, {}, Eigen::Vector3d(1500, 0, 2165));
  ASSERT_FALSE(part.has_value());
  EXPECT_THAT(part.error().message, HasSubstr("no cone or cylinder"));
  part = part_position(job_of(folder, ""), {}, std::nullopt);
  ASSERT_TRUE(part.has_value());
  EXPECT_EQ(part->source, "none");
}

base::ToolPath some_path() {
  base::ToolPath path;
  path.frame = "machine";
  for (int i = 0; i < 5; ++i) {
    base::ToolPathPoint p;
    p.point_mm = {10.0 * i, 0.0, 0.0};
    p.speed_mm_per_s = 5.0;
    p.s_mm = 10.0 * i;
    path.points.push_back(p);
  }
  return path;
}

TEST(PathFiles, AreAllThereOrTheTemplateIsNamed) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_path_files(folder.path(), some_path(), {}, {}, "door").has_value());
  for (const char* name : {"path.json", "path.csv", "path.dxf", "path.ngc"})
    EXPECT_TRUE(std::filesystem::exists(folder / name)) << name;
  EXPECT_THAT(tests::read_all(folder / "path.ngc"), HasSubstr("(door: 5 points"));
  const TemporaryFolder other;
  const auto mine = other.write("mine.ngc", "G90\n{begin points}\n{motion}\n{end points}\n");
  const auto refused = write_path_files(other.path(), some_path(), {}, mine, "door");
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
  EXPECT_THAT(refused.error().message, HasSubstr("mine.ngc: G-code template, line 1"));
  EXPECT_FALSE(std::filesystem::exists(other / "path.json")) << "nothing is written half";
}

TEST(PathOptions, ReachCountsInTheMachineOnly) {
  JobPath path;
  path.reach_low_mm = Eigen::Vector3d(0, 0, 0);
  path.reach_high_mm = Eigen::Vector3d(1, 1, 1);
  path.bevel_rad = 0.3;
  EXPECT_TRUE(path_options(path, "machine").reach.has_value());
  EXPECT_FALSE(path_options(path, "rig").reach.has_value());
  EXPECT_EQ(path_options(path, "rig").bevel_rad, 0.3);
}

}  // namespace
}  // namespace crosstie::app
