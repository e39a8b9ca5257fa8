// docs/troubleshooting.md names every warning that the sources can make, and no other; the refusals that it quotes are the sources' words.
// docs/how-good.md has every limit of a job.

#include <algorithm>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;

constexpr const char* kModules[] = {"app",  "base", "bundle", "calib",        "edge",  "markers",
                                    "math", "scan", "verify", "registration", "report"};

struct Source {
  std::string name;
  std::string code;  ///< without comments, adjacent literals joined
};

/// A source without its comments and raw literals, "two" "literals" joined into one.
std::string plain(const std::string& text) {
  std::string code;
  bool literal = false;
  std::size_t i = 0;
  while (i < text.size()) {
    if (literal && text[i] == '\\') {
      code += text.substr(i, 2);
      i += 2;
    } else if (literal && text[i] == '"') {
      const std::size_t next = text.find_first_not_of(" \n", i + 1);
      literal = next != std::string::npos && text[next] == '"';
      if (!literal) code += '"';
      i = literal ? next + 1 : i + 1;
    } else if (literal) {
      code += text[i++];
    } else if (text.compare(i, 2, "//") == 0) {
      i = std::min(text.find('\n', i), text.size());
    } else if (text.compare(i, 2, "R\"") == 0) {
      const std::string end = ")" + text.substr(i + 2, text.find('(', i) - i - 2) + "\"";
      i = std::min(text.find(end, i), text.size() - end.size()) + end.size();
    } else if (text[i] == '\'' && i + 3 < text.size() && (text[i + 2] == '\'' || text[i + 1] == '\\')) {
      i += text[i + 1] == '\\' ? 4 : 3;  // '"' begins no literal
    } else {
      literal = text[i] == '"';
      code += text[i++];
    }
  }
  return code;
}

std::vector<Source> sources() {
  std::vector<Source> found;
  for (const char* module : kModules) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(CROSSTIE_SOURCE_DIR) / module)) {
      if (entry.path().extension() != ".cc") continue;
      found.push_back({fs::relative(entry.path(), CROSSTIE_SOURCE_DIR).string(), plain(tests::read_all(entry.path()))});
    }
  }
  return found;
}

struct Codes {
  std::map<std::string, std::string> where;  ///< code -> source
  std::vector<std::string> unread;           ///< places that make a warning in a way that is not understood here
};

/// Codes of the warnings that a source makes: warnings.push_back({"code", ...}), Warning{"code", ...}, warn(result, "code", ...), and
/// `return {"code", ...}` of functions that return a Warning.
void collect(const Source& source, Codes& codes) {
  const auto each = [&](const std::string& text, const std::regex& pattern, const auto& use) {
    for (std::sregex_iterator i(text.begin(), text.end(), pattern), end; i != end; ++i) use(*i);
  };
  const auto take = [&](const std::smatch& match) { codes.where.emplace(match[1], source.name); };
  static const std::regex whole(R"re(Warning\s*\{\s*"([a-z0-9_]+)",)re");
  static const std::regex by_function(R"re(\bwarn\(\s*(?:\w+,\s*)?"([a-z0-9_]+)",)re");
  static const std::regex maker(R"re(Warning (?:\w+::)*\w+\([^{;]*\{)re");
  static const std::regex returned(R"re(return\s*\{\s*"([a-z0-9_]+)",)re");
  each(source.code, whole, take);
  each(source.code, by_function, take);
  each(source.code, maker, [&](const std::smatch& match) {
    const auto from = static_cast<std::size_t>(match.position());
    each(source.code.substr(from, source.code.find("\n}", from) - from), returned, take);
  });
  static const std::regex added(R"re([wW]arnings_?\.(?:push_back|emplace_back)\(\s*)re");
  static const std::regex code(R"re(^(?:(?:base::)?Warning)?\{?\s*"([a-z0-9_]+)",)re");
  // What hands on warnings that were made elsewhere.
  static const std::regex handed_on(
      R"re(^(?:\{code,|\{std::move\(code\)|std::move\(|\w+\)|warning_of\(|\{one\.at\("code"\)))re");
  each(source.code, added, [&](const std::smatch& match) {
    const std::string rest = source.code.substr(static_cast<std::size_t>(match.position() + match.length()), 120);
    std::smatch made;
    if (std::regex_search(rest, made, code)) {
      take(made);
    } else if (!std::regex_search(rest, handed_on)) {
      codes.unread.push_back(source.name + ": " + rest.substr(0, 60));
    }
  });
}

std::string page() { return tests::read_all(fs::path(CROSSTIE_SOURCE_DIR) / "docs" / "troubleshooting.md"); }

/// First cells of the tables under a heading `## name`, as far as they are `quoted`.
std::set<std::string> first_cells(const std::string& text, const std::string& name) {
  const std::size_t from = text.find("\n## " + name + "\n");
  if (from == std::string::npos) return {};
  const std::string section = text.substr(from, text.find("\n## ", from + 1) - from);
  static const std::regex cell(R"re(\n\| `([^`]+)` )re");
  std::set<std::string> cells;
  for (std::sregex_iterator i(section.begin(), section.end(), cell), end; i != end; ++i) cells.insert((*i)[1]);
  return cells;
}

TEST(TroubleshootingPage, NamesEveryWarningAndNoOther) {
  Codes codes;
  for (const Source& source : sources()) collect(source, codes);
  EXPECT_GT(codes.where.size(), 80U);
  for (const std::string& place : codes.unread) ADD_FAILURE() << "a warning whose code this test does not read: " << place;

  static const std::regex is_code("[a-z][a-z0-9_]*");
  std::set<std::string> named;
  for (const std::string& cell : first_cells(page(), "Warnings")) {
    if (std::regex_match(cell, is_code)) named.insert(cell);
  }
  for (const auto& [code, source] : codes.where)
    EXPECT_TRUE(named.contains(code)) << "docs/troubleshooting.md does not name " << code << " of " << source;
  for (const std::string& code : named) EXPECT_TRUE(codes.where.contains(code)) << "nothing makes the warning " << code;
}

TEST(TroubleshootingPage, QuotesRefusalsAsTheyStandInTheSources) {
  std::vector<std::string> literals;
  static const std::regex literal(R"re("((?:[^"\\\n]|\\.)*)")re");
  static const std::regex escaped(R"re(\\")re");
  for (const Source& source : sources()) {
    for (std::sregex_iterator i(source.code.begin(), source.code.end(), literal), end; i != end; ++i)
      literals.push_back(std::regex_replace((*i)[1].str(), escaped, "\""));
  }
  const auto holds = [](const std::string& text, const std::string& quote) {
    std::size_t at = 0;
    for (std::size_t from = 0; from <= quote.size();) {
      const std::size_t to = std::min(quote.find("...", from), quote.size());
      const std::string part = quote.substr(from, to - from);
      const std::size_t found = text.find(part, at);
      if (found == std::string::npos) return false;
      at = found + part.size();
      from = to + 3;
    }
    return true;
  };
  const std::set<std::string> quotes = first_cells(page(), "Refusals");
  EXPECT_GT(quotes.size(), 60U);
  for (const std::string& quote : quotes) {
    EXPECT_TRUE(std::any_of(literals.begin(), literals.end(), [&](const std::string& text) { return holds(text, quote); }))
        << "no source says: " << quote;
  }
}

/// docs/how-good.md has a row for each key of [limits], and for no other.
TEST(HowGoodPage, HasEveryLimitAndNoOther) {
  const fs::path root = CROSSTIE_SOURCE_DIR;
  const std::string code = plain(tests::read_all(root / "app" / "job_limits.cc"));
  static const std::regex key(R"re(number\("([a-z0-9_]+)")re");
  std::set<std::string> limits;
  for (std::sregex_iterator i(code.begin(), code.end(), key), end; i != end; ++i) limits.insert((*i)[1]);
  EXPECT_GT(limits.size(), 10U);
  EXPECT_EQ(first_cells(tests::read_all(root / "docs" / "how-good.md"), "Limits"), limits);
}

}  // namespace
}  // namespace crosstie::app
