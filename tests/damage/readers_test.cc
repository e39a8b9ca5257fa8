// Every reader of base against every kind of damage: an Error that names the file, never a crash, never an exception, within
// bounded time and memory.
#include <sys/stat.h>

#include <algorithm>
#include <cctype>
#include <cstdio>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/file.h"
#include "tests/damage/readers.h"
#include "tests/support/bounded.h"
#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

namespace fs = std::filesystem;
using base::Error;
using base::ErrorCode;
using testing::HasSubstr;
using testing::Not;

class DamagedInput : public testing::TestWithParam<Reader> {
 protected:
  ~DamagedInput() override { RecordProperty("cases", cases_); }

  /// The place of the reader's file in a folder of that name, with all files that belong to it.
  fs::path place(const fs::path& folder) {
    const Reader& reader = GetParam();
    for (const auto& [name, contents] : reader.beside) folder_.write(folder / name, contents);
    fs::create_directories(folder_ / folder);
    return folder_ / folder / (reader.file.empty() ? "file" : reader.file);
  }

  /// An error, where there is one, names the file on one line and blames the input.
  static void expect_sensible(const std::optional<Error>& error, const fs::path& path) {
    if (!error) return;
    EXPECT_EQ(error->code, ErrorCode::kBadInput) << error->message;
    EXPECT_THAT(error->message, HasSubstr(base::shown(GetParam().file.empty() ? path : path.parent_path())));
    EXPECT_THAT(error->message, Not(HasSubstr("\n")));
    EXPECT_LT(error->message.size(), 700U);
  }

  void expect(const Damage& damage, const fs::path& path) {
    SCOPED_TRACE(GetParam().name + ": " + damage.name);
    ++cases_;
    fs::remove(path);  // a file that is cut and written anew is synced by some file systems, which takes long
    folder_.write(path, damage.bytes);
    const auto error = GetParam().read(path);
    expect_sensible(error, path);
    if (damage.fate == Fate::kAnswered) return;
    EXPECT_EQ(error.has_value(), damage.fate == Fate::kRefused) << (error ? error->message : "was accepted");
  }

  void expect_all(const std::vector<Damage>& damages) {
    const fs::path path = place("in");
    for (const Damage& damage : damages) expect(damage, path);
  }

  TemporaryFolder folder_;
  Bounded bounded_;
  int cases_ = 0;
};

TEST_P(DamagedInput, HarmlessChangesAreRead) {
  auto damages = harmless(GetParam().sample);
  if (!GetParam().takes_mark) std::erase_if(damages, [](const Damage& damage) { return damage.name == "byte order mark"; });
  expect_all(damages);
}

TEST_P(DamagedInput, CutAnywhere) { expect_all(cuts(GetParam().sample)); }

TEST_P(DamagedInput, FlippedBits) { expect_all(flipped_bits(GetParam().sample, 150)); }

TEST_P(DamagedInput, WrongValues) { expect_all(wrong_values(GetParam().sample)); }

TEST_P(DamagedInput, SomethingElseEntirely) {
  expect_all(something_else());
  static const std::vector<Reader> others = readers();
  for (const Reader& other : others) expect({"given " + other.name, other.sample.good}, place("in"));
}

TEST_P(DamagedInput, OddPaths) {
  const std::string longest(120, 'n');
  for (const fs::path& folder : {fs::path("with blank"), fs::path("\xC3\xBC\xE4\xBD\xA0"), fs::path("new\nline"),
                                 fs::path("it's {0} %s"), fs::path(longest) / longest / longest}) {
    const fs::path path = place(folder);
    expect({"undamaged", GetParam().sample.good, Fate::kRead}, path);
    expect({"empty", "", Fate::kRefused}, path);
  }
}

TEST_P(DamagedInput, WhatIsNoFile) {
  const auto refused = [&](const char* what, auto make) {
    SCOPED_TRACE(what);
    ++cases_;
    const fs::path path = place(what);
    make(path);
    const auto error = GetParam().read(path);
    ASSERT_TRUE(error);
    const bool of_a_folder = !GetParam().file.empty();  // which says that the folder lacks one of its files
    EXPECT_TRUE(error->code == ErrorCode::kFileSystem || (of_a_folder && error->code == ErrorCode::kBadInput))
        << error->message;
    EXPECT_THAT(error->message, HasSubstr(of_a_folder ? path.parent_path().string() : path.string()));
  };
  refused("missing", [](const fs::path&) {});
  refused("folder", [](const fs::path& path) { fs::create_directory(path); });
  refused("fifo", [](const fs::path& path) { ASSERT_EQ(mkfifo(path.c_str(), 0600), 0); });
  refused("loop", [](const fs::path& path) { fs::create_symlink(path.filename(), path); });
  refused("dangling", [](const fs::path& path) { fs::create_symlink("nowhere", path); });
  refused("device", [](const fs::path& path) { fs::create_symlink("/dev/zero", path); });
  if (!GetParam().file.empty()) return;
  const auto error = GetParam().read(folder_ / std::string(300, 'n'));
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code, ErrorCode::kFileSystem) << error->message;
}

std::string test_name(const testing::TestParamInfo<Reader>& info) {
  std::string name = info.param.name;
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Base, DamagedInput, testing::ValuesIn(readers()), test_name);

}  // namespace
}  // namespace crosstie::tests
