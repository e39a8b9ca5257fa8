#pragma once

#include <sys/resource.h>

#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace crosstie::tests {

/// What is done to a process.
struct Fault {
  std::map<std::string, std::string> environment = {};
  std::vector<std::pair<int, rlim_t>> limits = {};  ///< RLIMIT_..., soft limit
  std::filesystem::path working_folder = {};
  unsigned longest_s = 60;  ///< it is ended where it takes longer
};

/// The fault that failing_calls.c makes: `what` as in CROSSTIE_FAULT, of the calls that change files below a folder.
Fault at_call(const std::string& what, const std::filesystem::path& folder);

/// How a process ended.
struct Ended {
  int exit_code = -1;  ///< -1: by a signal
  int signal = 0;
  std::string out, err;
  double seconds = 0.0;  ///< since the last signal that was sent to it, else since its start
  double used_s = 0.0;   ///< of processor time
  long calls = 0;        ///< counted by failing_calls.c
};

/// The crosstie executable of this build while it runs.
class Running {
 public:
  Running(const std::vector<std::string>& words, const Fault& fault = {});
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;
  ~Running();

  [[nodiscard]] bool ended() const;
  /// Processor time that it has used, s.
  [[nodiscard]] double used_s() const;
  void send(int signal);
  Ended wait();

 private:
  int process_ = -1;
  double since_s_ = 0.0;
  std::filesystem::path folder_;  ///< of what it says
};

inline Ended run_with(const std::vector<std::string>& words, const Fault& fault = {}) { return Running(words, fault).wait(); }

/// All that is in a folder: relative names with their contents; folders end in "/" and have none.
using Files = std::map<std::string, std::string>;
Files files_in(const std::filesystem::path& folder);
/// Makes a folder hold exactly these; what is so already is left alone.
void restore(const std::filesystem::path& folder, const Files& files);
/// Those of them at or below a name.
Files part_of(const Files& files, const std::string& name);
/// Names in which two differ, for messages.
std::string differences(const Files& a, const Files& b);

}  // namespace crosstie::tests
