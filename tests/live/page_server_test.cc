#include "live/page_server.h"

#include <chrono>
#include <string>
#include <thread>

#include <nlohmann/json.hpp>

#include "live/detail/page.h"
#include "tests/live/server_fixture.h"

namespace crosstie::live {
namespace {

using base::ErrorCode;
using std::chrono::steady_clock;

class PageServerTest : public ServerTest {};

TEST_F(PageServerTest, ServesThePageWithAStrictPolicy) {
  start();
  const auto answer = get("/");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.body, detail::index_html());
  EXPECT_EQ(answer.field("Content-Type"), "text/html; charset=utf-8");
  EXPECT_EQ(answer.field("Content-Security-Policy"), detail::page_policy(detail::index_html()));
  EXPECT_EQ(answer.field("Content-Length"), std::to_string(answer.body.size()));
  EXPECT_EQ(get("/?window=2").status, 200);
  EXPECT_EQ(get("/favicon.ico").status, 204) << "browsers ask for it; a 404 would be a complaint in their console";
}

TEST_F(PageServerTest, EveryAnswerForbidsCachingGuessingEmbeddingAndTellingOthers) {
  start();
  feed.state.publish("{}");
  folder.write("a.json", "{}");
  for (const char* path : {"/", "/state", "/scene", "/results/a.json", "/results/none", "/none"}) {
    const auto answer = get(path);
    EXPECT_EQ(answer.field("Cache-Control"), "no-store") << path;
    EXPECT_EQ(answer.field("X-Content-Type-Options"), "nosniff") << path;
    EXPECT_EQ(answer.field("Referrer-Policy"), "no-referrer") << path;
    EXPECT_EQ(answer.field("X-Frame-Options"), "DENY") << path;
    EXPECT_NE(answer.field("Content-Security-Policy").find("frame-ancestors 'none'"), std::string::npos) << path;
    EXPECT_EQ(answer.field("Connection"), "close") << path;
    EXPECT_FALSE(answer.has("Access-Control-Allow-Origin")) << path;
  }
  // Those that the HTTP library never sees, too.
  const auto early = get("/", "Range: bytes=0-\r\n");
  EXPECT_EQ(early.field("Cache-Control"), "no-store");
  EXPECT_EQ(early.field("X-Content-Type-Options"), "nosniff");
}

TEST_F(PageServerTest, ServesTheNewestStateAndPictures) {
  start();
  for (const char* path : {"/state", "/camera/left.jpg", "/camera/right.jpg", "/scene"}) {
    EXPECT_EQ(get(path).status, 503) << path << " before the first";
  }
  feed.state.publish("{\"sequence\": 1}");
  feed.state.publish("{\"sequence\": 2}");
  const std::string left("\xff\xd8\0left\xff\xd9", 10), right("\xff\xd8right\xff\xd9", 9);
  feed.pictures[0].publish(left);
  feed.pictures[1].publish(right);
  EXPECT_EQ(get("/state").body, "{\"sequence\": 2}");
  EXPECT_EQ(get("/state").field("Content-Type"), "application/json");
  EXPECT_EQ(get("/camera/left.jpg").body, left);
  EXPECT_EQ(get("/camera/right.jpg").body, right);
  EXPECT_EQ(get("/camera/right.jpg").field("Content-Type"), "image/jpeg");
  // Nothing is packed, whatever the client could unpack.
  EXPECT_EQ(get("/state", "Accept-Encoding: gzip, br\r\n").body, "{\"sequence\": 2}");
}

TEST_F(PageServerTest, TheSceneIsSentAgainOnlyWhereItChanged) {
  start();
  feed.scene.publish("{\"version\": 1}");
  const auto first = get("/scene");
  EXPECT_EQ(first.status, 200);
  EXPECT_EQ(first.body, "{\"version\": 1}");
  const std::string tag = first.field("ETag");
  EXPECT_TRUE(tag.size() > 2 && tag.front() == '"' && tag.back() == '"') << tag;
  for (const std::string& fields :
       {"If-None-Match: " + tag, "If-None-Match: \"x\", W/" + tag, std::string("If-None-Match: *")}) {
    const auto same = get("/scene", fields + "\r\n");
    EXPECT_EQ(same.status, 304) << fields;
    EXPECT_EQ(same.body, "");
    EXPECT_EQ(same.field("ETag"), tag);
    EXPECT_FALSE(same.has("Content-Length"));
  }
  feed.scene.publish("{\"version\": 2}");
  const auto second = get("/scene", "If-None-Match: " + tag + "\r\n");
  EXPECT_EQ(second.status, 200);
  EXPECT_EQ(second.body, "{\"version\": 2}");
  EXPECT_NE(second.field("ETag"), tag);
  // A page that stays open while the program starts anew must not take the new scene 2 for the old one.
  const std::string old = second.field("ETag");
  start();
  EXPECT_EQ(get("/scene", "If-None-Match: " + old + "\r\n").status, 200);
}

TEST_F(PageServerTest, HandsCommandsOverAsTheyCame) {
  start();
  const std::string body = "{\"command\": \"axis\", \"position_mm\": 850.0}";
  const auto answer = post(body, token_field() + "Origin: http://" + own_host() + "\r\nContent-Type: application/json\r\n");
  EXPECT_EQ(answer.status, 202);
  EXPECT_EQ(nlohmann::json::parse(answer.body), nlohmann::json({{"accepted", true}}));
  EXPECT_EQ(answer.field("Content-Type"), "application/json");
  // What would make the library take the body apart does not.
  EXPECT_EQ(post("a=b", token_field() + "Content-Type: multipart/form-data; boundary=x\r\n").status, 202);
  EXPECT_EQ(post("a=b", token_field() + "Content-Type: application/x-www-form-urlencoded\r\n").status, 202);
  EXPECT_EQ(post("no gzip", token_field() + "Content-Encoding: gzip\r\n").status, 202);
  EXPECT_EQ(ask(request("POST", "/command", token_field() + "Transfer-Encoding: chunked\r\n") +
                "4\r\n{\"a\"\r\n3;x=y\r\n: 1\r\n1\r\n}\r\n0\r\n\r\n")
                .status,
            202);
  EXPECT_EQ(commands(), (std::vector<std::string>{body, "a=b", "a=b", "no gzip", "{\"a\": 1}"}));
}

TEST_F(PageServerTest, ACommandsErrorReachesThePage) {
  start();
  const std::vector<std::pair<ErrorCode, int>> statuses = {
      {ErrorCode::kUsage, 400},     {ErrorCode::kBadInput, 422},   {ErrorCode::kNoUniqueSolution, 409},
      {ErrorCode::kCancelled, 409}, {ErrorCode::kFileSystem, 500}, {ErrorCode::kDevice, 502},
      {ErrorCode::kInternal, 500}};
  for (const auto& [code, status] : statuses) {
    const std::string message = "station \"x0850\":\nno scan \u00e4";
    reply = base::fail(code, message);
    const auto answer = post("{}", token_field());
    EXPECT_EQ(answer.status, status);
    EXPECT_EQ(nlohmann::json::parse(answer.body), nlohmann::json({{"error", message}}));
  }
  reply = base::fail(ErrorCode::kUsage, "not UTF-8: \xff");
  EXPECT_EQ(nlohmann::json::parse(post("{}", token_field()).body)["error"], "not UTF-8: \ufffd");
}

TEST_F(PageServerTest, HeadIsGetWithoutTheBody) {
  PageServerOptions options;
  options.max_clients = 4;
  start(options);
  feed.state.publish("{\"sequence\": 1}");
  folder.write("report.html", "<p>report</p>");
  for (const char* path : {"/", "/state", "/results/report.html"}) {
    const auto head = ask(request("HEAD", path)), whole = get(path);
    EXPECT_EQ(head.status, 200) << path;
    EXPECT_EQ(head.body, "") << path;
    EXPECT_EQ(head.field("Content-Length"), std::to_string(whole.body.size())) << path;
    EXPECT_EQ(head.field("Content-Type"), whole.field("Content-Type")) << path;
    EXPECT_EQ(head.field("Accept-Ranges"), "none") << path;
  }
  // Streams end at once and keep no place: that of a client is free as soon as the server saw it hang up.
  const auto head_of = [&](const char* path) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    auto head = ask(request("HEAD", path));
    while (head.status == 503 && std::chrono::steady_clock::now() < end) head = ask(request("HEAD", path));
    return head;
  };
  for (int i = 0; i < 6; ++i) EXPECT_EQ(head_of("/events").field("Content-Type"), "text/event-stream");
  EXPECT_EQ(head_of("/camera/left").status, 200);
  EXPECT_EQ(head_of("/none").status, 404);
  EXPECT_EQ(head_of("/none").body, "");
}

TEST_F(PageServerTest, AClientThatFinishesSendingStillGetsItsAnswer) {
  start();
  feed.state.publish("{}");
  auto client = connect();
  client.send(request("GET", "/state"));
  client.finish_sending();
  EXPECT_EQ(client.answer().body, "{}");
}

TEST_F(PageServerTest, TellsWhereItIs) {
  start();
  EXPECT_EQ(server->url(), "http://127.0.0.1:" + std::to_string(server->port()) + "/#" + std::string(kToken));
}

TEST_F(PageServerTest, IsReachedFromThisComputerOnlyUnlessTold) {
  start();
  // The whole network 127.0.0.0/8 is this computer: a server bound to every address would answer at 127.0.0.2.
  base::FileDescriptor socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK + 1);
  address.sin_port = htons(static_cast<std::uint16_t>(server->port()));
  EXPECT_NE(::connect(socket.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_EQ(errno, ECONNREFUSED);

  PageServerOptions everywhere;
  everywhere.address = "0.0.0.0";
  start(everywhere);
  socket = base::FileDescriptor(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  address.sin_port = htons(static_cast<std::uint16_t>(server->port()));
  EXPECT_EQ(::connect(socket.number(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  EXPECT_EQ(server->url(), "http://127.0.0.1:" + std::to_string(server->port()) + "/#" + std::string(kToken));
}

TEST_F(PageServerTest, ServesIpv6) {
  PageServerOptions options;
  options.address = "::1";
  options.token = kToken;
  options.port = 0;
  auto made = PageServer::start(options, feed, [](const std::string&) { return base::Result<>(); });
  if (!made) GTEST_SKIP() << "no IPv6 here: " << made.error().message;
  EXPECT_EQ((*made)->url(), "http://[::1]:" + std::to_string((*made)->port()) + "/#" + std::string(kToken));
}

TEST_F(PageServerTest, ATakenPortSaysWhatToDo) {
  start();
  PageServerOptions options;
  options.port = server->port();
  options.token = kToken;
  const auto second = PageServer::start(options, feed, [](const std::string&) { return base::Result<>(); });
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kDevice);
  EXPECT_NE(second.error().message.find("127.0.0.1:" + std::to_string(server->port())), std::string::npos)
      << second.error().message;
  EXPECT_NE(second.error().message.find("choose another port"), std::string::npos) << second.error().message;
}

TEST_F(PageServerTest, ItsPortIsFreeAgainAtOnce) {
  start();
  feed.state.publish("{}");
  const int port = server->port();
  EXPECT_EQ(get("/state").status, 200);
  server.reset();
  PageServerOptions options;
  options.port = port;
  options.token = kToken;
  const auto again = PageServer::start(options, feed, [](const std::string&) { return base::Result<>(); });
  EXPECT_TRUE(again) << again.error().message;
}

TEST_F(PageServerTest, RefusesAddressesThatAreNotOurs) {
  PageServerOptions options;
  options.token = kToken;
  options.port = 0;
  for (const char* address : {"192.0.2.1", "no.such.name.invalid"}) {
    options.address = address;
    const auto made = PageServer::start(options, feed, [](const std::string&) { return base::Result<>(); });
    ASSERT_FALSE(made);
    EXPECT_EQ(made.error().code, ErrorCode::kDevice);
    EXPECT_NE(made.error().message.find(address), std::string::npos) << made.error().message;
  }
}

TEST(PageServerOptions, OutOfTheirDomainAreRefused) {
  const auto broken = [](auto change) {
    PageServerOptions options;
    options.token = kToken;
    EXPECT_TRUE(options.validate());
    change(options);
    const auto valid = options.validate();
    return !valid && valid.error().code == ErrorCode::kUsage;
  };
  EXPECT_TRUE(broken([](PageServerOptions& options) { options.address = ""; }));
  EXPECT_TRUE(broken([](PageServerOptions& options) { options.port = -1; }));
  EXPECT_TRUE(broken([](PageServerOptions& options) { options.port = 65536; }));
  EXPECT_TRUE(broken([](PageServerOptions& options) { options.token = ""; }));
  EXPECT_TRUE(broken([](PageServerOptions& options) { options.max_clients = 0; }));
  EXPECT_TRUE(broken([](PageServerOptions& options) { options.max_clients = 65; }));
  EXPECT_TRUE(broken([](PageServerOptions& options) { options.timeout_s = 0.0; }));
  EXPECT_TRUE(broken([](PageServerOptions& options) { options.heartbeat_s = std::nan(""); }));
  EXPECT_TRUE(broken([](PageServerOptions& options) { options.min_event_interval_s = -1.0; }));
}

}  // namespace
}  // namespace crosstie::live
