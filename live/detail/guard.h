#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "live/detail/answer.h"

namespace crosstie::live::detail {

/// What a path asks for.
struct Target {
  enum class Kind { kPage, kState, kEvents, kStream, kPicture, kScene, kIcon, kResult, kCommand };
  Kind kind = Kind::kPage;
  std::size_t side = 0;   ///< of kStream and kPicture: 0 left, 1 right
  std::string file = {};  ///< of kResult: the path within the results folder, not yet looked at
};

/// `path` is decoded and without its query; nothing where no path of ours is meant.
[[nodiscard]] std::optional<Target> target_of(std::string_view path);

/// What is checked before the HTTP library reads the head of a request: lines that end with CR LF and hold no other control characters,
/// and no Range field (parsing and answering ranges is the library's weak point, and nothing here needs them).
[[nodiscard]] std::optional<Refusal> refuse_head(std::string_view head);

/// What of a request decides whether it is refused. Fields stand as often as they came.
struct RequestFacts {
  std::string method, path;
  std::string local_address;  ///< numeric, of our end of the connection
  std::vector<std::string> hosts = {};
  std::vector<std::string> origins = {};
  std::vector<std::string> tokens = {};
  std::vector<std::string> lengths = {};
  std::vector<std::string> codings = {};
};

class Guard {
 public:
  /// The address that the server was told to listen at, the port that it has.
  Guard(std::string address, int port, std::string token);

  /// In this order: foreign Host 421 (another site's name that was made to point here), path 404, method 405, and for commands foreign
  /// Origin 403, token 401, length 411, 400 and 413.
  [[nodiscard]] std::optional<Refusal> refuse(const RequestFacts& facts) const;

 private:
  [[nodiscard]] bool own_host(std::string_view host, const std::string& local_address) const;
  [[nodiscard]] std::optional<Refusal> refuse_command(const RequestFacts& facts) const;

  std::string address_;
  int port_;
  std::string token_;
};

}  // namespace crosstie::live::detail
