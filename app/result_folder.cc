#include "app/result_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <mutex>
#include <set>
#include <system_error>
#include <utility>

#include <fmt/core.h>

#include "base/file.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

fs::path beside(const fs::path& target, const char* ending) {
  return target.parent_path() / fmt::format(".{}{}", target.filename().string(), ending);
}

tl::unexpected<base::Error> failed(const char* what, const fs::path& path, const std::error_code& error) {
  return base::fail(ErrorCode::kFileSystem, fmt::format("cannot {} {}: {}", what, path.string(), error.message()));
}

/// A result is replaced as a whole, so only an empty folder or an earlier result may stand in its place.
bool is_ours(const fs::path& folder) {
  std::error_code error;
  return !fs::exists(folder, error) || fs::is_empty(folder, error) || fs::exists(folder / "result.json", error);
}

/// Opens and locks the file; a file that its last owner has unlinked meanwhile is opened anew.
Result<int> take_lock(const fs::path& path) {
  while (true) {
    const int handle = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
    if (handle < 0) return failed("write into", path.parent_path(), {errno, std::generic_category()});
    if (flock(handle, LOCK_EX | LOCK_NB) != 0) {
      close(handle);
      return base::fail(ErrorCode::kFileSystem,
                        fmt::format("another crosstie holds {}; wait until it has finished", path.string()));
    }
    struct stat mine {};
    struct stat current {};
    if (fstat(handle, &mine) == 0 && stat(path.c_str(), &current) == 0 && mine.st_ino == current.st_ino) return handle;
    close(handle);
  }
}

void sync_folder(const fs::path& folder) {
  const int handle = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (handle < 0) return;
  fsync(handle);
  close(handle);
}

/// The temporary names of all folders in the making. Who holds the mutex keeps them from being put in their places.
struct InTheMaking {
  std::mutex mutex;
  std::set<fs::path> paths;

  void add(const fs::path& path) {
    const std::lock_guard lock(mutex);
    paths.insert(path);
  }
  void forget(const fs::path& path) {
    const std::lock_guard lock(mutex);
    paths.erase(path);
  }
};

InTheMaking& in_the_making() {
  static InTheMaking& all = *new InTheMaking;  // never destroyed: another thread may end the process at any time
  return all;
}

fs::path normal(const fs::path& target) {
  std::error_code error;
  fs::path path = fs::absolute(target, error).lexically_normal();
  return path.has_filename() ? path : path.parent_path();
}

}  // namespace

void ResultFolder::clear_leftovers(const fs::path& target) {
  const fs::path path = normal(target);
  const fs::path staging = beside(path, ".partial");
  const fs::path lock_file = beside(path, ".lock");
  std::error_code ignored;
  if (!fs::exists(staging, ignored) && !fs::exists(lock_file, ignored)) return;
  const auto lock = take_lock(lock_file);
  if (!lock) return;
  fs::remove_all(staging, ignored);
  fs::remove(lock_file, ignored);
  close(*lock);
}

void ResultFolder::abandon_all(int exit_code) {
  InTheMaking& all = in_the_making();
  all.mutex.lock();  // for good
  std::error_code error;
  for (auto path = all.paths.rbegin(); path != all.paths.rend();
       ++path) {  // .NAME.partial before the .NAME.lock that guards it
    // Other threads may still write into it.
    for (int attempt = 0; attempt < 20 && fs::exists(*path, error); ++attempt) fs::remove_all(*path, error);
  }
  _exit(exit_code);
}

Result<ResultFolder> ResultFolder::begin(const fs::path& target, bool (*may_replace)(const fs::path&)) {
  ResultFolder folder;
  std::error_code error;
  folder.target_ = normal(target);
  if (fs::exists(folder.target_, error) && !fs::is_directory(folder.target_, error)) {
    return base::fail(ErrorCode::kFileSystem, fmt::format("{} is a file; results need a folder", target.string()));
  }
  if (auto made = base::make_folder(folder.target_.parent_path()); !made) return base::fail(std::move(made));

  if (!is_ours(folder.target_) && (may_replace == nullptr || !may_replace(folder.target_))) {
    return base::fail(ErrorCode::kFileSystem,
                      fmt::format("{} holds files that are no crosstie result and would be lost; name a new or empty folder",
                                  target.string()));
  }
  auto lock = take_lock(beside(folder.target_, ".lock"));
  if (!lock) return base::fail(std::move(lock));
  folder.lock_ = *lock;
  in_the_making().add(beside(folder.target_, ".lock"));
  const fs::path staging = beside(folder.target_, ".partial");
  fs::remove_all(staging, error);
  if (!fs::create_directory(staging, error)) return failed("create", staging, error);
  folder.staging_ = staging;
  in_the_making().add(staging);
  return folder;
}

ResultFolder::ResultFolder(ResultFolder&& other) noexcept
    : target_(std::move(other.target_)), staging_(std::exchange(other.staging_, {})), lock_(std::exchange(other.lock_, -1)) {}

ResultFolder::~ResultFolder() {
  std::error_code ignored;
  if (!staging_.empty() && fs::remove_all(staging_, ignored) == static_cast<std::uintmax_t>(-1)) {
    fs::remove(staging_, ignored);  // where no handle is left to look into it, it holds nothing
  }
  if (!staging_.empty()) in_the_making().forget(staging_);
  if (lock_ >= 0) {
    fs::remove(beside(target_, ".lock"), ignored);
    in_the_making().forget(beside(target_, ".lock"));
    close(lock_);
  }
}

bool ResultFolder::keep(const fs::path& name) const {
  std::error_code error;
  if (!fs::is_regular_file(target_ / name, error)) return false;
  fs::create_directories((staging_ / name).parent_path(), error);
  fs::copy_file(target_ / name, staging_ / name, fs::copy_options::overwrite_existing, error);
  return !error;
}

Result<> ResultFolder::commit() {
  sync_folder(staging_);
  std::error_code error;
  {
    const std::lock_guard lock(in_the_making().mutex);
    if (fs::exists(target_, error)) {
      // Both names change places in one step; the old result is then under the temporary name and goes with it.
      if (renameat2(AT_FDCWD, staging_.c_str(), AT_FDCWD, target_.c_str(), RENAME_EXCHANGE) != 0) {
        return failed("replace", target_, {errno, std::generic_category()});
      }
    } else {
      fs::rename(staging_, target_, error);
      if (error) return failed("create", target_, error);
    }
  }
  fs::remove_all(staging_, error);
  in_the_making().forget(staging_);
  staging_.clear();
  sync_folder(target_.parent_path());
  return {};
}

}  // namespace crosstie::app
