// Numbers are read and written with a point, whatever the process's locale says.
#include <clocale>
#include <cstdlib>
#include <functional>
#include <locale>
#include <optional>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/camera_file.h"
#include "base/json_file.h"
#include "base/npy.h"
#include "base/ply.h"
#include "base/point_list.h"
#include "base/text.h"
#include "tests/support/temporary_folder.h"

/// The C library keeps what it makes of LOCPATH; the leak sanitizer asks here for what to pass over.
extern "C" const char* __lsan_default_suppressions();  // NOLINT(bugprone-reserved-identifier)
extern "C" const char* __lsan_default_suppressions() {
  return "leak:__argz_add_sep\n";
}  // NOLINT(bugprone-reserved-identifier)

namespace crosstie::base {
namespace {

using tests::TemporaryFolder;

/// A locale with a decimal comma, made by localedef in a folder of its own; the former one is back afterwards.
class DecimalComma {
 public:
  DecimalComma() {
    const std::string command = "localedef -i de_DE -f UTF-8 '" + (folder_ / "de_DE.UTF-8").string() + "' >/dev/null 2>&1";
    if (std::system(command.c_str()) != 0) return;
    setenv("LOCPATH", folder_.path().c_str(), 1);
    active_ = std::setlocale(LC_ALL, "de_DE.UTF-8") != nullptr;
    if (active_) std::locale::global(std::locale("de_DE.UTF-8"));
  }
  DecimalComma(const DecimalComma&) = delete;
  DecimalComma& operator=(const DecimalComma&) = delete;
  ~DecimalComma() {
    std::locale::global(std::locale::classic());
    std::setlocale(LC_ALL, "C");
    unsetenv("LOCPATH");
  }
  [[nodiscard]] bool active() const { return active_; }

 private:
  TemporaryFolder folder_;
  bool active_ = false;
};

TEST(Locale, DecimalCommaChangesNothing) {
  const DecimalComma locale;
  if (!locale.active()) GTEST_SKIP() << "localedef cannot make de_DE.UTF-8";
  char shown[16];
  std::snprintf(shown, sizeof shown, "%.1f", 0.5);
  ASSERT_STREQ(shown, "0,5") << "the locale has no effect";

  EXPECT_EQ(parse_double("1.5"), 1.5);
  EXPECT_FALSE(parse_double("1,5"));
  EXPECT_EQ(format_double(1234567.5), "1234567.5");

  const TemporaryFolder folder;
  const auto points = read_point_list(folder.write("p.csv", "id,x_mm,y_mm,z_mm\n1000,1.5,2500.25,3\n"));
  ASSERT_TRUE(points) << points.error().message;
  EXPECT_EQ(points->points[0].xyz_mm.y(), 2500.25);
  ASSERT_TRUE(write_point_list(folder / "q.csv", *points));
  EXPECT_EQ(tests::read_all(folder / "q.csv"), "id,x_mm,y_mm,z_mm\n1000,1.5,2500.25,3\n");

  const auto objects = read_point_list(folder.write("o.txt", "2 -0.25 1.5 3.5 0.5 0.5 0.5 99 1\n"));
  ASSERT_TRUE(objects) << objects.error().message;
  EXPECT_EQ(objects->points[0].xyz_mm.x(), -0.25);

  nlohmann::ordered_json json;
  json["value"] = 1234.5;
  json["count"] = 1234567;
  ASSERT_TRUE(write_json(folder / "a.json", json));
  EXPECT_NE(tests::read_all(folder / "a.json").find("1234.5,\n  \"count\": 1234567"), std::string::npos);
  EXPECT_EQ(*read_json(folder / "a.json"), json);

  const Camera camera = *Camera::nominal(LensModel::kOpenCv5, 1640, 1480, 1800.5);
  using Write = std::function<Result<>(const std::filesystem::path&, const Camera&)>;
  for (const Write& write :
       {Write([](const auto&to, const Camera&one) { return write_cameramodel(to, one); }), Write(write_opencv_yaml)}) {
    ASSERT_TRUE(write(folder / "camera", camera));
    const auto again = read_camera(folder / "camera");
    ASSERT_TRUE(again) << again.error().message << tests::read_all(folder / "camera");
    EXPECT_EQ(again->parameters(), camera.parameters());
  }

  const auto cloud = read_ply(folder.write("c.ply",
                                           "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
                                           "property float z\nend_header\n1.5 2.5 3.5\n"));
  ASSERT_TRUE(cloud) << cloud.error().message;
  EXPECT_EQ(cloud->points[0].x(), 1.5);
  Cloud many;
  many.points.resize(1500, Eigen::Vector3d::Zero());
  ASSERT_TRUE(write_ply(folder / "m.ply", many));
  EXPECT_EQ(read_ply(folder / "m.ply")->points.size(), 1500U);
  ASSERT_TRUE(write_npy(folder / "m.npy", Eigen::MatrixXd::Ones(1500, 1)));
  EXPECT_EQ(read_npy(folder / "m.npy")->rows(), 1500);
}

}  // namespace
}  // namespace crosstie::base
