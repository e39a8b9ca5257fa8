// The writing half of base/file.h.
#include <atomic>
#include <cerrno>
#include <csignal>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "base/detail/posix_file.h"
#include "base/file.h"

namespace crosstie::base {
namespace {

using detail::system_failure;

/// While it lives, a write over the process's file size limit fails with EFBIG instead of ending the process by SIGXFSZ.
class SizeLimitGuard {
 public:
  SizeLimitGuard() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGXFSZ);
    active_ = pthread_sigmask(SIG_BLOCK, &signals_, &before_) == 0;
  }
  SizeLimitGuard(const SizeLimitGuard&) = delete;
  SizeLimitGuard& operator=(const SizeLimitGuard&) = delete;
  ~SizeLimitGuard() {
    if (!active_) return;
    const timespec at_once{};
    while (sigtimedwait(&signals_, nullptr, &at_once) == SIGXFSZ) {
    }
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }

 private:
  sigset_t signals_{};
  sigset_t before_{};
  bool active_ = false;
};

/// A temporary file that is removed unless it became the target. Where the file system can, it has no name until it is complete: what a
/// killed process was writing then goes with the process.
class TemporaryFile {
 public:
  static Result<TemporaryFile> create(const std::filesystem::path& folder, const std::filesystem::path& target) {
    if (::access(kOwnFiles, F_OK) == 0) {  // by which it gets its name
      int nameless = -1;
      do {
        nameless = ::open(folder.c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, 0666);
      } while (nameless < 0 && errno == EINTR);
      if (nameless >= 0) return TemporaryFile({}, nameless);
      if (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL) return system_failure("write", target, errno);
    }
    static std::atomic<unsigned> counter{0};
    for (int attempt = 0; attempt < 1000; ++attempt) {
      std::filesystem::path path = folder / fmt::format(".crosstie-{}-{}.tmp", ::getpid(), counter.fetch_add(1));
      const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
      if (fd >= 0) return TemporaryFile(std::move(path), fd);
      if (errno != EEXIST && errno != EINTR) return system_failure("write", target, errno);
    }
    return system_failure("write", target, EEXIST);
  }
  TemporaryFile(TemporaryFile&& other) noexcept : path_(std::exchange(other.path_, {})), file_(std::move(other.file_)) {}
  TemporaryFile& operator=(TemporaryFile&&) = delete;
  ~TemporaryFile() {
    if (!path_.empty()) ::unlink(path_.c_str());
  }

  Result<> fill(std::string_view contents, const std::filesystem::path& target) {
    while (!contents.empty()) {
      const ssize_t count = ::write(file_.number(), contents.data(), contents.size());
      if (count < 0 && errno != EINTR) return system_failure("write", target, errno);
      if (count > 0) contents.remove_prefix(static_cast<std::size_t>(count));
    }
    if (::fsync(file_.number()) != 0) return system_failure("write", target, errno);
    return {};
  }

  void keep_mode(mode_t mode) { static_cast<void>(::fchmod(file_.number(), mode & 07777)); }

  Result<> become(const std::filesystem::path& target) {
    if (path_.empty()) return name_it(target);
    if (file_.close() != 0 && errno != EINTR) return system_failure("write", target, errno);
    if (::rename(path_.c_str(), target.c_str()) != 0) return system_failure("write", target, errno);
    path_.clear();
    return {};
  }

 private:
  TemporaryFile(std::filesystem::path path, int fd) : path_(std::move(path)), file_(fd) {}

  /// Gives a nameless file the target's name; where that is taken, by way of one beside it. That one belongs to the target, so that the next
  /// write takes away what a process left that was killed between the two.
  Result<> name_it(const std::filesystem::path& target) {
    if (link_to(target)) return {};
    if (errno != EEXIST) return system_failure("write", target, errno);
    const std::string hash = sha256_hex(target.filename().string());
    const std::filesystem::path beside = target.parent_path() / fmt::format(".crosstie-{:.16}.tmp", hash);
    for (int attempt = 0; attempt < 1000; ++attempt) {
      if (link_to(beside)) {
        if (::rename(beside.c_str(), target.c_str()) == 0) return {};
        const int number = errno;
        if (number == ENOENT) continue;  // another writer of the same file took it away
        ::unlink(beside.c_str());
        return system_failure("write", target, number);
      }
      if (errno != EEXIST || (::unlink(beside.c_str()) != 0 && errno != ENOENT)) return system_failure("write", target, errno);
    }
    return system_failure("write", target, EEXIST);
  }

  bool link_to(const std::filesystem::path& name) {
    const std::string self = fmt::format("{}/{}", kOwnFiles, file_.number());
    return ::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, name.c_str(), AT_SYMLINK_FOLLOW) == 0;
  }

  static constexpr const char* kOwnFiles = "/proc/self/fd";

  std::filesystem::path path_;
  FileDescriptor file_;
};

/// Makes the new name itself survive a loss of power. Some file systems cannot sync a folder, which is no failure of the write.
void sync_folder(const std::filesystem::path& folder) {
  const FileDescriptor file(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (file.valid()) static_cast<void>(::fsync(file.number()));
}

}  // namespace

Result<> write_file_atomically(const std::filesystem::path& path, std::string_view contents) {
  if (!path.has_filename()) return system_failure("write", path, EISDIR);
  std::filesystem::path target = path;
  std::error_code error;
  if (std::filesystem::is_symlink(path, error)) {
    target = std::filesystem::weakly_canonical(path, error);
    if (error) return system_failure("write", path, error.value());
  }
  struct stat status {};
  const bool exists = ::stat(target.c_str(), &status) == 0;
  if (!exists && errno != ENOENT) return system_failure("write", path, errno);
  if (exists && S_ISDIR(status.st_mode)) return system_failure("write", path, EISDIR);
  if (exists && !S_ISREG(status.st_mode)) {
    return fail(ErrorCode::kFileSystem, fmt::format("cannot write {}: it exists and is not a regular file", shown(path)));
  }

  const std::filesystem::path folder = target.has_parent_path() ? target.parent_path() : std::filesystem::path(".");
  auto temporary = TemporaryFile::create(folder, path);
  if (!temporary) return fail(std::move(temporary));
  if (exists) temporary->keep_mode(status.st_mode);
  {
    const SizeLimitGuard guard;
    if (auto filled = temporary->fill(contents, path); !filled) return filled;
  }
  if (auto renamed = temporary->become(target); !renamed) return renamed;
  sync_folder(folder);
  return {};
}

}  // namespace crosstie::base
