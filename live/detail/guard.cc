#include "live/detail/guard.h"

#include <algorithm>
#include <array>
#include <utility>

#include "base/text.h"
#include "live/detail/connection.h"
#include "live/detail/listener.h"
#include "live/detail/token.h"

namespace crosstie::live::detail {
namespace {

/// ASCII, whatever the locale.
char lower(char one) { return one >= 'A' && one <= 'Z' ? static_cast<char>(one - 'A' + 'a') : one; }

bool same_word(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) { return lower(x) == lower(y); });
}

bool has_prefix(std::string_view text, std::string_view prefix) {
  return text.size() >= prefix.size() && same_word(text.substr(0, prefix.size()), prefix);
}

}  // namespace

std::optional<Target> target_of(std::string_view path) {
  using Kind = Target::Kind;
  static const std::array kPaths = {
      std::pair{"/", Target{Kind::kPage}},
      std::pair{"/state", Target{Kind::kState}},
      std::pair{"/events", Target{Kind::kEvents}},
      std::pair{"/camera/left", Target{Kind::kStream, 0}},
      std::pair{"/camera/right", Target{Kind::kStream, 1}},
      std::pair{"/camera/left.jpg", Target{Kind::kPicture, 0}},
      std::pair{"/camera/right.jpg", Target{Kind::kPicture, 1}},
      std::pair{"/scene", Target{Kind::kScene}},
      std::pair{"/favicon.ico", Target{Kind::kIcon}},
      std::pair{"/command", Target{Kind::kCommand}},
  };
  for (const auto& [known, target] : kPaths) {
    if (path == known) return target;
  }
  constexpr std::string_view kResults = "/results/";
  if (path.starts_with(kResults)) return Target{Kind::kResult, 0, std::string(path.substr(kResults.size()))};
  return std::nullopt;
}

std::optional<Refusal> refuse_head(std::string_view head) {
  for (std::size_t i = 0; i < head.size(); ++i) {
    const auto byte = static_cast<unsigned char>(head[i]);
    const bool line_end =
        (byte == '\r' && i + 1 < head.size() && head[i + 1] == '\n') || (byte == '\n' && i > 0 && head[i - 1] == '\r');
    if ((byte < 0x20 && byte != '\t' && !line_end) || byte == 0x7f) {
      return Refusal{400, "the head of the request holds control characters"};
    }
  }
  for (std::size_t begin = head.find("\r\n"); begin != std::string_view::npos; begin = head.find("\r\n", begin + 2)) {
    if (has_prefix(head.substr(begin + 2), "range:")) return Refusal{416, "parts of files are not served: ask without Range"};
  }
  return std::nullopt;
}

Guard::Guard(std::string address, int port, std::string token)
    : address_(std::move(address)), port_(port), token_(std::move(token)) {}

bool Guard::own_host(std::string_view host, const std::string& local_address) const {
  // The local address stands for 0.0.0.0 and ::, at which nobody is reached.
  for (const std::string_view name : {std::string_view("localhost"), std::string_view("127.0.0.1"), std::string_view("::1"),
                                      std::string_view(address_), std::string_view(local_address)}) {
    const std::string own = host_and_port(std::string(name), port_);
    if (!name.empty() && (same_word(host, own) || (port_ == 80 && same_word(host, own.substr(0, own.rfind(':')))))) return true;
  }
  return false;
}

std::optional<Refusal> Guard::refuse(const RequestFacts& facts) const {
  if (facts.hosts.size() != 1 || !own_host(facts.hosts.front(), facts.local_address)) {
    return Refusal{421, "this server has another name: open the address that the program printed"};
  }
  const auto target = target_of(facts.path);
  if (!target) return Refusal{404, "there is nothing under this path"};
  const bool command = target->kind == Target::Kind::kCommand;
  if (command ? facts.method != "POST" : facts.method != "GET" && facts.method != "HEAD") {
    const std::string allow = command ? "POST" : "GET, HEAD";
    return Refusal{405, "this path has the methods " + allow + " only", allow};
  }
  return command ? refuse_command(facts) : std::nullopt;
}

std::optional<Refusal> Guard::refuse_command(const RequestFacts& facts) const {
  // Programs that are no browsers send no Origin; browsers send one with every POST.
  if (facts.origins.size() > 1 ||
      (facts.origins.size() == 1 && !same_word(facts.origins.front(), "http://" + facts.hosts.front()))) {
    return Refusal{403, "commands come from the page itself only"};
  }
  if (facts.tokens.size() != 1 || !same_token(facts.tokens.front(), token_)) {
    return Refusal{401, "the token is missing or another session's: open the address that the program printed last"};
  }
  if (!facts.codings.empty()) {
    if (facts.codings.size() > 1 || !facts.lengths.empty() || !same_word(facts.codings.front(), "chunked")) {
      return Refusal{400, "the body's length is told twice, or in a way that is not known here"};
    }
    return std::nullopt;
  }
  if (facts.lengths.empty()) return Refusal{411, "a command needs a body and its Content-Length"};
  const std::string& length = facts.lengths.front();
  if (facts.lengths.size() > 1 || length.empty() || length.find_first_not_of("0123456789") != std::string::npos) {
    return Refusal{400, "Content-Length is no number"};
  }
  const auto bytes = base::parse_int(length);
  if (!bytes || static_cast<std::size_t>(*bytes) > kMaxBodyBytes) return Refusal{413, "a command has 64 KiB at most"};
  return std::nullopt;
}

}  // namespace crosstie::live::detail
