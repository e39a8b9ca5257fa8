// crosstie simulate: a scene -> a job folder made by the digital twin, with truth

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "app/result_folder.h"
#include "app/verb.h"
#include "fixtures/scene.h"
#include "fixtures/simulate.h"
#include "fixtures/varied.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const auto scene = fixtures::find_scene(*arguments.get("--scene"));
  if (!scene) return tl::unexpected(scene.error());
  const auto seed = arguments.integer("--seed");
  if (!seed) return tl::unexpected(seed.error());
  if (*seed && **seed < 0) return base::fail(ErrorCode::kUsage, "--seed must not be negative");
  const std::filesystem::path job = *arguments.get("--out");
  ResultFolder::clear_leftovers(job);
  std::error_code ignored;
  if (std::filesystem::is_directory(job, ignored) && !std::filesystem::is_empty(job, ignored)) {
    return base::fail(ErrorCode::kUsage, fmt::format("{} holds files; name a new or an empty folder", job.string()));
  }
  auto folder = ResultFolder::begin(job);
  if (!folder) return base::fail(std::move(folder));
  fixtures::SimulateOptions options;
  options.seed = static_cast<std::uint64_t>(seed->value_or(1));
  options.threads = session.threads();
  const fixtures::Scene shown = arguments.has("--vary") ? fixtures::varied(*scene, options.seed) : *scene;
  if (auto done = fixtures::simulate(shown, folder->path(), options, session.progress()); !done)
    return base::fail(std::move(done));
  if (auto done = folder->commit(); !done) return base::fail(std::move(done));
  session.print((job / "job.toml").string());
  return Outcome::kOk;
}

}  // namespace

Verb simulate_verb() {
  return {"simulate",
          "photograph a scene with the digital twin: a job folder with its truth beside it",
          "  $ crosstie simulate --scene cross --seed 1 --out rehearsal\n"
          "  rehearsal/job.toml",
          {{"--scene", "SCENE",
            fmt::format("a built-in scene ({}) or a scene description, FILE.toml", fmt::join(fixtures::scene_names(), ", ")),
            true, false, 1, fixtures::scene_names()},
           {"--seed", "N", "seed of all noise (default 1)", false, false},
           {"--vary", "", "by the seed also another machine, head, board, cross and wall than the scene's own", false, false},
           {"--out", "JOB", "job folder to make; may exist, empty", true, false}},
          run};
}

}  // namespace crosstie::app
