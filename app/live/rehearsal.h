#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "app/live/live_session.h"
#include "app/session.h"
#include "base/result.h"

namespace crosstie::app {

/// The digital twin in the place of a machine: its cameras answer over GigE Vision on loopback, its axis over TCP, its projector lights its
/// wall, and a helper who does what the page tells holds the board, moves the beam and lays the cross down.
class Rehearsal {
 public:
  virtual ~Rehearsal() = default;
  /// For a session, which must end before this does.
  [[nodiscard]] virtual LiveDevices devices() = 0;
};

/// Makes the twin of a scene, and in `job`, where there is none yet, a job folder without images. Errors: those of the scene, of the folder, and of
/// addresses and ports that are taken.
base::Result<std::unique_ptr<Rehearsal>> begin_rehearsal(const std::string& scene, std::uint64_t seed,
                                                         const std::filesystem::path& job, Session& session);

}  // namespace crosstie::app
