#include "app/session.h"

#include <unistd.h>

#include <cstdio>
#include <utility>

#include <fmt/core.h>

namespace crosstie::app {

Session::Session(bool quiet, int threads, std::stop_token stop)
    : quiet_(quiet), threads_(threads), terminal_(isatty(STDERR_FILENO) == 1), stop_(std::move(stop)) {}

Session::Session(int threads, std::stop_token stop, Listener listener)
    : quiet_(false), threads_(threads), terminal_(false), stop_(std::move(stop)), listener_(std::move(listener)) {}

base::Progress Session::progress() {
  base::Progress progress;
  progress.stop = stop_;
  progress.report = listener_.progress;
  if (terminal_ && !quiet_) {
    progress.report = [this](std::string_view stage, std::size_t done, std::size_t total) { draw_bar(stage, done, total); };
  }
  return progress;
}

void Session::print(std::string_view line) {
  const std::lock_guard lock(mutex_);
  if (listener_.line) return listener_.line(line);
  clear_bar();
  fmt::print(stdout, "{}\n", line);
  std::fflush(stdout);
}

void Session::say(std::string_view line) {
  if (quiet_) return;
  const std::lock_guard lock(mutex_);
  if (listener_.line) return listener_.line(line);
  clear_bar();
  fmt::print(stderr, "{}\n", line);
}

void Session::draw_bar(std::string_view stage, std::size_t done, std::size_t total) {
  constexpr std::size_t kWidth = 30;
  const std::lock_guard lock(mutex_);
  const std::size_t filled = total == 0 ? kWidth : kWidth * done / total;
  fmt::print(stderr, "\r\x1b[K{:<10} [{:#<{}}{:.<{}}] {}/{}", stage, "", filled, "", kWidth - filled, done, total);
  std::fflush(stderr);
  bar_drawn_ = true;
  if (done >= total) clear_bar();
}

void Session::clear_bar() {
  if (!bar_drawn_) return;
  fmt::print(stderr, "\r\x1b[K");
  bar_drawn_ = false;
}

}  // namespace crosstie::app
