#include <filesystem>
#include <fstream>
#include <string>

#include <sys/stat.h>

#include "tests/live/server_fixture.h"

namespace crosstie::live {
namespace {

namespace fs = std::filesystem;

class ResultsTest : public ServerTest {
 protected:
  void SetUp() override {
    PageServerOptions options;
    options.results = folder / "job/results";
    fs::create_directories(options.results);
    start(options);
  }
  fs::path put(const fs::path& name, std::string_view contents) const { return folder.write("job/results" / name, contents); }
};

TEST_F(ResultsTest, ServesFilesWithTheirTypes) {
  const std::string bytes("a\0b\r\n", 5);
  for (const auto& [name, type] :
       {std::pair{"calibrate/report.html", "text/html; charset=utf-8"}, std::pair{"calibrate/result.json", "application/json"},
        std::pair{"detect/observations.csv", "text/csv; charset=utf-8"},
        std::pair{"scan/x0850/cloud.ply", "application/octet-stream"}, std::pair{"detect/overlay.png", "image/png"},
        std::pair{"detect/overlay.jpg", "image/jpeg"}, std::pair{"edge/plot.svg", "image/svg+xml"},
        std::pair{"edge/path.ngc", "text/plain; charset=utf-8"}, std::pair{"report.pdf", "application/pdf"},
        std::pair{"name without extension", "application/octet-stream"}}) {
    put(name, bytes);
    std::string path = "/results/" + std::string(name);
    for (std::size_t blank = path.find(' '); blank != std::string::npos; blank = path.find(' ')) path.replace(blank, 1, "%20");
    const auto answer = get(path);
    EXPECT_EQ(answer.status, 200) << name;
    EXPECT_EQ(answer.body, bytes) << name;
    EXPECT_EQ(answer.field("Content-Type"), type) << name;
    EXPECT_EQ(answer.field("Content-Length"), "5") << name;
  }
  put("t\u00fcr.csv", "umlaut");
  EXPECT_EQ(get("/results/t%C3%BCr.csv").body, "umlaut");
  put("empty.json", "");
  const auto empty = get("/results/empty.json");
  EXPECT_EQ(empty.status, 200);
  EXPECT_EQ(empty.body, "");
  EXPECT_EQ(empty.field("Content-Length"), "0");
}

TEST_F(ResultsTest, AFolderIsItsIndex) {
  put("index.html", "overview");
  put("edge/report.html", "report");
  EXPECT_EQ(get("/results/").body, "overview");
  EXPECT_EQ(get("/results/index.html").body, "overview");
  EXPECT_EQ(get("/results/edge/").status, 404) << "never a list of files";
  EXPECT_EQ(get("/results/edge").status, 404);
}

TEST_F(ResultsTest, ReportsCannotReachThePagesOrigin) {
  put("report.html", "<script>sessionStorage</script>");
  put("plot.svg", "<svg/>");
  const std::string policy = get("/results/report.html").field("Content-Security-Policy");
  EXPECT_TRUE(policy.starts_with("sandbox ")) << policy;
  EXPECT_EQ(policy.find("allow-same-origin"), std::string::npos) << policy;
  const std::string picture = get("/results/plot.svg").field("Content-Security-Policy");
  EXPECT_NE(picture.find("default-src 'none'"), std::string::npos) << picture;
}

TEST_F(ResultsTest, NoWayLeadsOut) {
  folder.write("job/job.toml", "secret");
  folder.write("job/results-of-another/secret.txt", "secret");
  put("edge/report.html", "report");
  for (const char* path : {"/results/../job.toml",
                           "/results/%2e%2e/job.toml",
                           "/results/.%2E/job.toml",
                           "/results/..%2fjob.toml",
                           "/results/%2e%2e%2fjob.toml",
                           "/results/edge/../../job.toml",
                           "/results/edge/%2e%2e/%2e%2e/job.toml",
                           "/results//../job.toml",
                           "/results/..%5cjob.toml",
                           "/results/%252e%252e/job.toml",
                           "/results/%u002e%u002e/job.toml",
                           "/results/../results-of-another/secret.txt",
                           "/results-of-another/secret.txt",
                           "/results/%2fetc/passwd",
                           "/results//etc/passwd",
                           "/results/../../../../../../etc/passwd",
                           "/results/edge/report.html%00.txt",
                           "/results/%00",
                           "/results/edge/report.html/",
                           "/results/edge/report.html/..",
                           "/results/%c0%ae%c0%ae/job.toml",
                           "/results/./edge/report.html"}) {
    const auto answer = get(path);
    EXPECT_EQ(answer.status, 404) << path;
    EXPECT_EQ(answer.body.find("secret"), std::string::npos) << path;
    EXPECT_EQ(answer.body.find("root:"), std::string::npos) << path;
  }
  EXPECT_EQ(get("/results/edge//report.html").body, "report");
  EXPECT_EQ(get("/results/edge%2freport.html").body, "report") << "an encoded slash is a slash";
}

TEST_F(ResultsTest, LinksThatLeaveTheFolderAreNotFollowed) {
  const fs::path results = folder / "job/results";
  folder.write("job/secret.txt", "secret");
  put("edge/report.html", "report");
  put(".hidden/a.txt", "hidden");
  fs::create_symlink("../secret.txt", results / "relative.txt");
  fs::create_symlink(folder / "job/secret.txt", results / "absolute.txt");
  fs::create_symlink("..", results / "up");
  fs::create_symlink("relative.txt", results / "chain.txt");
  fs::create_symlink("loop.txt", results / "loop.txt");
  fs::create_symlink("nowhere.txt", results / "dangling.txt");
  fs::create_symlink(".hidden/a.txt", results / "shown.txt");
  fs::create_symlink("edge", results / "latest");
  fs::create_symlink(results / "edge/report.html", results / "report.html");
  for (const char* path : {"relative.txt", "absolute.txt", "up/secret.txt", "up/results/edge/report.html/../../secret.txt",
                           "chain.txt", "loop.txt", "dangling.txt", "shown.txt"}) {
    EXPECT_EQ(get("/results/" + std::string(path)).status, 404) << path;
  }
  EXPECT_EQ(get("/results/latest/report.html").body, "report") << "a link that stays within";
  EXPECT_EQ(get("/results/report.html").body, "report");
  EXPECT_EQ(get("/results/up/results/edge/report.html").body, "report") << "it ends within, wherever it led";
}

TEST_F(ResultsTest, HiddenFilesAndOtherThingsThanFilesAreNotServed) {
  put(".lock", "hidden");
  put(".git/config", "hidden");
  put("edge/.report.html.tmp", "hidden");
  ASSERT_EQ(::mkfifo((folder / "job/results/fifo").c_str(), 0600), 0);
  fs::create_directory(folder / "job/results/folder.html");
  for (const char* path :
       {".lock", "%2elock", ".git/config", "edge/.report.html.tmp", "fifo", "folder.html", "folder.html/", ""}) {
    EXPECT_EQ(get("/results/" + std::string(path)).status, 404) << path;
  }
  put("secret.txt", "of another user");
  ASSERT_EQ(::chmod((folder / "job/results/secret.txt").c_str(), 0), 0);
  if (::geteuid() != 0) {
    EXPECT_EQ(get("/results/secret.txt").status, 404);
  }
}

TEST_F(ResultsTest, LargeFilesAreNotLoaded) {
  constexpr std::uintmax_t kSize = 64u << 20;
  put("cloud.ply", "ply");
  fs::resize_file(folder / "job/results/cloud.ply", kSize);
  auto client = connect();
  reset_peak();
  const long before_kib = peak_kib();
  client.send(request("GET", "/results/cloud.ply"));
  const std::string head = client.take_until("\r\n\r\n");
  EXPECT_NE(head.find("Content-Length: 67108864\r\n"), std::string::npos) << head;
  EXPECT_EQ(client.take_size(3), "ply");
  std::uintmax_t received = 3 + client.bytes.size();
  client.bytes.clear();
  while (received < kSize) {
    ASSERT_TRUE(client.read_size(1));
    received += client.bytes.size();
    client.bytes.clear();
  }
  EXPECT_FALSE(client.read_size(1));
  EXPECT_EQ(received, kSize);
  EXPECT_LT(peak_kib() - before_kib, 8 * 1024);
}

TEST_F(ResultsTest, AFileReplacedMeanwhileIsServedAsItWas) {
  put("cloud.ply", std::string(4u << 20, 'o'));
  auto client = connect(4096);
  client.send(request("GET", "/results/cloud.ply"));
  const std::string head = client.take_until("\r\n\r\n");
  const fs::path fresh = put("fresh.ply", std::string(1u << 20, 'n'));
  fs::rename(fresh, folder / "job/results/cloud.ply");
  client.read_all();
  EXPECT_EQ(client.bytes, std::string(4u << 20, 'o'));
}

TEST(NoResults, AreServedWhereThereIsNoFolder) {
  Feed feed;
  PageServerOptions options;
  options.port = 0;
  options.token = kToken;
  const auto server = PageServer::start(options, feed, [](const std::string&) { return base::Result<>(); });
  ASSERT_TRUE(server);
  for (const char* path : {"/results/", "/results/etc/passwd", "/results/CMakeLists.txt"}) {
    tests::RawClient client((*server)->port());
    client.send(fmt::format("GET {} HTTP/1.1\r\nHost: localhost:{}\r\n\r\n", path, (*server)->port()));
    EXPECT_EQ(client.answer().status, 404) << path;
  }
}

}  // namespace
}  // namespace crosstie::live
