// The twin's panel: two cameras, and a hand-held tool that moves from station to station.

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "base/table.h"
#include "tests/support/program.h"

namespace crosstie {
namespace {

using nlohmann::ordered_json;
using tests::run_program;

std::set<int> ids_of(const std::filesystem::path& file, const char* column) {
  const base::Table table = base::read_table(file).value();
  std::set<int> ids;
  for (std::size_t row = 0; row < table.rows.size(); ++row)
    ids.insert(table.integer(row, table.column(column).value()).value());
  return ids;
}

TEST(Panel, MarkersThatMoveBetweenTheImagesAreNamed) {
  const tests::TemporaryFolder folder;
  const auto simulated = run_program({"simulate", "--scene", "panel", "--seed", "3", "--out", (folder / "job").string()});
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  const auto run = run_program({"run", (folder / "job").string()});
  ASSERT_EQ(run.exit_code, 0) << run.err;

  // All that is seen but neither measured by the reference campaign, which leaves out what moves, nor an end of a scale bar.
  std::set<int> moving = ids_of(folder / "job/truth/observations.csv", "id");
  for (const int id : ids_of(folder / "job/reference/tritop.csv", "id")) moving.erase(id);
  for (const char* end : {"id_a", "id_b"}) {
    for (const int id : ids_of(folder / "job/net/scale_bars.csv", end)) moving.erase(id);
  }
  ASSERT_EQ(moving.size(), 3U);

  const ordered_json adjust = base::read_json(folder / "job/results/adjust/result.json").value();
  std::set<int> moved;
  for (const ordered_json& rejected : adjust["rejected"]) {
    if (rejected["reason"].get<std::string>().find("moved") != std::string::npos) moved.insert(rejected["id"].get<int>());
  }
  EXPECT_EQ(moved, moving);
  for (const ordered_json& point : adjust["points"]) EXPECT_FALSE(moving.contains(point["id"].get<int>())) << point["id"];
}

}  // namespace
}  // namespace crosstie
