#include "app/browser.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "base/file.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::fail;
using base::Result;

constexpr auto kLongest = std::chrono::minutes(5);
constexpr auto kLook = std::chrono::milliseconds(50);

bool can_run(const fs::path& file) {
  std::error_code none;
  return fs::is_regular_file(file, none) && access(file.c_str(), X_OK) == 0;
}

std::optional<fs::path> on_path(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::string_view rest = path == nullptr ? "" : path;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find(':'), rest.size());
    const fs::path file = fs::path(rest.substr(0, end)) / name;
    if (end > 0 && can_run(file)) return file;
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return std::nullopt;
}

/// A folder that goes with all that is in it.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::error_code none;
    std::string pattern = (fs::temp_directory_path(none) / "crosstie-print-XXXXXX").string();
    if (mkdtemp(pattern.data()) != nullptr) path_ = pattern;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// Its process group, which holds the browser's helpers too.
Result<pid_t> start(const std::vector<std::string>& words) {
  std::vector<char*> pointers;
  for (const std::string& word : words)
    pointers.push_back(const_cast<char*>(word.c_str()));  // NOLINT: as posix_spawn wants them
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  for (const int handle : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    posix_spawn_file_actions_addopen(&files, handle, "/dev/null", handle == STDIN_FILENO ? O_RDONLY : O_WRONLY, 0);
  }
  posix_spawnattr_t how;
  posix_spawnattr_init(&how);
  posix_spawnattr_setflags(&how, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&how, 0);
  pid_t process = 0;
  const int error = posix_spawn(&process, pointers.front(), &files, &how, pointers.data(), environ);
  posix_spawnattr_destroy(&how);
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) return fail(ErrorCode::kFileSystem, fmt::format("cannot start {}: {}", words.front(), std::strerror(error)));
  return process;
}

Result<> wait_for(pid_t process, const std::string& name, const base::Progress& progress) {
  const auto latest = std::chrono::steady_clock::now() + kLongest;
  int status = 0;
  const auto end = [&] {
    kill(-process, SIGKILL);
    while (waitpid(process, &status, 0) < 0 && errno == EINTR) {
    }
  };
  while (true) {
    const pid_t ended = waitpid(process, &status, WNOHANG);
    if (ended == process) break;
    if (progress.cancelled()) {
      end();
      return base::cancelled("printing");
    }
    if (std::chrono::steady_clock::now() > latest) {
      end();
      return fail(ErrorCode::kFileSystem, fmt::format("{} did not print within {} minutes", name, kLongest.count()));
    }
    std::this_thread::sleep_for(kLook);
  }
  kill(-process, SIGKILL);  // helpers that outlive it
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
  return fail(ErrorCode::kFileSystem,
              fmt::format("{} ended without printing ({} {})", name, WIFEXITED(status) ? "exit code" : "signal",
                          WIFEXITED(status) ? WEXITSTATUS(status) : WTERMSIG(status)));
}

}  // namespace

Result<fs::path> find_browser(const std::optional<std::string>& wanted) {
  if (wanted) {
    if (wanted->find('/') != std::string::npos && can_run(*wanted)) return fs::path(*wanted);
    if (const auto found = on_path(*wanted)) return *found;
    return fail(ErrorCode::kFileSystem, fmt::format("{}: no program of this name that can be run", *wanted));
  }
  for (const char* name :
       {"chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "microsoft-edge"}) {
    if (const auto found = on_path(name)) return *found;
  }
  return fail(ErrorCode::kFileSystem,
              "no browser on PATH to print with (looked for chromium, google-chrome and microsoft-edge): apt-get install "
              "chromium, or name "
              "one with --browser; every browser prints an opened report, too");
}

Result<> print_as_pdf(const std::string& html, const fs::path& out, const fs::path& browser, const base::Progress& progress) {
  const ScratchFolder scratch;
  if (scratch.path().empty()) return fail(ErrorCode::kFileSystem, "no temporary folder can be made to print from");
  const fs::path page = scratch.path() / "report.html";
  const fs::path pdf = scratch.path() / "report.pdf";
  if (auto written = base::write_file_atomically(page, html); !written) return written;
  std::vector<std::string> words = {browser.string(),
                                    "--headless",
                                    "--enable-unsafe-swiftshader",  // 3D views where there is no graphics card
                                    "--no-first-run",
                                    "--disable-extensions",
                                    "--disable-background-networking",
                                    "--window-size=1240,900",
                                    "--force-device-scale-factor=2",
                                    "--no-pdf-header-footer",
                                    fmt::format("--user-data-dir={}", (scratch.path() / "profile").string()),
                                    fmt::format("--print-to-pdf={}", pdf.string())};
  if (geteuid() == 0)
    words.emplace_back("--no-sandbox");  // Chromium refuses to run as root with it; the page is ours and fetches nothing
  words.push_back("file://" + page.string());
  const auto process = start(words);
  if (!process) return fail(process.error().code, process.error().message);
  if (auto ended = wait_for(*process, browser.string(), progress); !ended) return ended;
  const auto printed = base::read_file(pdf);
  if (!printed || !printed->starts_with("%PDF-")) {
    return fail(ErrorCode::kFileSystem, fmt::format("{} wrote no PDF", browser.string()));
  }
  return base::write_file_atomically(out, *printed);
}

}  // namespace crosstie::app
