#include "tests/fault/faulty_program.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <set>

#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

namespace fs = std::filesystem;

double now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

void write_to(const fs::path& file, int number) {
  const int handle = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  dup2(handle, number);
  close(handle);
}

/// In the new process: becomes the program.
[[noreturn]] void become(const std::vector<std::string>& words, const Fault& fault, const fs::path& said) {
  write_to(said / "out", STDOUT_FILENO);
  write_to(said / "err", STDERR_FILENO);
  if (!fault.working_folder.empty() && chdir(fault.working_folder.c_str()) != 0) _exit(126);
  for (const auto& [name, value] : fault.environment) setenv(name.c_str(), value.c_str(), 1);
  setenv("CROSSTIE_FAULT_LOG", (said / "calls").c_str(), 1);
  for (const auto& [which, value] : fault.limits) {
    rlimit limit{};
    getrlimit(static_cast<__rlimit_resource>(which), &limit);
    limit.rlim_cur = value;
    setrlimit(static_cast<__rlimit_resource>(which), &limit);
  }
  std::vector<char*> arguments = {const_cast<char*>(CROSSTIE_EXECUTABLE)};
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  alarm(fault.longest_s);
  execv(CROSSTIE_EXECUTABLE, arguments.data());
  _exit(127);
}

}  // namespace

Fault at_call(const std::string& what, const fs::path& folder) {
  // Sanitizers want to be the first library.
  return {{{"LD_PRELOAD", CROSSTIE_FAILING_CALLS},
           {"ASAN_OPTIONS", "verify_asan_link_order=0"},
           {"CROSSTIE_FAULT_FOLDER", folder.string()},
           {"CROSSTIE_FAULT", what}}};
}

Running::Running(const std::vector<std::string>& words, const Fault& fault) {
  std::string name = (fs::temp_directory_path() / "crosstie-said-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("mkdtemp");
  folder_ = name;
  since_s_ = now_s();
  process_ = fork();
  if (process_ == 0) become(words, fault, folder_);
}

Running::~Running() {
  if (process_ > 0) {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

bool Running::ended() const {
  siginfo_t info{};
  return waitid(P_PID, static_cast<id_t>(process_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid == process_;
}

double Running::used_s() const {
  const std::string text = read_all("/proc/" + std::to_string(process_) + "/stat");
  const std::size_t at = text.rfind(')');
  long user = 0;
  long system = 0;
  if (at == std::string::npos ||
      std::sscanf(text.c_str() + at + 1, " %*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %ld %ld", &user, &system) != 2)
    return 0.0;
  return static_cast<double>(user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

void Running::send(int signal) {
  since_s_ = now_s();
  kill(process_, signal);
}

Ended Running::wait() {
  int status = 0;
  rusage used{};
  wait4(process_, &status, 0, &used);
  process_ = -1;
  Ended ended;
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  ended.used_s = seconds(used.ru_utime) + seconds(used.ru_stime);
  ended.seconds = now_s() - since_s_;
  if (WIFEXITED(status)) ended.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) ended.signal = WTERMSIG(status);
  ended.out = read_all(folder_ / "out");
  ended.err = read_all(folder_ / "err");
  ended.calls = std::atol(read_all(folder_ / "calls").c_str());
  return ended;
}

Files files_in(const fs::path& folder) {
  Files files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().lexically_relative(folder).string();
    if (entry.is_directory()) {
      files.emplace(name + "/", "");
    } else {
      files.emplace(name, read_all(entry.path()));
    }
  }
  return files;
}

void restore(const fs::path& folder, const Files& files) {
  const Files present = files_in(folder);
  for (const auto& [name, contents] : present) {
    if (!files.contains(name)) fs::remove_all(folder / name);
  }
  for (const auto& [name, contents] : files) {
    const auto there = present.find(name);
    if (there != present.end() && there->second == contents) continue;
    if (name.ends_with('/')) {
      fs::create_directories(folder / name);
    } else {
      fs::create_directories((folder / name).parent_path());
      fs::remove(folder / name);  // writing over a file makes some file systems sync it, which takes long
      std::ofstream(folder / name, std::ios::binary) << contents;
    }
  }
}

Files part_of(const Files& files, const std::string& name) {
  Files part;
  for (const auto& [file, contents] : files) {
    if (file == name || file.starts_with(name + "/")) part.emplace(file, contents);
  }
  return part;
}

std::string differences(const Files& a, const Files& b) {
  std::set<std::string> names;
  for (const auto& [name, contents] : a) {
    const auto other = b.find(name);
    if (other == b.end())
      names.insert("-" + name);
    else if (other->second != contents)
      names.insert("!" + name);
  }
  for (const auto& [name, contents] : b) {
    if (!a.contains(name)) names.insert("+" + name);
  }
  std::string text;
  for (const std::string& name : names) text += name + " ";
  return text;
}

}  // namespace crosstie::tests
