#include "calib/detail/quiet_stderr.h"

#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <mutex>

namespace crosstie::calib::detail {
namespace {

std::mutex& turn() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

QuietStderr::QuietStderr() {
  turn().lock();
  std::fflush(stderr);
  const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (nowhere < 0) return;
  kept_ = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, STDERR_FILENO + 1);
  if (kept_ >= 0) dup2(nowhere, STDERR_FILENO);
  close(nowhere);
}

QuietStderr::~QuietStderr() {
  std::fflush(stderr);
  if (kept_ >= 0) {
    dup2(kept_, STDERR_FILENO);
    close(kept_);
  }
  turn().unlock();
}

}  // namespace crosstie::calib::detail
