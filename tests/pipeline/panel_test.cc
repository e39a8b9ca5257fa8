// The twin's panel: two cameras, and a hand-held tool that moves from station to station.

#include <algorithm>
#include <iterator>
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

TEST(Panel, MarkersThatMoveBetweenTheImagesAreNamed) {
  const tests::TemporaryFolder folder;
  const auto simulated = run_program({"simulate", "--scene", "panel", "--seed", "3", "--out", (folder / "job").string()});
  ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
  const auto run = run_program({"run", (folder / "job").string()});
  ASSERT_EQ(run.exit_code, 0) << run.err;

  std::set<int> still;  // the truth lists what stands still
  const auto truth = base::read_table(folder / "job/truth/points.csv").value();
  for (std::size_t row = 0; row < truth.rows.size(); ++row)
    still.insert(truth.integer(row, truth.column("id").value()).value());
  std::set<int> seen;
  const auto observations = base::read_table(folder / "job/truth/observations.csv").value();
  for (std::size_t row = 0; row < observations.rows.size(); ++row) {
    seen.insert(observations.integer(row, observations.column("id").value()).value());
  }
  std::set<int> moving;
  std::set_difference(seen.begin(), seen.end(), still.begin(), still.end(), std::inserter(moving, moving.end()));
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
