#include "base/file.h"

#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace crosstie::base {
namespace {

using testing::HasSubstr;
using tests::TemporaryFolder;

std::size_t entries(const std::filesystem::path& folder) {
  return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(folder), {}));
}

TEST(File, WritesAndReadsBack) {
  const TemporaryFolder folder;
  const std::string contents = std::string("a\0b\xff\n", 5) + std::string(300000, 'x');
  for (const char* name : {"plain", "with blank", "\xC3\xBC\xE4\xBD\xA0.txt", "new\nline"}) {
    ASSERT_TRUE(write_file_atomically(folder / name, contents));
    EXPECT_EQ(*read_file(folder / name), contents);
  }
  ASSERT_TRUE(write_file_atomically(folder / "plain", "new"));
  EXPECT_EQ(*read_file(folder / "plain"), "new");
  EXPECT_EQ(entries(folder.path()), 4U) << "a temporary file was left behind";
}

TEST(File, ALongNameCanBeWritten) {
  const TemporaryFolder folder;
  EXPECT_TRUE(write_file_atomically(folder / std::string(255, 'n'), "x"));
  const auto longer = write_file_atomically(folder / std::string(300, 'n'), "x");
  ASSERT_FALSE(longer);
  EXPECT_EQ(longer.error().code, ErrorCode::kFileSystem);
  EXPECT_FALSE(read_file(folder / std::string(300, 'n')));
}

TEST(File, WhatIsNoFileIsNotRead) {
  const TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder / "fifo").c_str(), 0600), 0);
  std::filesystem::create_symlink("loop_b", folder / "loop_a");
  std::filesystem::create_symlink("loop_a", folder / "loop_b");
  for (const std::filesystem::path& path : {folder / "missing", folder.path(), folder / "fifo", folder / "loop_a",
                                            std::filesystem::path("/dev/null"), std::filesystem::path("")}) {
    for (const auto& error : {read_file(path), sha256_of_file(path)}) {
      ASSERT_FALSE(error) << path;
      EXPECT_EQ(error.error().code, ErrorCode::kFileSystem);
      if (!path.empty()) {
        EXPECT_THAT(error.error().message, HasSubstr(path.string()));
      }
    }
  }
}

TEST(File, ReadsNoMoreThanAllowed) {
  const TemporaryFolder folder;
  const auto path = folder.write("ten", "0123456789");
  EXPECT_TRUE(read_file(path, 10));
  const auto refused = read_file(path, 9);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kBadInput);
}

TEST(File, RefusesToReplaceWhatIsNoFile) {
  const TemporaryFolder folder;
  ASSERT_EQ(mkfifo((folder / "fifo").c_str(), 0600), 0);
  std::filesystem::create_directory(folder / "sub");
  std::filesystem::create_symlink("loop", folder / "loop");
  for (const auto& path : {folder / "fifo", folder / "sub", folder / "sub/", folder / "loop", folder / "no/such/file",
                           std::filesystem::path("/dev/full")}) {
    const auto result = write_file_atomically(path, "x");
    ASSERT_FALSE(result) << path;
    EXPECT_EQ(result.error().code, ErrorCode::kFileSystem);
  }
  EXPECT_EQ(entries(folder.path()), 3U);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(File, AReadOnlyFolderIsAnError) {
  if (geteuid() == 0) GTEST_SKIP() << "root may write anywhere";
  const TemporaryFolder folder;
  std::filesystem::permissions(folder.path(), std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
  EXPECT_FALSE(write_file_atomically(folder / "x", "x"));
  std::filesystem::permissions(folder.path(), std::filesystem::perms::owner_all);
}

TEST(File, FollowsALinkAndKeepsTheMode) {
  const TemporaryFolder folder;
  const auto file = folder.write("sub/file", "old");
  std::filesystem::permissions(file, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  std::filesystem::create_symlink("sub/file", folder / "link");
  ASSERT_TRUE(write_file_atomically(folder / "link", "new"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link"));
  EXPECT_EQ(*read_file(file), "new");
  EXPECT_EQ(std::filesystem::status(file).permissions(),
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
}

TEST(File, AFailedWriteLeavesTheOldFileAndNothingElse) {
  const TemporaryFolder folder;
  const auto file = folder.write("file", "old");
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {  // with the signal's default action, which ends the process
    std::signal(SIGXFSZ, SIG_DFL);
    const rlimit limit{8192, 8192};
    setrlimit(RLIMIT_FSIZE, &limit);
    const auto result = write_file_atomically(file, std::string(100000, 'x'));
    const bool right = !result && result.error().code == ErrorCode::kFileSystem &&
                       result.error().message.find(file.string()) != std::string::npos &&
                       result.error().message.find("File too large") != std::string::npos;
    const bool again = write_file_atomically(folder / "small", "y").has_value();
    _exit(right && again ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  EXPECT_EQ(*read_file(file), "old");
  EXPECT_EQ(entries(folder.path()), 2U);
}

TEST(File, AFullDiskIsAnError) {
  // A file system of its own, where this process may mount one.
  const TemporaryFolder folder;
  const auto mount_point = folder / "small";
  std::filesystem::create_directory(mount_point);
  const std::string mount = "mount -t tmpfs -o size=64k tmpfs " + mount_point.string() + " 2>/dev/null";
  if (std::system(mount.c_str()) != 0) GTEST_SKIP() << "may not mount";
  const auto result = write_file_atomically(mount_point / "large", std::string(1 << 20, 'x'));
  const std::size_t left = entries(mount_point);
  EXPECT_EQ(std::system(("umount " + mount_point.string()).c_str()), 0);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("No space left on device"));
  EXPECT_EQ(left, 0U);
}

TEST(File, MakesFolders) {
  const TemporaryFolder folder;
  EXPECT_TRUE(make_folder(folder / "a/b/c"));
  EXPECT_TRUE(make_folder(folder / "a/b/c"));
  const auto file = folder.write("file", "x");
  for (const auto& path : {file, file / "below"}) {
    const auto result = make_folder(path);
    ASSERT_FALSE(result) << path;
    EXPECT_EQ(result.error().code, ErrorCode::kFileSystem);
  }
}

TEST(File, Sha256IsThatOfTheStandard) {
  // FIPS 180-2, appendix B.
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  const TemporaryFolder folder;
  EXPECT_EQ(*sha256_of_file(folder.write("a", std::string(1000000, 'a'))),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(File, PathsInMessagesStayOneLine) { EXPECT_EQ(shown("a\nb\tc d"), "a\\x0ab\\x09c d"); }

}  // namespace
}  // namespace crosstie::base
