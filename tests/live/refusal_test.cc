// Requests that a browser would not send, and those of other sites' pages.
#include <chrono>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include "tests/live/server_fixture.h"

namespace crosstie::live {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

/// Says why, in a form that the page can show.
bool explains(const tests::RawAnswer& answer) {
  const auto body = nlohmann::json::parse(answer.body, nullptr, false);
  return body.is_object() && body.contains("error") && body["error"].is_string() && body["error"] != "" &&
         answer.field("Content-Type") == "application/json";
}

class RefusalTest : public ServerTest {
 protected:
  void expect_alive() { EXPECT_EQ(get("/").status, 200); }
};

TEST_F(RefusalTest, ForeignHosts) {
  start();
  const std::string port = ":" + std::to_string(server->port());
  for (const std::string& own : {"localhost" + port, "127.0.0.1" + port, "[::1]" + port}) {
    EXPECT_EQ(ask("GET / HTTP/1.1\r\nHost: " + own + "\r\n\r\n").status, 200) << own;
  }
  // The name of another site that its owner let point to this computer (DNS rebinding).
  for (const std::string& foreign : {"evil.example" + port, std::string("evil.example"), "localhost.evil.example" + port,
                                     std::string("127.0.0.1"), "0.0.0.0" + port}) {
    const auto answer = ask("GET /state HTTP/1.1\r\nHost: " + foreign + "\r\n\r\n");
    EXPECT_EQ(answer.status, 421) << foreign;
    EXPECT_TRUE(explains(answer)) << answer.body;
  }
  EXPECT_EQ(ask("GET / HTTP/1.0\r\n\r\n").status, 421);
  EXPECT_EQ(ask("GET / HTTP/1.1\r\nHost: " + own_host() + "\r\nHost: evil.example\r\n\r\n").status, 421);
  EXPECT_EQ(ask("POST /command HTTP/1.1\r\nHost: evil.example" + port + "\r\n" + token_field() + "Content-Length: 2\r\n\r\n{}")
                .status,
            421);
  EXPECT_TRUE(commands().empty());
}

TEST_F(RefusalTest, CommandsOfOtherSitesPages) {
  start();
  for (const char* origin : {"http://evil.example", "null", "https://127.0.0.1", "http://127.0.0.1"}) {
    const auto answer = post("{}", token_field() + "Origin: " + origin + "\r\n");
    EXPECT_EQ(answer.status, 403) << origin;
    EXPECT_TRUE(explains(answer)) << answer.body;
  }
  // What asks whether another site's page may send a command is no way either.
  EXPECT_EQ(
      ask(request("OPTIONS", "/command", "Origin: http://evil.example\r\nAccess-Control-Request-Method: POST\r\n")).status,
      405);
  EXPECT_TRUE(commands().empty());
}

TEST_F(RefusalTest, CommandsWithoutTheToken) {
  start();
  const auto without = post("{}", "");
  EXPECT_EQ(without.status, 401);
  EXPECT_TRUE(explains(without)) << without.body;
  for (const char* token : {"0123456789abcdeX", "0123456789abcde", "0123456789abcdef0", ""}) {
    EXPECT_EQ(post("{}", token_field(token)).status, 401) << token;
  }
  EXPECT_EQ(ask(request("POST", "/command?token=" + std::string(kToken), "Content-Length: 2\r\n") + "{}").status, 401);
  EXPECT_TRUE(commands().empty());
  EXPECT_EQ(post("{}", token_field()).status, 202);
}

TEST_F(RefusalTest, UnknownPathsAndMethods) {
  start();
  for (const char* path : {"/none", "/state/", "//", "/State", "/camera", "/camera/middle", "/command/x", "/results", "/%00",
                           "/state%00", "http://127.0.0.1/state", "*"}) {
    const auto answer = get(path);
    EXPECT_EQ(answer.status, 404) << path;
    EXPECT_TRUE(explains(answer)) << answer.body;
  }
  for (const char* method : {"PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "POST"}) {
    const auto answer = ask(request(method, "/state", "Content-Length: 0\r\n"));
    EXPECT_EQ(answer.status, 405) << method;
    EXPECT_EQ(answer.field("Allow"), "GET, HEAD") << method;
  }
  const auto got = get("/command");
  EXPECT_EQ(got.status, 405);
  EXPECT_EQ(got.field("Allow"), "POST");
}

TEST_F(RefusalTest, RangesHoweverMany) {
  start();
  // The request that ends a server of this library without the guard: 200 overlapping ranges of 20 MB want 4 GB.
  {
    std::ofstream(folder / "cloud.ply", std::ios::binary) << "ply";
    std::filesystem::resize_file(folder / "cloud.ply", 20'000'000);
  }
  std::string ranges = "Range: bytes=0-";
  for (int i = 1; i < 200; ++i) ranges += ",0-";
  reset_peak();
  const long before_kib = peak_kib();
  const auto answer = get("/results/cloud.ply", ranges + "\r\n");
  EXPECT_EQ(answer.status, 416);
  EXPECT_TRUE(explains(answer)) << answer.body;
  EXPECT_LT(peak_kib() - before_kib, 8 * 1024);
  for (const char* field : {"Range: bytes=0-1", "range: bytes=0-1", "RANGE:x", "Range: "}) {
    EXPECT_EQ(get("/state", std::string(field) + "\r\n").status, 416) << field;
  }
  EXPECT_EQ(post("{}", token_field() + "Range: bytes=0-\r\n").status, 416);
  expect_alive();
}

TEST_F(RefusalTest, HeadsWithoutEnd) {
  start();
  EXPECT_EQ(get("/", "X-Long: " + std::string(20'000, 'a') + "\r\n").status, 431);
  std::string many;
  for (int i = 0; i < 2'000; ++i) many += fmt::format("X-{}: 1\r\n", i);
  EXPECT_EQ(get("/", many).status, 431);
  EXPECT_EQ(get("/" + std::string(9'000, 'a')).status, 414);
  // 8 MB of a head that never ends are not kept.
  reset_peak();
  const long before_kib = peak_kib();
  auto client = connect();
  client.send("GET / HTTP/1.1\r\n");
  const std::string line(65'536, 'x');
  for (int i = 0; i < 128 && client.send(line); ++i) {
  }
  EXPECT_LT(peak_kib() - before_kib, 4 * 1024);
  expect_alive();
}

TEST_F(RefusalTest, HeadsThatAreNone) {
  start();
  for (const std::string& text :
       {std::string("\r\n\r\n"), std::string("GET\r\n\r\n"), std::string("GET / HTTP/9.9\r\n\r\n"),
        std::string("\x16\x03\x01\x02\r\n\r\n"), std::string("GET / HTTP/1.1\nHost: localhost\n\r\n\r\n"),
        std::string("BREW / HTTP/1.1\r\n\r\n"), request("GET", "/", "A: b\rRange: bytes=0-\r\n"),
        request("GET", "/", "A: b\nRange: bytes=0-\r\n")}) {
    EXPECT_EQ(ask(text).status, 400) << text;
  }
  expect_alive();
}

TEST_F(RefusalTest, BodiesOverTheLimit) {
  start();
  EXPECT_EQ(post(std::string(65'536, 'a'), token_field()).status, 202);
  const auto told = post(std::string(65'537, 'a'), token_field());
  EXPECT_EQ(told.status, 413);
  EXPECT_TRUE(explains(told)) << told.body;
  // Refused by its Content-Length, before anything comes.
  EXPECT_EQ(ask(request("POST", "/command", token_field() + "Content-Length: 100000000000\r\n")).status, 413);
  EXPECT_EQ(ask(request("POST", "/command", token_field() + "Content-Length: 100000\r\nExpect: 100-continue\r\n")).status, 413);

  const std::string chunked = request("POST", "/command", token_field() + "Transfer-Encoding: chunked\r\n");
  const std::string chunk = "1000\r\n" + std::string(4096, 'a') + "\r\n";
  std::string body;
  for (int i = 0; i < 16; ++i) body += chunk;
  EXPECT_EQ(ask(chunked + body + "0\r\n\r\n").status, 202) << "64 KiB exactly";
  EXPECT_EQ(ask(chunked + body + "1\r\na\r\n0\r\n\r\n").status, 413);
  EXPECT_EQ(ask(chunked + "fffffff\r\n" + std::string(70'000, 'a')).status, 413);
  EXPECT_EQ(commands().size(), 2u);

  // A chunk header that never ends.
  reset_peak();
  const long before_kib = peak_kib();
  auto client = connect();
  client.send(chunked + "1;");
  const std::string extension(65'536, 'x');
  for (int i = 0; i < 128 && client.send(extension); ++i) {
  }
  EXPECT_LT(peak_kib() - before_kib, 8 * 1024);
  expect_alive();
}

TEST_F(RefusalTest, BodiesWithoutALengthOrWithTwo) {
  start();
  const std::string token = token_field();
  EXPECT_EQ(ask(request("POST", "/command", token) + "{}").status, 411);
  EXPECT_EQ(ask(request("POST", "/command", token + "Content-Length: x\r\n") + "{}").status, 400);
  EXPECT_EQ(ask(request("POST", "/command", token + "Content-Length: 2\r\nContent-Length: 3\r\n") + "{}").status, 400);
  EXPECT_EQ(
      ask(request("POST", "/command", token + "Content-Length: 2\r\nTransfer-Encoding: chunked\r\n") + "2\r\n{}\r\n0\r\n\r\n")
          .status,
      400);
  EXPECT_EQ(ask(request("POST", "/command", token + "Transfer-Encoding: chunked\r\n") + "zz\r\n{}\r\n0\r\n\r\n").status, 400);
  EXPECT_TRUE(commands().empty());
  // A body that ends before its length is no command.
  auto client = connect();
  client.send(request("POST", "/command", token + "Content-Length: 10\r\n") + "{}");
  client.finish_sending();
  EXPECT_EQ(client.answer().status, 400);
  EXPECT_TRUE(commands().empty());
}

TEST_F(RefusalTest, SlowHeadsAndSlowBodies) {
  PageServerOptions options;
  options.timeout_s = 0.3;
  start(options);
  // A byte now and then, each well before the time-out.
  const auto drip = [&](const std::string& begin) {
    auto client = connect();
    const auto began = steady_clock::now();
    client.send(begin);
    std::jthread dripping([&client](const std::stop_token& stop) {
      while (!stop.stop_requested() && client.send("a")) std::this_thread::sleep_for(milliseconds(20));
    });
    const auto answer = client.answer();
    EXPECT_GE(steady_clock::now() - began, milliseconds(290));
    EXPECT_LT(steady_clock::now() - began, milliseconds(1800));
    return answer;
  };
  const auto head = drip("GET / HTTP/1.1\r\nX: ");
  EXPECT_EQ(head.status, 408);
  EXPECT_TRUE(explains(head)) << head.body;
  const auto body = drip(request("POST", "/command", token_field() + "Content-Length: 1000\r\n"));
  EXPECT_EQ(body.status, 408);
  EXPECT_TRUE(explains(body)) << body.body;
  // A connection that a browser opens in advance ends without a word.
  auto silent = connect();
  EXPECT_EQ(silent.answer().status, 0);
  EXPECT_TRUE(commands().empty());
}

TEST_F(RefusalTest, TooManyStreams) {
  start();
  std::vector<tests::RawClient> streams;
  for (int i = 0; i < 12; ++i)
    streams.push_back(open_stream(i % 3 == 0 ? "/events" : i % 3 == 1 ? "/camera/left" : "/camera/right"));
  const auto began = steady_clock::now();
  const auto thirteenth = get("/events");
  EXPECT_EQ(thirteenth.status, 503);
  EXPECT_TRUE(explains(thirteenth)) << thirteenth.body;
  EXPECT_EQ(get("/camera/left").status, 503);
  EXPECT_LT(steady_clock::now() - began, milliseconds(1000)) << "rather than hanging";
  expect_alive();
  EXPECT_EQ(post("{}", token_field()).status, 202);
}

TEST_F(RefusalTest, TooManyConnections) {
  start();
  auto stream = open_stream("/events");
  std::vector<tests::RawClient> idle;
  const auto keep_one_busy = [&] {
    idle.push_back(connect());
    idle.back().send("GET / HTTP/1.1\r\n");
  };
  for (int i = 0; i < 12; ++i) keep_one_busy();
  // Which of two that come together finds the last place is up to the threads: whoever was refused leaves it to another one.
  for (int in_a_row = 0; in_a_row < 10;) {
    const auto began = steady_clock::now();
    const auto answer = get("/");
    EXPECT_LT(steady_clock::now() - began, milliseconds(1000));
    if (answer.status == 200) {
      in_a_row = 0;
      keep_one_busy();
      ASSERT_LE(idle.size(), 36U) << "there is no end of places";
      continue;
    }
    ++in_a_row;
    EXPECT_EQ(answer.status, 503);
    EXPECT_TRUE(explains(answer)) << answer.body;
  }
  // Streams go on meanwhile.
  feed.state.publish("{\"sequence\": 7}");
  EXPECT_TRUE(stream.read_until("{\"sequence\": 7}"));
  for (auto& one : idle) one.hang_up();
  const auto end = steady_clock::now() + std::chrono::seconds(10);
  while (get("/").status != 200 && steady_clock::now() < end) std::this_thread::sleep_for(milliseconds(5));
  expect_alive();
}

}  // namespace
}  // namespace crosstie::live
