#pragma once

#include <sys/resource.h>
#include <unistd.h>

namespace crosstie::tests {

inline constexpr rlim_t kMemoryLimit = rlim_t{2} << 30;
inline constexpr unsigned kTimeLimit_s = 60;

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kLimitsMemory = false;  // sanitizers reserve far more than they use
#else
inline constexpr bool kLimitsMemory = true;
#endif

/// While it lives, this process has a limited address space and is ended when it takes too long.
class Bounded {
 public:
  Bounded() {
    getrlimit(RLIMIT_AS, &before_);
    if (kLimitsMemory) {
      const rlimit limited{kMemoryLimit, before_.rlim_max};
      setrlimit(RLIMIT_AS, &limited);
    }
    alarm(kTimeLimit_s);
  }
  Bounded(const Bounded&) = delete;
  Bounded& operator=(const Bounded&) = delete;
  ~Bounded() {
    alarm(0);
    setrlimit(RLIMIT_AS, &before_);
  }

 private:
  rlimit before_{};
};

}  // namespace crosstie::tests
