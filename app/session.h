#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "base/progress.h"

namespace crosstie::app {

/// Hears what a verb tells, in place of the terminal.
struct Listener {
  std::function<void(std::string_view stage, std::size_t done, std::size_t total)> progress;
  std::function<void(std::string_view line)> line;
};

/// What a verb talks through: results on stdout, everything else on stderr, progress bars on a terminal only.
class Session {
 public:
  Session(bool quiet, int threads, std::stop_token stop);
  /// All of it goes to the listener.
  Session(int threads, std::stop_token stop, Listener listener);

  /// Reports to the terminal or the listener; stops on Ctrl-C, or as the token tells.
  [[nodiscard]] base::Progress progress();
  [[nodiscard]] int threads() const { return threads_; }

  /// The folder that a job's results are being written into, wherever it is, with their overview; empty: none is.
  [[nodiscard]] const std::filesystem::path& job_results() const { return job_results_; }
  void set_job_results(std::filesystem::path folder) { job_results_ = std::move(folder); }

  /// A line of the result, on stdout.
  void print(std::string_view line);
  /// A line of talk, on stderr; not with --quiet.
  void say(std::string_view line);

 private:
  void draw_bar(std::string_view stage, std::size_t done, std::size_t total);
  void clear_bar();

  bool quiet_;
  int threads_;
  bool terminal_;
  bool bar_drawn_ = false;
  std::filesystem::path job_results_;
  std::stop_token stop_;
  Listener listener_;  ///< empty: the terminal
  std::mutex mutex_;
};

}  // namespace crosstie::app
