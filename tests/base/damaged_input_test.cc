// Every reader of base against every kind of damage: an Error that names the file, never a crash, never an exception.
#include <sys/stat.h>

#include <functional>
#include <optional>
#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/camera_file.h"
#include "base/file.h"
#include "base/image.h"
#include "base/json_file.h"
#include "base/npy.h"
#include "base/ply.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "base/table.h"
#include "tests/base/image_samples.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::HasSubstr;
using testing::Not;
using tests::TemporaryFolder;

struct Reader {
  std::string name;
  std::string good;  ///< contents that it reads
  std::function<std::optional<Error>(const std::filesystem::path&)> read;
  bool is_text = false;
  bool sees_every_cut = true;  ///< false where a shorter file is a good file, too
};

template <typename T>
std::optional<Error> error_of(const Result<T>& result) {
  return result ? std::nullopt : std::optional<Error>(result.error());
}

std::string contents_written(const std::function<Result<>(const std::filesystem::path&)>& write) {
  const TemporaryFolder folder;
  const auto written = write(folder / "file.png");
  EXPECT_TRUE(written) << written.error().message;
  return tests::read_all(folder / "file.png");
}

Camera some_camera() {
  Eigen::VectorXd p(9);
  p << 1000.5, 1001.25, 319.5, 239.5, -0.1, 0.05, 1e-4, -2e-4, 0.01;
  return *Camera::make(LensModel::kOpenCv5, 640, 480, p);
}

Cloud some_cloud() {
  Cloud cloud;
  cloud.frame = "machine";
  cloud.fields = {{"sigma_mm", {}}};
  for (int i = 0; i < 20; ++i) {
    cloud.points.emplace_back(i, 0.5 * i, 1000.0 - i);
    cloud.fields[0].values.push_back(0.01 * i);
  }
  return cloud;
}

AdjustedNetwork some_network() {
  AdjustedNetwork network;
  for (int id = 1; id <= 3; ++id) {
    network.points.emplace_back();
    network.points.back().id = id;
    network.points.back().xyz_mm = {1.0 * id, 2.0, 3.0};
    network.points.back().cov_mm2 = Eigen::Matrix3d::Identity() * 1e-4;
  }
  return network;
}

nlohmann::ordered_json some_result() {
  ResultEnvelope envelope;
  envelope.verb = "adjust";
  envelope.frame = "network";
  return result_json(envelope, {}, network_json(some_network()));
}

std::string some_observations() {
  return "image,family,id,x_px,y_px,cov_xx,cov_xy,cov_yy,a_px,b_px,angle_rad,margin,status\n"
         "a,ring10,7,100.5,200.25,0.0004,0,0.0004,8,6,0.5,0.9,coded\n"
         "b,ring10,8,101.5,201.25,0.0004,0,0.0004,8,6,0.5,0.9,coded\n";
}

std::vector<Reader> readers() {
  const auto json = [](const std::filesystem::path& p) { return error_of(read_json(p)); };
  const auto table = [](const std::filesystem::path& p) { return error_of(read_table(p)); };
  const auto points = [](const std::filesystem::path& p) { return error_of(read_point_list(p)); };
  const auto bars = [](const std::filesystem::path& p) { return error_of(read_scale_bars(p)); };
  const auto ply = [](const std::filesystem::path& p) { return error_of(read_ply(p)); };
  const auto camera = [](const std::filesystem::path& p) { return error_of(read_camera(p)); };
  const auto npy = [](const std::filesystem::path& p) { return error_of(read_npy(p)); };
  const auto image = [](const std::filesystem::path& p) { return error_of(read_image(p)); };
  const auto result = [](const std::filesystem::path& p) { return error_of(points_from_network_json(p)); };
  const auto observations = [](const std::filesystem::path& p) { return error_of(read_observations(p)); };

  std::vector<Reader> all = {
      {"json", "{\"a\": [1, 2.5, null],\n \"b\": {\"c\": \"text\"}}\n", json, true},
      {"table", "id,x_mm,name\n1,2.5,\"a, b\"\n2,3.5,c\n3,4.5,d\n", table, true, false},
      {"points", "id,x_mm,y_mm,z_mm,sigma_x_mm,sigma_y_mm,sigma_z_mm\n1,1,2,3,0.1,0.1,0.1\n2,4,5,6,0.1,0.1,0.1\n", points, true,
       false},
      {"object list", "  1 1.5 2.5 3.5 fix fix fix 12 0\n  2 4.5 5.5 6.5 0.1 0.2 0.3 12 0\n", points, true, false},
      {"scale bars", "id_a,id_b,length_mm,sigma_mm\n1,2,1000.0,0.01\n3,4,1000.0,0.01\n", bars, true, false},
      {"observations", some_observations(), observations, true, false},
      {"adjust result", contents_written([](const auto& p) { return write_json(p, some_result()); }), result, true},
      {"cameramodel", contents_written([](const auto& p) { return write_cameramodel(p, some_camera()); }), camera, true},
      {"OpenCV YAML", contents_written([](const auto& p) { return write_opencv_yaml(p, some_camera()); }), camera, true},
      {"binary PLY", contents_written([](const auto& p) { return write_ply(p, some_cloud()); }), ply},
      {"ASCII PLY",
       "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n4 5 "
       "6.25\n",
       ply, true, false},
      {"npy", contents_written([](const auto& p) { return write_npy(p, Eigen::MatrixXd::Identity(5, 5)); }), npy},
  };
  for (auto& [name, bytes] : tests::image_samples()) all.push_back({"image " + name, bytes, image});
  return all;
}

/// An error, where there is one, names the file on one line and blames the input.
void expect_sensible(const std::optional<Error>& error, const std::filesystem::path& path, const std::string& what) {
  if (!error) return;
  EXPECT_EQ(error->code, ErrorCode::kBadInput) << what;
  EXPECT_THAT(error->message, HasSubstr(shown(path))) << what;
  EXPECT_THAT(error->message, Not(HasSubstr("\n"))) << what;
  EXPECT_LT(error->message.size(), 700U) << what;
}

void expect_refused(const Reader& reader, const std::filesystem::path& path, const std::string& what) {
  const auto error = reader.read(path);
  EXPECT_TRUE(error) << what << " was accepted";
  expect_sensible(error, path, what);
}

class DamagedInput : public testing::TestWithParam<std::size_t> {
 protected:
  static const std::vector<Reader>& all() {
    static const std::vector<Reader> list = readers();
    return list;
  }
  const Reader& reader() const { return all()[GetParam()]; }

  TemporaryFolder folder_;
};

TEST_P(DamagedInput, TheUndamagedFileIsRead) {
  for (const char* name : {"file", "with blank", "\xC3\xBC\xE4\xBD\xA0", "new\nline"}) {
    const auto error = reader().read(folder_.write(name, reader().good));
    EXPECT_FALSE(error) << reader().name << ": " << error->message;
  }
}

TEST_P(DamagedInput, TextMayHaveAMarkOrOtherLineEnds) {
  if (!reader().is_text) return;
  if (reader().name != "ASCII PLY") {
    EXPECT_FALSE(reader().read(folder_.write("bom", "\xEF\xBB\xBF" + reader().good)));
  }
  std::string crlf;
  for (const char c : reader().good) crlf += c == '\n' ? std::string("\r\n") : std::string(1, c);
  const auto error = reader().read(folder_.write("crlf", crlf));
  EXPECT_FALSE(error) << error->message;
  EXPECT_FALSE(reader().read(folder_.write("no_last_newline", reader().good.substr(0, reader().good.size() - 1))));
}

TEST_P(DamagedInput, CutAnywhere) {
  const std::string& good = reader().good;
  for (std::size_t part = 0; part < 16; ++part) {
    const auto path = folder_.write("cut", std::string_view(good).substr(0, good.size() * part / 16));
    const std::string what = reader().name + " cut at " + std::to_string(part) + "/16";
    if (part == 0 || reader().sees_every_cut) {
      expect_refused(reader(), path, what);
    } else {
      expect_sensible(reader().read(path), path, what);
    }
  }
}

TEST_P(DamagedInput, FlippedBits) {
  std::mt19937_64 random(13);
  for (int i = 0; i < 150; ++i) {
    std::string bytes = reader().good;
    const std::size_t limit = i % 2 == 0 ? std::min<std::size_t>(bytes.size(), 128) : bytes.size();
    char& c = bytes[random() % limit];
    c = static_cast<char>(c ^ (1 << (random() % 8)));
    const auto path = folder_.write("flipped", bytes);
    expect_sensible(reader().read(path), path, reader().name);
  }
}

TEST_P(DamagedInput, SomethingElseEntirely) {
  std::mt19937_64 random(14);
  std::string noise(65536, '\0');
  for (char& c : noise) c = static_cast<char>(random());
  const std::pair<const char*, std::string> cases[] = {{"an executable", std::string("\x7f"
                                                                                     "ELF\x02\x01\x01\0\0\0",
                                                                                     10)},
                                                       {"noise", noise},
                                                       {"zeros", std::string(4096, '\0')},
                                                       {"a million a", std::string(1000000, 'a')},
                                                       {"a million [", std::string(1000000, '[')},
                                                       {"a million {", std::string(1000000, '{')},
                                                       {"a million ,", std::string(1000000, ',')},
                                                       {"a million blanks", std::string(1000000, ' ')},
                                                       {"a million lines", std::string(1000000, '\n')},
                                                       {"a million quotes", std::string(1000001, '"')},
                                                       {"a million hashes", std::string(1000000, '#')}};
  for (const auto& [what, bytes] : cases) expect_refused(reader(), folder_.write("other", bytes), reader().name + ": " + what);
  for (const auto& other : all()) {  // whatever comes out, it is an answer
    const auto path = folder_.write("other", other.good);
    expect_sensible(reader().read(path), path, reader().name + " given " + other.name);
  }
}

TEST_P(DamagedInput, WhatIsNoFile) {
  ASSERT_EQ(mkfifo((folder_ / "fifo").c_str(), 0600), 0);
  std::filesystem::create_symlink("loop", folder_ / "loop");
  for (const auto& path :
       {folder_ / "missing", folder_.path(), folder_ / "fifo", folder_ / "loop", folder_ / std::string(300, 'n')}) {
    const auto error = reader().read(path);
    ASSERT_TRUE(error) << path;
    EXPECT_EQ(error->code, ErrorCode::kFileSystem) << path;
    EXPECT_THAT(error->message, HasSubstr(path.string()));
  }
}

TEST_P(DamagedInput, AMessageAboutAnOddNameIsOneLine) {
  expect_refused(reader(), folder_.write("new\nline", ""), reader().name);
}

INSTANTIATE_TEST_SUITE_P(Base, DamagedInput, testing::Range<std::size_t>(0, 12 + tests::kImageSamples));

}  // namespace
}  // namespace crosstie::base
