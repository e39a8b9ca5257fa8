#include "base/ply.h"

#include <cstring>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::HasSubstr;
using tests::TemporaryFolder;

Result<Cloud> cloud_of(const std::string& bytes) {
  const TemporaryFolder folder;
  return read_ply(folder.write("cloud.ply", bytes));
}

template <typename T>
std::string raw(T value, bool big_endian = false) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  if (big_endian) std::reverse(bytes.begin(), bytes.end());
  return bytes;
}

const std::string kAscii = "ply\nformat ascii 1.0\n";
const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

TEST(Ply, ReadsAsciiWithForeignElementsAround) {
  const auto cloud =
      cloud_of(kAscii +
               "comment made by hand\nelement face 2\nproperty list uchar int vertex_indices\nelement vertex 2\n"
               "property double x\nproperty uchar red\nproperty double y\nproperty list uchar float odd\nproperty double z\n"
               "element edge 1\nproperty int a\nend_header\n3 0 1 2\n0\n1.5 255 2.5 2 9 9 3.5\n4 0 5 0 6\n7\n");
  ASSERT_TRUE(cloud) << cloud.error().message;
  ASSERT_EQ(cloud->points.size(), 2U);
  EXPECT_EQ(cloud->points[0], Eigen::Vector3d(1.5, 2.5, 3.5));
  EXPECT_EQ(cloud->points[1], Eigen::Vector3d(4, 5, 6));
  ASSERT_EQ(cloud->fields.size(), 1U);
  EXPECT_EQ(cloud->fields[0].name, "red");
  EXPECT_EQ(cloud->fields[0].values[0], 255.0);
}

TEST(Ply, ReadsBothByteOrders) {
  for (const bool big : {false, true}) {
    std::string bytes = std::string("ply\nformat binary_") + (big ? "big" : "little") +
                        "_endian 1.0\nelement junk 1\nproperty list ushort double values\nproperty char c\nelement vertex 1\n" +
                        kXyz + "property int scalar_station\nend_header\n";
    bytes += raw<std::uint16_t>(2, big) + raw(1.0, big) + raw(2.0, big) + "c";
    bytes += raw(1.5F, big) + raw(-2.25F, big) + raw(1e6F, big) + raw<std::int32_t>(-7, big);
    const auto cloud = cloud_of(bytes);
    ASSERT_TRUE(cloud) << cloud.error().message;
    EXPECT_EQ(cloud->points[0], Eigen::Vector3d(1.5, -2.25, 1e6));
    EXPECT_EQ(cloud->fields[0].name, "station");
    EXPECT_EQ(cloud->fields[0].values[0], -7.0);
  }
}

TEST(Ply, RefusesWithAReason) {
  const std::string end = "end_header\n";
  const std::pair<std::string, const char*> cases[] = {
      {kAscii + "element vertex 4000000000\n" + kXyz + end + "1 2 3\n", "claims 4000000000 of vertex"},
      {"ply\nformat binary_little_endian 1.0\nelement vertex 18446744073709551615\n" + kXyz + end, "count cannot be read"},
      {"ply\nformat binary_little_endian 1.0\nelement vertex 9223372036854775807\n" + kXyz + end, "claims"},
      {kAscii + "element vertex -5\n" + kXyz + end, "count cannot be read"},
      {kAscii + "element face 4000000000\nproperty uchar a\nelement vertex 1\n" + kXyz + end + "1 2 3\n",
       "claims 4000000000 of face"},
      {kAscii + "element face 4000000000\nelement vertex 1\n" + kXyz + end + "1 2 3\n", "claims 4000000000 of face"},
      {kAscii + "element vertex 1\n" + kXyz + end + "1 nan 3\n", "vertex 0"},
      {"ply\nformat binary_little_endian 1.0\nelement vertex 1\n" + kXyz + end + raw(1.0F) +
           raw(std::numeric_limits<float>::infinity()) + raw(1.0F),
       "y is not finite"},
      {kAscii + "element vertex 2\n" + kXyz + end + "1.5 2.5 3.5\n4.5 5.5\n", "vertex 1"},
      {kAscii + "element vertex 1\nproperty quadruple x\n" + end, "unknown type"},
      {kAscii + "element vertex 1\nproperty list float int x\n" + end, "unknown type"},
      {kAscii + "element vertex 1\nproperty float x\nproperty float y\n" + end + "1 2\n", "no x, y and z"},
      {kAscii + "element vertex 1\n" + kXyz + "property float nx\n" + end + "1 2 3 4\n", "nx, ny and nz"},
      {kAscii + "element vertex 1\n" + kXyz + "property float x\n" + end + "1 2 3 4\n", "occurs twice"},
      {kAscii + "element face 0\nproperty float a\n" + end, "no element vertex"},
      {kAscii + "property float x\n" + end, "before the first element"},
      {"ply\nelement vertex 1\n" + kXyz + end + "1 2 3\n", "states no format"},
      {"ply\nformat ascii 2.0\n" + end, "format"},
      {"plyx\n", "no PLY"},
      {kAscii + "element vertex 1\n" + kXyz, "does not end"},
      {kAscii + "comment unit inch\nelement vertex 1\n" + kXyz + end + "1 2 3\n", "unit inch"},
      {"ply\nformat binary_little_endian 1.0\nelement junk 1\nproperty list int double v\nelement vertex 1\n" + kXyz + end +
           raw<std::int32_t>(-1) + raw(0.0) + raw(0.0),
       "cut off in junk"},
      {"ply\nformat binary_little_endian 1.0\nelement junk 1\nproperty list uint double v\nelement vertex 1\n" + kXyz + end +
           raw<std::uint32_t>(4000000000U) + raw(0.0) + raw(0.0),
       "cut off in junk"},
      {kAscii + "element vertex 1\n" + kXyz + "property float sigma\rmm\n" + end + "1 2 3 4\n", "cannot be read"},
      // Counts that no integer holds: a cast of them is undefined.
      {kAscii + "element vertex 1\n" + kXyz + "property list uchar int tags\n" + end + "1 2 3 1e300 5\n", "vertex 0"},
      {kAscii + "element junk 1\nproperty list int int v\nelement vertex 1\n" + kXyz + end + "1e19 4 1 2 3\n",
       "cut off in junk"},
  };
  for (const auto& [bytes, message] : cases) {
    const auto cloud = cloud_of(bytes);
    ASSERT_FALSE(cloud) << bytes;
    EXPECT_EQ(cloud.error().code, ErrorCode::kBadInput);
    EXPECT_THAT(cloud.error().message, HasSubstr(message)) << bytes;
  }
}

Result<Mesh> mesh_of(const std::string& bytes) {
  const TemporaryFolder folder;
  return read_ply_mesh(folder.write("mesh.ply", bytes));
}

TEST(PlyMesh, PolygonsBecomeTriangles) {
  const std::string vertices = "element vertex 4\n" + kXyz;
  const auto mesh = mesh_of(kAscii + vertices +
                            "element face 3\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n"
                            "0 0 0\n1 0 0\n1 1 0\n0 1 0\n9 4 0 1 2 3\n9 3 0 2 1\n9 3 0 0 1\n");
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(mesh->vertices.points.size(), 4U);
  using Triangle = std::array<std::uint32_t, 3>;
  EXPECT_THAT(mesh->triangles, testing::ElementsAre(Triangle{0, 1, 2}, Triangle{0, 2, 3}, Triangle{0, 2, 1}))
      << "none of no area";
  const auto cloud = mesh_of(kAscii + vertices + "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n");
  ASSERT_TRUE(cloud);
  EXPECT_TRUE(cloud->triangles.empty());
}

TEST(PlyMesh, BinaryFacesOfBothOrders) {
  for (const bool big : {false, true}) {
    std::string bytes = std::string("ply\nformat ") + (big ? "binary_big_endian" : "binary_little_endian") +
                        " 1.0\nelement vertex 3\n" + kXyz +
                        "element face 1\nproperty list uchar uint vertex_index\nend_header\n";
    for (const float value : {0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F}) bytes += raw(value, big);
    bytes += '\3';
    for (const std::uint32_t index : {2U, 0U, 1U}) bytes += raw(index, big);
    const auto mesh = mesh_of(bytes);
    ASSERT_TRUE(mesh) << mesh.error().message;
    ASSERT_EQ(mesh->triangles.size(), 1U);
    EXPECT_EQ(mesh->triangles[0], (std::array<std::uint32_t, 3>{2, 0, 1}));
  }
}

TEST(PlyMesh, RefusesWithAReason) {
  const std::string head = kAscii + "element vertex 3\n" + kXyz +
                           "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n";
  EXPECT_THAT(mesh_of(head + "3 0 1 3\n").error().message, HasSubstr("face 0: the file is cut off, or a corner is no vertex"));
  EXPECT_THAT(mesh_of(head + "3 0 1 -1\n").error().message, HasSubstr("no vertex"));
  EXPECT_THAT(mesh_of(head + "2 0 1\n").error().message, HasSubstr("less than three corners"));
  EXPECT_THAT(mesh_of(head + "3 0 1\n").error().message, HasSubstr("cut off"));
  EXPECT_THAT(mesh_of(kAscii + "element face 1\nproperty list uchar int vertex_indices\nelement vertex 3\n" + kXyz +
                      "end_header\n3 0 1 2\n0 0 0\n1 0 0\n0 1 0\n")
                  .error()
                  .message,
              HasSubstr("before its vertices"));
  EXPECT_THAT(mesh_of(kAscii + "element vertex 1\n" + kXyz + "element face 1\nproperty uchar a\nend_header\n0 0 0\n1\n")
                  .error()
                  .message,
              HasSubstr("no list vertex_indices"));
}

TEST(Ply, AnEmptyCloudIsACloud) {
  const TemporaryFolder folder;
  ASSERT_TRUE(write_ply(folder / "empty.ply", {}));
  const auto cloud = read_ply(folder / "empty.ply");
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_TRUE(cloud->points.empty());
}

TEST(Ply, WhatIsWrittenReadsBack) {
  Cloud cloud;
  cloud.frame = "machine";
  cloud.fields = {{"sigma_mm", {}}, {"station", {}}};
  for (int i = 0; i < 50; ++i) {
    cloud.points.emplace_back(1.0 / (i + 1), 12345.678901 + i, -i);
    cloud.normals.emplace_back(0.0, 0.5, 0.25 * i);
    Eigen::Matrix3d cov;
    cov << 4, 1, i, 1, 5, 2, i, 2, 6;
    cloud.cov_mm2.push_back(cov);
    cloud.fields[0].values.push_back(0.125 * i);
    cloud.fields[1].values.push_back(i % 3);
  }
  const TemporaryFolder folder;
  ASSERT_TRUE(write_ply(folder / "cloud.ply", cloud));
  const auto again = read_ply(folder / "cloud.ply");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->frame, "machine");
  EXPECT_EQ(again->points, cloud.points) << "bit by bit";
  EXPECT_EQ(again->normals, cloud.normals);
  EXPECT_EQ(again->cov_mm2, cloud.cov_mm2);
  ASSERT_EQ(again->fields.size(), 2U);
  EXPECT_EQ(again->fields[0].name, "sigma_mm");
  EXPECT_EQ(again->fields[1].values, cloud.fields[1].values);
  EXPECT_THAT(tests::read_all(folder / "cloud.ply"), HasSubstr("property float scalar_sigma_mm\n"));

  ASSERT_TRUE(write_ply(folder / "float.ply", cloud, {.double_coordinates = false}));
  EXPECT_NEAR(read_ply(folder / "float.ply")->points[3].y(), cloud.points[3].y(), 1e-3);
}

TEST(Ply, ListsOfDifferentLengthAreNotWritten) {
  const TemporaryFolder folder;
  Cloud cloud;
  cloud.points.emplace_back(1, 2, 3);
  cloud.fields = {{"sigma", {1.0, 2.0}}};
  EXPECT_FALSE(write_ply(folder / "a.ply", cloud));
  cloud.fields = {{"a name", {1.0}}};
  EXPECT_FALSE(write_ply(folder / "a.ply", cloud));
  EXPECT_FALSE(std::filesystem::exists(folder / "a.ply"));
}

TEST(Ply, ValuesThatAFloatCannotHoldAreNotWritten) {
  const TemporaryFolder folder;
  Cloud cloud;
  cloud.points.emplace_back(1e300, 2, 3);  // x y z are doubles
  EXPECT_TRUE(write_ply(folder / "double.ply", cloud));
  EXPECT_EQ(read_ply(folder / "double.ply")->points, cloud.points);
  const auto as_floats = write_ply(folder / "float.ply", cloud, {.double_coordinates = false});
  ASSERT_FALSE(as_floats);
  EXPECT_THAT(as_floats.error().message, HasSubstr("too large"));
  cloud.normals.emplace_back(0, -1e39, 0);
  EXPECT_FALSE(write_ply(folder / "float.ply", cloud));
  EXPECT_FALSE(std::filesystem::exists(folder / "float.ply"));
}

}  // namespace
}  // namespace crosstie::base
