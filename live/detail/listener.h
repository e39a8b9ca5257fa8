#pragma once

#include <string>

#include "base/file_descriptor.h"
#include "base/result.h"

namespace crosstie::live::detail {

struct Listener {
  base::FileDescriptor socket;
  int port = 0;
};

/// A TCP socket that listens at a numeric address or a name; port 0: any free one. kDevice, naming address and port and what to do.
base::Result<Listener> listen_at(const std::string& address, int port);

/// "127.0.0.1:8137", "[::1]:8137".
std::string host_and_port(const std::string& address, int port);

}  // namespace crosstie::live::detail
