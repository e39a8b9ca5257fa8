#include "live/detail/streams.h"

#include <chrono>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>

#include "tests/live/server_fixture.h"

namespace crosstie::live {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

class StreamTest : public ServerTest {
 protected:
  /// Without waiting between events.
  void start_fast() {
    PageServerOptions options;
    options.min_event_interval_s = 0.0;
    start(options);
  }
};

/// The data of the next event, other lines of the stream skipped.
std::string next_event(tests::RawClient& client) {
  while (true) {
    const std::string block = client.take_until("\n\n");
    if (!block.starts_with("event: state\n")) continue;
    const std::size_t data = block.find("\ndata: ");
    EXPECT_NE(data, std::string::npos) << block;
    EXPECT_EQ(block.find('\n', data + 1), block.size() - 2) << "one line: " << block;
    return block.substr(data + 7, block.size() - data - 9);
  }
}

/// The picture of the next part; its frame is checked as RFC 2046 has it.
std::string next_picture(tests::RawClient& client) {
  EXPECT_EQ(client.take_until("\r\n"), "--crosstie-picture\r\n");
  EXPECT_EQ(client.take_until("\r\n"), "Content-Type: image/jpeg\r\n");
  const std::string length = client.take_until("\r\n\r\n");
  EXPECT_TRUE(length.starts_with("Content-Length: ")) << length;
  std::string picture = client.take_size(static_cast<std::size_t>(std::atol(length.c_str() + 16)));
  EXPECT_EQ(client.take_size(2), "\r\n");
  return picture;
}

TEST_F(StreamTest, EventsAreTheStateInOneLine) {
  start_fast();
  auto client = connect();
  client.send(request("GET", "/events"));
  const std::string head = client.take_until("\r\n\r\n");
  EXPECT_NE(head.find("Content-Type: text/event-stream\r\n"), std::string::npos) << head;
  EXPECT_NE(head.find("Cache-Control: no-store\r\n"), std::string::npos) << head;
  EXPECT_EQ(head.find("Content-Length"), std::string::npos) << head;
  // Line ends of the JSON text are blanks, those in its strings are escaped already; all mean the same.
  const std::string pretty = "{\r\n  \"log\": [\"a\\nb\"],\n\r\"x\": 1\r}";
  feed.state.publish(pretty);
  const std::string data = next_event(client);
  EXPECT_EQ(data.find_first_of("\r\n"), std::string::npos) << data;
  EXPECT_EQ(nlohmann::json::parse(data), nlohmann::json::parse(pretty));
  feed.state.publish("{\"x\":2}");
  EXPECT_EQ(next_event(client), "{\"x\":2}");
}

TEST(EventText, CannotBeEndedFromWithin) {
  EXPECT_EQ(detail::event_text(7, "{}"), "event: state\nid: 7\ndata: {}\n\n");
  EXPECT_EQ(detail::event_text(8, "a\n\nevent: other\rdata: b\r\n"),
            "event: state\nid: 8\ndata: a  event: other data: b  \n\n");
  EXPECT_EQ(detail::event_text(9, ""), "event: state\nid: 9\ndata: \n\n");
}

TEST_F(StreamTest, ANewClientGetsWhatIsNewestAtOnce) {
  start_fast();
  feed.state.publish("{\"old\": 1}");
  feed.state.publish("{\"new\": 1}");
  feed.pictures[1].publish("old");
  feed.pictures[1].publish("new");
  auto events = open_stream("/events");
  EXPECT_EQ(next_event(events), "{\"new\": 1}");
  auto pictures = open_stream("/camera/right");
  EXPECT_EQ(next_picture(pictures), "new");
}

TEST_F(StreamTest, TwoBrowsersGetAllEventsAndPictures) {
  start_fast();
  std::vector<tests::RawClient> events, left, right;
  for (int browser = 0; browser < 2; ++browser) {
    events.push_back(open_stream("/events"));
    left.push_back(open_stream("/camera/left"));
    right.push_back(open_stream("/camera/right"));
  }
  for (int i = 0; i < 50; ++i) {
    const std::string number = std::to_string(i);
    feed.state.publish("{\"n\": " + number + "}");
    feed.pictures[0].publish("left" + number);
    feed.pictures[1].publish("right" + number);
    for (std::size_t browser = 0; browser < 2; ++browser) {
      ASSERT_EQ(next_event(events[browser]), "{\"n\": " + number + "}");
      ASSERT_EQ(next_picture(left[browser]), "left" + number);
      ASSERT_EQ(next_picture(right[browser]), "right" + number);
    }
    if (i % 25 == 0) {
      EXPECT_EQ(get("/state").status, 200) << "other requests go on meanwhile";
    }
  }
}

TEST_F(StreamTest, PartsHaveBoundariesAndLengths) {
  start_fast();
  auto client = connect();
  client.send(request("GET", "/camera/left"));
  const std::string head = client.take_until("\r\n\r\n");
  EXPECT_NE(head.find("Content-Type: multipart/x-mixed-replace; boundary=crosstie-picture\r\n"), std::string::npos) << head;
  EXPECT_EQ(head.find("Transfer-Encoding"), std::string::npos) << "parts are framed by themselves: " << head;
  std::string all(256, '\0');
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<char>(i);
  for (const std::string& picture :
       {all, std::string(), std::string("\r\n--crosstie-picture\r\n"), std::string(1u << 20, 'p')}) {
    feed.pictures[0].publish(picture);
    EXPECT_EQ(next_picture(client), picture);
  }
  // The boundary comes with the picture that it ends, not with the next one: browsers show a part when it has ended.
  EXPECT_EQ(client.take_size(20), "--crosstie-picture\r\n");
}

TEST_F(StreamTest, EventsComeNoFasterThanTold) {
  PageServerOptions options;
  options.min_event_interval_s = 0.1;
  start(options);
  auto client = open_stream("/events");
  std::jthread publisher([this](const std::stop_token& stop) {
    for (int i = 0; !stop.stop_requested(); ++i) {
      feed.state.publish("{\"n\": " + std::to_string(i) + "}");
      std::this_thread::sleep_for(milliseconds(1));
    }
  });
  std::vector<int> numbers;
  const auto began = steady_clock::now();
  for (int i = 0; i < 6; ++i) numbers.push_back(nlohmann::json::parse(next_event(client))["n"]);
  EXPECT_GE(steady_clock::now() - began, milliseconds(490));
  for (std::size_t i = 1; i < numbers.size(); ++i) EXPECT_GT(numbers[i], numbers[i - 1] + 1) << "states between are left out";
}

TEST_F(StreamTest, TheLastOfSeveralStatesIsNotLost) {
  PageServerOptions options;
  options.min_event_interval_s = 0.1;
  start(options);
  auto client = open_stream("/events");
  for (int i = 0; i <= 20; ++i) feed.state.publish("{\"n\": " + std::to_string(i) + "}");
  while (next_event(client) != "{\"n\": 20}") {
  }
}

TEST_F(StreamTest, ASilentStreamHasAHeartbeat) {
  PageServerOptions options;
  options.heartbeat_s = 0.05;
  start(options);
  auto client = open_stream("/events");
  const auto began = steady_clock::now();
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(client.take_until("\n:").ends_with("\n:"));
  EXPECT_GE(steady_clock::now() - began, milliseconds(190));
  EXPECT_LT(steady_clock::now() - began, milliseconds(1500));
}

TEST_F(StreamTest, ASlowReaderMissesPicturesAndHoldsNobodyUp) {
  start_fast();
  auto slow = open_stream("/camera/left", 4096);
  auto quick = open_stream("/camera/left");
  constexpr int kCount = 300;
  constexpr std::size_t kBytes = 200'000;
  const auto picture = [](int number) {
    std::string bytes(kBytes, static_cast<char>('a' + number % 26));
    return bytes.replace(0, 8, fmt::format("{:08}", number));
  };
  reset_peak();
  const long before_kib = peak_kib();
  std::chrono::nanoseconds longest{0};
  for (int i = 0; i < kCount; ++i) {
    std::string next = picture(i);
    const auto began = steady_clock::now();
    feed.pictures[0].publish(std::move(next));
    longest = std::max(longest, std::chrono::nanoseconds(steady_clock::now() - began));
    ASSERT_EQ(next_picture(quick), picture(i)) << "the quick one gets each";
  }
  EXPECT_LT(longest, milliseconds(250));
  EXPECT_LT(peak_kib() - before_kib, 8 * 1024) << "60 MB were published";
  // Now it reads on: some of the first, then the newest, each whole and none twice.
  std::vector<int> seen;
  while (seen.empty() || seen.back() != kCount - 1) {
    const std::string got = next_picture(slow);
    const int number = std::atoi(got.substr(0, 8).c_str());
    ASSERT_EQ(got, picture(number));
    if (!seen.empty()) {
      ASSERT_GT(number, seen.back());
    }
    seen.push_back(number);
  }
  EXPECT_LT(seen.size(), 12u) << "what the kernel keeps for it, and the newest";
}

TEST_F(StreamTest, AReaderThatStopsIsLetGo) {
  PageServerOptions options;
  options.max_clients = 1;
  options.timeout_s = 0.2;
  start(options);
  auto stopped = open_stream("/camera/left", 4096);
  feed.pictures[0].publish(std::string(4u << 20, 'p'));
  // Its place is free when nothing was taken for the time-out.
  const auto began = steady_clock::now();
  int status = 0;
  while (status != 200 && steady_clock::now() < began + std::chrono::seconds(10)) {
    auto client = connect();
    client.send(request("GET", "/events"));
    status = std::atoi(client.take_until("\r\n").substr(9).c_str());
    std::this_thread::sleep_for(milliseconds(5));
  }
  EXPECT_EQ(status, 200);
  EXPECT_GE(steady_clock::now() - began, milliseconds(190));
  EXPECT_LT(steady_clock::now() - began, milliseconds(1800));
}

TEST_F(StreamTest, AClientThatGoesFreesItsPlace) {
  PageServerOptions options;
  options.max_clients = 2;
  start(options);
  for (int round = 0; round < 2; ++round) {
    auto events = open_stream("/events");
    auto pictures = open_stream("/camera/left");
    EXPECT_EQ(get("/camera/right").status, 503);
    // Nothing is published that could tell the server.
    events.hang_up();
    pictures.hang_up();
    std::this_thread::sleep_for(milliseconds(300));
  }
  auto again = open_stream("/events");
}

TEST_F(StreamTest, ClosingEndsStreamsAtOnce) {
  start_fast();
  std::vector<tests::RawClient> streams;
  for (const char* path : {"/events", "/camera/left", "/camera/right"}) streams.push_back(open_stream(path));
  feed.state.publish("{}");
  EXPECT_EQ(next_event(streams[0]), "{}");
  // One that does not read, in the middle of a picture; one in the middle of its head; one that says nothing.
  auto stopped = open_stream("/camera/left", 4096);
  feed.pictures[0].publish(std::string(4u << 20, 'p'));
  auto half = connect();
  half.send("GET / HT");
  auto silent = connect();
  std::this_thread::sleep_for(milliseconds(50));
  const auto began = steady_clock::now();
  server.reset();
  EXPECT_LT(steady_clock::now() - began, milliseconds(1000));
  for (auto& stream : streams) stream.read_all();
  stopped.read_all();
  half.read_all();
  silent.read_all();
  feed.state.publish("{}");  // the feed outlives its server
}

TEST_F(StreamTest, ManyComeAndGoWhileEverythingIsPublished) {
  start_fast();
  std::jthread publisher([this](const std::stop_token& stop) {
    for (int i = 0; !stop.stop_requested(); ++i) {
      feed.state.publish("{\"n\": " + std::to_string(i) + "}");
      feed.pictures[0].publish(std::string(50'000, 'p'));
      std::this_thread::sleep_for(milliseconds(1));
    }
  });
  for (int round = 0; round < 8; ++round) {
    auto events = connect(), pictures = connect();
    events.send(request("GET", "/events"));
    pictures.send(request("GET", "/camera/left"));
    if (round % 2 == 0) {
      EXPECT_TRUE(pictures.read_until("image/jpeg"));
      EXPECT_TRUE(events.read_until("data: "));
    }
    EXPECT_EQ(get("/state").status, 200);
  }
  server.reset();
}

}  // namespace
}  // namespace crosstie::live
