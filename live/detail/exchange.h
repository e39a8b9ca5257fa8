#pragma once

#include <atomic>
#include <filesystem>
#include <mutex>
#include <stop_token>
#include <string>
#include <string_view>

#include "live/detail/connection.h"
#include "live/detail/guard.h"
#include "live/detail/slots.h"
#include "live/detail/streams.h"
#include "live/page_server.h"

namespace crosstie::live::detail {

/// What all connections of a server share.
struct Site {
  Feed& feed;
  CommandHandler handler;
  std::mutex handling;  ///< one command at a time
  Guard guard;
  std::filesystem::path results;
  std::string_view page;
  std::string page_policy;
  std::string scene_tag;  ///< makes the versions of this server's scenes differ from those of others
  StreamPace pace;
  Slots streams;
  std::stop_token stop;
};

/// Reads one request from a connection and answers it; nothing where none comes. A stream gives `slot` back and takes one of site.streams.
void exchange(Connection& connection, Site& site, Slot& slot);

}  // namespace crosstie::live::detail
