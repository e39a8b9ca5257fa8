#include "base/detail/posix_file.h"

#include <cerrno>
#include <system_error>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "base/file.h"

namespace crosstie::base::detail {

tl::unexpected<Error> system_failure(std::string_view doing, const std::filesystem::path& path, int number) {
  return fail(ErrorCode::kFileSystem,
              fmt::format("cannot {} {}: {}", doing, shown(path), std::generic_category().message(number)));
}

Result<FileDescriptor> open_regular(const std::filesystem::path& path) {
  int fd = -1;
  do {
    fd = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
  } while (fd < 0 && errno == EINTR);
  if (fd < 0) return system_failure("open", path, errno);
  FileDescriptor file(fd);
  struct stat status {};
  if (::fstat(fd, &status) != 0) return system_failure("open", path, errno);
  if (S_ISDIR(status.st_mode)) return system_failure("read", path, EISDIR);
  if (!S_ISREG(status.st_mode)) {
    return fail(ErrorCode::kFileSystem, fmt::format("cannot read {}: it is not a regular file", shown(path)));
  }
  return file;
}

long read_some(int fd, char* buffer, std::size_t size) {
  for (;;) {
    const ssize_t count = ::read(fd, buffer, size);
    if (count >= 0 || errno != EINTR) return count;
  }
}

}  // namespace crosstie::base::detail
