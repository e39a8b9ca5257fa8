// One executable: a table of verbs (app/verb.cc), one file each in app/commands.

#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <vector>

#include <fmt/core.h>

#include "app/command_line.h"
#include "app/result_folder.h"
#include "app/session.h"
#include "app/verb.h"
#include "base/file.h"

namespace {

using crosstie::base::ErrorCode;

/// Turns Ctrl-C and SIGTERM into a stop request: the signals are blocked in every thread and waited for in this one. What does not stop
/// soon, since it is in the midst of one long computation, is ended; so is everything at the second signal.
class SignalWatch {
 public:
  SignalWatch() {
    sigemptyset(&signals_);
    sigaddset(&signals_, SIGINT);
    sigaddset(&signals_, SIGTERM);
    sigaddset(&signals_, kDone);
    pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    std::signal(SIGPIPE, SIG_IGN);
    watcher_ = std::jthread([this](const std::stop_token& done) {
      int signal = 0;
      while (sigwait(&signals_, &signal) != 0) {
      }
      if (done.stop_requested()) return;
      source_.request_stop();
      if (sigtimedwait(&signals_, nullptr, &kPatience) == kDone || done.stop_requested()) return;
      constexpr std::string_view kMessage = "\ncrosstie: stopped\n";
      const std::string_view line = isatty(STDERR_FILENO) == 1 ? kMessage : kMessage.substr(1);
      static_cast<void>(!write(STDERR_FILENO, line.data(), line.size()));
      crosstie::app::ResultFolder::abandon_all(static_cast<int>(crosstie::base::ErrorCode::kCancelled));
    });
  }
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;
  ~SignalWatch() {
    watcher_.request_stop();
    pthread_kill(watcher_.native_handle(), kDone);
  }
  [[nodiscard]] std::stop_token token() const { return source_.get_token(); }

 private:
  static constexpr int kDone = SIGUSR1;                                      ///< ends the wait
  static constexpr timespec kPatience{.tv_sec = 0, .tv_nsec = 600'000'000};  ///< Ctrl-C works within a second

  sigset_t signals_{};
  std::stop_source source_;
  std::jthread watcher_;
};

int fail(const crosstie::base::Error& error) {
  fmt::print(stderr, "crosstie: {}\n", crosstie::base::shown(error.message));  // one line, whatever the names in it hold
  return static_cast<int>(error.code);
}

int run(const std::vector<std::string>& words) {
  try {
    auto invocation = crosstie::app::parse_command_line(words, crosstie::app::verbs());
    if (!invocation) return fail(invocation.error());
    if (invocation->verb == nullptr) {
      fmt::print("{}", invocation->text);
      return 0;
    }
    const SignalWatch signals;
    crosstie::app::Session session(invocation->quiet, invocation->threads, signals.token());
    const auto outcome = invocation->verb->run(invocation->arguments, session);
    return outcome ? static_cast<int>(*outcome) : fail(outcome.error());
  } catch (const std::bad_alloc&) {
    return fail({ErrorCode::kFileSystem, "not enough memory"});
  } catch (const std::system_error& error) {
    return fail({ErrorCode::kFileSystem, fmt::format("the system refuses: {}", error.what())});
  } catch (const std::exception& error) {
    return fail({ErrorCode::kInternal, fmt::format("a defect of crosstie: {}", error.what())});
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int code = run({argv + 1, argv + argc});
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  return fail({crosstie::base::ErrorCode::kFileSystem, "cannot write to the standard output"});
}
