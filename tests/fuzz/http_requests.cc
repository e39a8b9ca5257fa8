// What a client may send to the operator's page: a connection's bytes, through the guard and the HTTP library up to the answer. Bytes that
// the client sends all at once, then it says no more.
#include <string>

#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include "live/detail/exchange.h"
#include "tests/fuzz/input.h"

namespace {

using namespace crosstie;
using base::FileDescriptor;

constexpr std::string_view kToken = "0123456789abcdef";
constexpr std::string_view kSecret = "not for clients";
constexpr std::size_t kLargest = 100'000;  // goes into the socket at once

/// A folder of results beside which lies a file that nobody may read.
std::filesystem::path results() {
  const auto folder = fuzz::folder() / "results";
  std::filesystem::create_directories(folder / "scan");
  fuzz::file("secret.txt", kSecret);
  fuzz::file("results/index.html", "<html>index</html>");
  fuzz::file("results/.hidden", kSecret);
  fuzz::file("results/scan/report.html", "<html>report</html>");
  fuzz::file("results/scan/cloud.ply", "ply\n");
  std::filesystem::create_symlink(fuzz::folder() / "secret.txt", folder / "link.txt");
  return folder;
}

live::Feed& feed() {
  static live::Feed made;
  if (made.state.version() == 0) {
    made.state.publish("{\"stage\": 1}");
    made.scene.publish("{}");
    made.pictures[0].publish("\xff\xd8\xff picture");
  }
  return made;
}

/// Of the request that is being answered.
std::string_view current_input;

live::detail::Site& site() {
  static live::detail::Site made{.feed = feed(),
                                 .handler = [](const std::string& body) -> base::Result<> {
                                   fuzz::expect(current_input.find(kToken) != std::string_view::npos,
                                                "commands carry the token");
                                   if (body.size() % 2 == 1) return base::fail(base::ErrorCode::kBadInput, body);
                                   return {};
                                 },
                                 .handling = {},
                                 .guard = live::detail::Guard("127.0.0.1", 8137, std::string(kToken)),
                                 .results = results(),
                                 .page = "<html>page</html>",
                                 .page_policy = "default-src 'self'",
                                 .scene_tag = "tag",
                                 .pace = {0.01, 0.0},
                                 .streams = live::detail::Slots(4),
                                 .stop = {}};
  return made;
}

std::string answer_to(std::string_view request) {
  int ends[2];
  fuzz::expect(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends) == 0, "there are sockets");
  FileDescriptor client(ends[0]);
  live::detail::Connection connection(FileDescriptor(ends[1]), std::chrono::seconds(2));
  const int buffer = 2 * static_cast<int>(kLargest);
  ::setsockopt(ends[0], SOL_SOCKET, SO_SNDBUF, &buffer, sizeof buffer);
  const ssize_t sent = ::send(ends[0], request.data(), request.size(), MSG_NOSIGNAL);
  fuzz::expect(sent == static_cast<ssize_t>(request.size()), "the request is sent");
  ::shutdown(ends[0], SHUT_WR);
  live::detail::Slots requests(1);
  live::detail::Slot slot = requests.take();
  live::detail::exchange(connection, site(), slot);
  connection.end(std::chrono::milliseconds(100));
  std::string answer;
  char bytes[4096];
  for (ssize_t count = 0; (count = ::recv(ends[0], bytes, sizeof bytes, 0)) > 0;)
    answer.append(bytes, static_cast<std::size_t>(count));
  return answer;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0 || size > kLargest) return 0;
  current_input = fuzz::text_of(data, size);
  const std::string answer = answer_to(current_input);
  if (answer.empty()) return 0;  // the head was not complete
  fuzz::expect(answer.starts_with("HTTP/1."), "an answer is HTTP");
  const auto head_end = answer.find("\r\n\r\n");
  fuzz::expect(head_end != std::string::npos, "an answer's head ends");
  const std::string_view head = std::string_view(answer).substr(0, head_end);
  fuzz::expect(head.find("\r\nHTTP/1.") == std::string_view::npos, "an answer has one status");
  // The refusal of a command may quote it.
  const bool told_by_client = current_input.find(kSecret) != std::string_view::npos;
  fuzz::expect(told_by_client || answer.find(kSecret) == std::string::npos, "files beside the results are not shown");
  return 0;
}
