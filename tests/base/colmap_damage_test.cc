// Damaged COLMAP models: every answer is an Error that names the file, or a model that is whole; never a crash, and never an
// allocation that the file's size does not justify.

#include <cstring>
#include <filesystem>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/colmap_model.h"
#include "tests/base/colmap_scene.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

namespace fs = std::filesystem;
using crosstie::tests::read_all;
using crosstie::tests::TemporaryFolder;
using testing::HasSubstr;

constexpr const char* kNames[] = {"cameras", "images", "points3D"};

struct WrittenModel {
  TemporaryFolder folder;
  explicit WrittenModel(ColmapFormat format) { EXPECT_TRUE(write_colmap_model(folder.path(), tests::colmap_scene(), format)); }
};

void expect_refused(const fs::path& folder, const std::string& where) {
  const auto model = read_colmap_model(folder);
  ASSERT_FALSE(model) << where;
  EXPECT_EQ(model.error().code, ErrorCode::kBadInput) << where;
  EXPECT_THAT(model.error().message, HasSubstr(folder.string())) << where;
  EXPECT_EQ(model.error().message.find('\n'), std::string::npos) << where;
}

TEST(ColmapDamage, EveryCutOfABinaryModelIsRefused) {
  const WrittenModel written(ColmapFormat::kBinary);
  for (const char* name : kNames) {
    const fs::path file = written.folder / (std::string(name) + ".bin");
    const std::string whole = read_all(file);
    for (std::size_t sixteenth = 0; sixteenth < 16; ++sixteenth) {
      written.folder.write(file.filename(), whole.substr(0, whole.size() * sixteenth / 16));
      expect_refused(written.folder.path(), file.string() + " cut at " + std::to_string(sixteenth) + "/16");
    }
    written.folder.write(file.filename(), whole + "x");
    expect_refused(written.folder.path(), file.string() + " with a byte too many");
    written.folder.write(file.filename(), whole);
  }
  EXPECT_TRUE(read_colmap_model(written.folder.path()));
}

TEST(ColmapDamage, EveryCutOfATextModelIsRefused) {
  const WrittenModel written(ColmapFormat::kText);
  for (const char* name : kNames) {
    const fs::path file = written.folder / (std::string(name) + ".txt");
    const std::string whole = read_all(file);
    for (std::size_t sixteenth = 0; sixteenth < 16; ++sixteenth) {
      written.folder.write(file.filename(), whole.substr(0, whole.size() * sixteenth / 16));
      expect_refused(written.folder.path(), file.string() + " cut at " + std::to_string(sixteenth) + "/16");
    }
    written.folder.write(file.filename(), whole);
  }
  EXPECT_TRUE(read_colmap_model(written.folder.path()));
}

TEST(ColmapDamage, FlippedBitsNeverCrash) {
  std::mt19937_64 random(11);
  for (const ColmapFormat format : {ColmapFormat::kText, ColmapFormat::kBinary}) {
    const WrittenModel written(format);
    int refused = 0;
    constexpr int kTrials = 150;
    for (int trial = 0; trial < kTrials; ++trial) {
      const fs::path file =
          written.folder / (std::string(kNames[trial % 3]) + (format == ColmapFormat::kText ? ".txt" : ".bin"));
      const std::string whole = read_all(file);
      std::string damaged = whole;
      damaged[random() % damaged.size()] ^= static_cast<char>(1U << (random() % 8U));
      written.folder.write(file.filename(), damaged);
      const auto model = read_colmap_model(written.folder.path());
      if (!model) {
        ++refused;
        EXPECT_EQ(model.error().message.find('\n'), std::string::npos);
      } else {
        EXPECT_EQ(model->images.size(), 12U) << "a digit may change unseen, the structure may not";
      }
      written.folder.write(file.filename(), whole);
    }
    EXPECT_GT(refused, kTrials / 10);
  }
}

TEST(ColmapDamage, CountsAreHeldAgainstTheFile) {
  const WrittenModel written(ColmapFormat::kBinary);
  for (const char* name : kNames) {
    const fs::path file = written.folder / (std::string(name) + ".bin");
    const std::string whole = read_all(file);
    for (const std::uint64_t count : {std::uint64_t{1} << 20U, std::uint64_t{1} << 40U, ~std::uint64_t{0}}) {
      std::string damaged = whole;
      std::memcpy(damaged.data(), &count, sizeof count);
      written.folder.write(file.filename(), damaged);
      expect_refused(written.folder.path(), file.string());
      EXPECT_THAT(read_colmap_model(written.folder.path()).error().message, HasSubstr("offset 0"));
    }
    written.folder.write(file.filename(), whole);
  }
}

TEST(ColmapDamage, TextErrorsNameTheLine) {
  const struct {
    const char* file;
    const char* contents;
    const char* message;
  } cases[] = {
      {"cameras.txt", "# a comment\n1 FOV 100 80 90 90 50 40 0.1\n", "cameras.txt:2: the lens model FOV"},
      {"cameras.txt", "1 PINHOLE 100 80 90 90 50\n", "cameras.txt:1: lens parameter is missing"},
      {"cameras.txt", "1 PINHOLE 100 80 90 90 50 40 3\n", "cameras.txt:1: more than"},
      {"cameras.txt", "1 PINHOLE 100 80 90 nan 50 40\n", "cameras.txt:1: \"nan\""},
      {"cameras.txt", "1 PINHOLE 0 80 90 90 50 40\n", "cameras.txt:1: "},
      {"cameras.txt", "-1 PINHOLE 100 80 90 90 50 40\n", "cameras.txt:1: \"-1\""},
      {"cameras.txt", "99999999999999999999999 PINHOLE 100 80 90 90 50 40\n", "cameras.txt:1: "},
      {"cameras.txt", "1 PINHOLE 100 80 90 90 50 40\n1 PINHOLE 100 80 90 90 50 40\n", "camera 1 occurs twice"},
      {"cameras.txt", "2 PINHOLE 100 80 90 90 50 40\n", "image 1 has camera 1"},
      {"images.txt", "1 1 0 0 0 0 0 0 1 a.png\n", "images.txt:1: the line of its image points is missing"},
      {"images.txt", "1 1 0 0 0 0 0 0 1\n\n", "images.txt:1: the image's name"},
      {"images.txt", "1 2 0 0 0 0 0 0 1 a.png\n0.5 0.5 7\n", "images.txt:1: the quaternion"},
      {"images.txt", "1 1 0 0 0 0 0 0 1 a.png\n0.5 0.5\n", "images.txt:2: point id"},
      {"images.txt", "1 1 0 0 0 0 0 0 1 a.png\n0.5 0.5 -2\n", "images.txt:2: a negative point id"},
      {"images.txt", "1 1 0 0 0 0 0 0 1 a.png\n0.5 0.5 -1\n", "contradict"},
      {"images.txt", "1 1 0 0 0 0 0 0 1 a.png\n0.5 0.5 7 1 1 8\n", "whose track does not know it"},
      {"images.txt", "# Number of images: 2\n1 1 0 0 0 0 0 0 1 a.png\n0.5 0.5 7\n", "images.txt:1: the file states 2"},
      {"points3D.txt", "7 1 2 3 256 0 0 0.1 1 0\n", "points3D.txt:1: \"256\""},
      {"points3D.txt", "7 1 2 3 0 0 0 0.1 1\n", "points3D.txt:1: index"},
      {"points3D.txt", "7 1 2 3 0 0 0 0.1 1 5\n", "has only 1"},
      {"points3D.txt", "7 1 2 3 0 0 0 0.1 4 0\n", "image 4, which does not exist"},
      {"points3D.txt", "7 1 2 3 0 0 0 0.1 1 0 1 0\n", "contradict"},
  };
  for (const auto& c : cases) {
    const TemporaryFolder folder;
    folder.write("cameras.txt", "1 PINHOLE 100 80 90 90 50 40\n");
    folder.write("images.txt", "1 1 0 0 0 0 0 0 1 a.png\n0.5 0.5 7\n");
    folder.write("points3D.txt", "7 1 2 3 0 0 0 0.1 1 0\n");
    ASSERT_TRUE(read_colmap_model(folder.path())) << read_colmap_model(folder.path()).error().message;
    folder.write(c.file, c.contents);
    expect_refused(folder.path(), c.contents);
    EXPECT_THAT(read_colmap_model(folder.path()).error().message, HasSubstr(c.message));
  }
}

TEST(ColmapDamage, NamesThatAFormatCannotHoldAreRefused) {
  const TemporaryFolder folder;
  ColmapModel scene = tests::colmap_scene();
  scene.images[0].name = "my photo.png";
  EXPECT_FALSE(write_colmap_model(folder.path(), scene, ColmapFormat::kText));
  EXPECT_TRUE(write_colmap_model(folder.path(), scene, ColmapFormat::kBinary));
  scene.images[0].name.clear();
  EXPECT_FALSE(write_colmap_model(folder.path(), scene, ColmapFormat::kBinary));
}

TEST(ColmapDamage, AFolderWithoutAModel) {
  const TemporaryFolder folder;
  expect_refused(folder.path(), "empty");
  EXPECT_FALSE(read_colmap_model(folder / "absent"));
}

}  // namespace
}  // namespace crosstie::base
