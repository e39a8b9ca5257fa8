#pragma once

namespace crosstie::calib::detail {

/// While it lives, nothing reaches the process's stderr: mrcal tells there what it rejects, and a library prints nothing. One at a time;
/// what other threads say meanwhile is lost. Where stderr cannot be moved, it stays.
class QuietStderr {
 public:
  QuietStderr();
  QuietStderr(const QuietStderr&) = delete;
  QuietStderr& operator=(const QuietStderr&) = delete;
  ~QuietStderr();

 private:
  int kept_ = -1;
};

}  // namespace crosstie::calib::detail
