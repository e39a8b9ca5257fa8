#include "live/detail/guard.h"

#include <set>
#include <string>

#include <gtest/gtest.h>

#include "live/detail/token.h"
#include "live/page_server.h"

namespace crosstie::live::detail {
namespace {

RequestFacts get(const std::string& host) {
  return {.method = "GET", .path = "/state", .local_address = "10.1.2.3", .hosts = {host}};
}

int status(const std::optional<Refusal>& refusal) { return refusal ? refusal->status : 200; }

TEST(Guard, KnowsItsOwnNamesOnly) {
  const Guard guard("machine-pc", 8137, "0123456789abcdef");
  for (const char* own :
       {"localhost:8137", "LOCALHOST:8137", "127.0.0.1:8137", "[::1]:8137", "machine-pc:8137", "10.1.2.3:8137"}) {
    EXPECT_EQ(status(guard.refuse(get(own))), 200) << own;
  }
  for (const char* foreign :
       {"", "localhost", "127.0.0.1", "127.0.0.1:8138", "127.0.0.1:81370", "evil.example:8137", "127.0.0.1.evil.example:8137",
        "localhost.:8137", "localhost:8137.evil.example", "user@localhost:8137", "::1:8137", "127.1:8137", "0.0.0.0:8137",
        "10.1.2.4:8137", " localhost:8137", "localhost:08137"}) {
    EXPECT_EQ(status(guard.refuse(get(foreign))), 421) << foreign;
  }
  RequestFacts none = get("localhost:8137");
  none.hosts.clear();
  EXPECT_EQ(status(guard.refuse(none)), 421);
  RequestFacts two = get("localhost:8137");
  two.hosts.emplace_back("evil.example:8137");
  EXPECT_EQ(status(guard.refuse(two)), 421);
}

TEST(Guard, AtPortEightyBrowsersLeaveThePortOut) {
  const Guard guard("0.0.0.0", 80, "0123456789abcdef");
  for (const char* own : {"localhost", "localhost:80", "[::1]", "10.1.2.3", "10.1.2.3:80"}) {
    EXPECT_EQ(status(guard.refuse(get(own))), 200) << own;
  }
  EXPECT_EQ(status(guard.refuse(get("evil.example"))), 421);
}

TEST(Guard, AskedForACommandInThisOrder) {
  const Guard guard("127.0.0.1", 8137, "0123456789abcdef");
  const RequestFacts good{.method = "POST",
                          .path = "/command",
                          .local_address = "127.0.0.1",
                          .hosts = {"localhost:8137"},
                          .origins = {"http://localhost:8137"},
                          .tokens = {"0123456789abcdef"},
                          .lengths = {"65536"}};
  EXPECT_EQ(status(guard.refuse(good)), 200);
  RequestFacts facts = good;
  facts.origins.clear();
  EXPECT_EQ(status(guard.refuse(facts)), 200) << "programs send no Origin";
  facts.lengths = {"65537"};
  EXPECT_EQ(status(guard.refuse(facts)), 413);
  facts.lengths = {"99999999999999999999999999"};
  EXPECT_EQ(status(guard.refuse(facts)), 413);
  for (const char* length : {"", "-1", "+1", "0x10", "1 1", "1,1"}) {
    facts.lengths = {length};
    EXPECT_EQ(status(guard.refuse(facts)), 400) << length;
  }
  facts.lengths = {"1", "2"};
  EXPECT_EQ(status(guard.refuse(facts)), 400);
  facts.lengths.clear();
  EXPECT_EQ(status(guard.refuse(facts)), 411);
  facts.codings = {"Chunked"};
  EXPECT_EQ(status(guard.refuse(facts)), 200);
  facts.codings = {"gzip, chunked"};
  EXPECT_EQ(status(guard.refuse(facts)), 400);
  facts.codings = {"chunked"};
  facts.lengths = {"1"};
  EXPECT_EQ(status(guard.refuse(facts)), 400) << "two lengths";
  for (const char* token : {"", "0123456789abcde", "0123456789abcdef0", "0123456789abcdeF", "1123456789abcdef"}) {
    facts.tokens = {token};
    EXPECT_EQ(status(guard.refuse(facts)), 401) << token;
  }
  facts.tokens = {"0123456789abcdef", "0123456789abcdef"};
  EXPECT_EQ(status(guard.refuse(facts)), 401);
  for (const char* origin : {"null", "", "http://evil.example", "https://localhost:8137", "http://localhost:81",
                             "http://127.0.0.1:8137", "http://localhost:8137.evil.example"}) {
    facts.origins = {origin};
    EXPECT_EQ(status(guard.refuse(facts)), 403) << origin;
  }
  facts.method = "GET";
  EXPECT_EQ(status(guard.refuse(facts)), 405);
  facts.path = "/comman";
  EXPECT_EQ(status(guard.refuse(facts)), 404);
  facts.hosts = {"evil.example:8137"};
  EXPECT_EQ(status(guard.refuse(facts)), 421);
}

TEST(Guard, HeadsAreCleanAndWithoutRange) {
  EXPECT_FALSE(refuse_head("GET / HTTP/1.1\r\nHost: x\r\nX-Range: bytes=0-\r\nTab:\ta\r\n\r\n"));
  for (const char* head : {"GET / HTTP/1.1\r\nRange: bytes=0-\r\n\r\n", "GET / HTTP/1.1\r\nHost: x\r\nrANGE:x\r\n\r\n",
                           "GET / HTTP/1.1\r\nrange:\r\n\r\n"}) {
    EXPECT_EQ(status(refuse_head(head)), 416) << head;
  }
  const std::string zero("GET / HTTP/1.1\r\nA: \0\r\n\r\n", 25);
  for (const std::string& head :
       {std::string("GET / HTTP/1.1\nRange: bytes=0-\r\n\r\n"), std::string("GET / HTTP/1.1\r\nA: b\rRange: 0\r\n\r\n"),
        std::string("GET / HTTP/1.1\r\nA: \x1b[2J\r\n\r\n"), zero}) {
    EXPECT_EQ(status(refuse_head(head)), 400) << head;
  }
}

TEST(Token, ComesFromTheSystemsRandomSource) {
  std::set<std::string> tokens;
  for (int i = 0; i < 100; ++i) {
    const std::string token = make_token();
    EXPECT_EQ(token.size(), 32u);
    EXPECT_EQ(token.find_first_not_of("0123456789abcdef"), std::string::npos) << token;
    EXPECT_TRUE(valid_token(token));
    tokens.insert(token);
  }
  EXPECT_EQ(tokens.size(), 100u);
  // Each of the 128 bits is there: in 100 tokens none is the same always (probability 2^-92).
  for (std::size_t digit = 0; digit < 32; ++digit) {
    unsigned ones = 0, zeros = 0;
    for (const std::string& token : tokens) {
      const auto value = static_cast<unsigned>(std::stoul(token.substr(digit, 1), nullptr, 16));
      ones |= value;
      zeros |= ~value & 15u;
    }
    EXPECT_EQ(ones, 15u) << digit;
    EXPECT_EQ(zeros, 15u) << digit;
  }
}

TEST(Token, IsRefusedWhereItDoesNotFitAHeaderAndAUrl) {
  EXPECT_TRUE(valid_token("AZaz09-_AZaz09-_"));
  for (const std::string& token :
       {std::string(), std::string(15, 'a'), std::string(129, 'a'), std::string("0123456789abcde "),
        std::string("0123456789abcde\n"), std::string("0123456789abcde#"), std::string("0123456789abcd\u00e4")}) {
    EXPECT_FALSE(valid_token(token)) << token;
  }
}

}  // namespace
}  // namespace crosstie::live::detail
