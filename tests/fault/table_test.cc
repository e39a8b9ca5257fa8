// docs/reliability.md: every case names what holds it, that test or row exists, and the counts are those of the rows.
#include <cstdlib>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace crosstie::tests {
namespace {

namespace fs = std::filesystem;

struct Row {
  std::string group, name, expected, held_by;
};

struct Table {
  std::vector<Row> rows;
  std::map<std::string, std::size_t> stated;  ///< number of cases by group, as the headings say
  std::size_t total = 0;                      ///< as the introduction says
};

std::string trimmed(std::string text) {
  text.erase(0, text.find_first_not_of(' '));
  text.erase(text.find_last_not_of(' ') + 1);
  return text;
}

Table read_page() {
  Table table;
  std::istringstream page(read_all(fs::path(CROSSTIE_SOURCE_DIR) / "docs/reliability.md"));
  static const std::regex heading(R"(^## (.+) \((\d+) cases\)$)");
  static const std::regex total(R"((\d+) cases)");
  std::string group;
  std::smatch match;
  for (std::string line; std::getline(page, line);) {
    if (std::regex_match(line, match, heading)) {
      group = match[1];
      table.stated[group] = std::stoul(match[2]);
    } else if (line.starts_with("## ")) {
      group.clear();
    } else if (table.total == 0 && std::regex_search(line, match, total)) {
      table.total = std::stoul(match[1]);
    } else if (!group.empty() && line.starts_with("| ") && !line.starts_with("| case") && !line.starts_with("| ---")) {
      std::vector<std::string> cells;
      std::istringstream row(line.substr(1));
      for (std::string cell; std::getline(row, cell, '|');) cells.push_back(trimmed(cell));
      cells.resize(3);
      table.rows.push_back({group, cells[0], cells[1], cells[2]});
    }
  }
  return table;
}

/// The tests of the tree, and the text of the folders that they are in.
struct Sources {
  std::map<std::string, fs::path> folders;  ///< by Suite.Test
  std::map<fs::path, std::string> texts;    ///< by folder

  Sources() {
    static const std::regex macro(R"(\bTEST(?:_F|_P)?\((\w+), (\w+)\))");
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(CROSSTIE_SOURCE_DIR) / "tests")) {
      const std::string ending = entry.path().extension().string();
      if (ending != ".cc" && ending != ".h") continue;
      const std::string text = read_all(entry.path());
      const fs::path folder = entry.path().parent_path();
      texts[folder] += text;
      if (!fs::exists(folder / "CMakeLists.txt") ||
          read_all(folder / "CMakeLists.txt").find(entry.path().filename().string()) == std::string::npos)
        continue;  // nobody builds it
      for (std::sregex_iterator at(text.begin(), text.end(), macro), end; at != end; ++at)
        folders[(*at)[1].str() + "." + (*at)[2].str()] = folder;
    }
  }

  /// A row of a test's table stands in its folder or among what tests share, as a literal.
  [[nodiscard]] bool has_row(const fs::path& folder, const std::string& row) const {
    const std::string literal = "\"" + row + "\"";
    return texts.at(folder).find(literal) != std::string::npos ||
           texts.at(fs::path(CROSSTIE_SOURCE_DIR) / "tests/support").find(literal) != std::string::npos;
  }
};

TEST(ReliabilityPage, EveryCaseIsHeldByATestThatExists) {
  const Sources sources;
  ASSERT_GT(sources.folders.size(), 1000U);
  static const std::regex reference(R"(`(\w+\.\w+)(?:: ([^`]+))?`)");
  for (const Row& row : read_page().rows) {
    SCOPED_TRACE(row.group + ": " + row.name);
    EXPECT_NE(row.expected, "");
    int references = 0;
    for (std::sregex_iterator at(row.held_by.begin(), row.held_by.end(), reference), end; at != end; ++at) {
      ++references;
      const auto test = sources.folders.find((*at)[1]);
      if (test == sources.folders.end()) {
        ADD_FAILURE() << "there is no test " << (*at)[1];
      } else if ((*at)[2].matched) {
        EXPECT_TRUE(sources.has_row(test->second, (*at)[2])) << (*at)[1] << " has no row " << (*at)[2];
      }
    }
    EXPECT_GT(references, 0) << "held by nothing";
  }
}

TEST(ReliabilityPage, CountsAreThoseOfItsRows) {
  const Table table = read_page();
  std::map<std::string, std::size_t> counted;
  std::set<std::string> names;
  for (const Row& row : table.rows) {
    ++counted[row.group];
    EXPECT_TRUE(names.insert(row.group + ": " + row.name).second) << row.name << " stands twice in " << row.group;
  }
  EXPECT_EQ(counted, table.stated);
  EXPECT_EQ(table.total, table.rows.size());
  EXPECT_GE(table.stated.size(), 7U);
}

}  // namespace
}  // namespace crosstie::tests
