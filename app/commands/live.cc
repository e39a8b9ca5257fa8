// crosstie live: the operator's page

#include <chrono>
#include <memory>
#include <thread>

#include <fmt/core.h>
#include <fmt/ranges.h>

#include "app/live/devices_file.h"
#include "app/live/live_session.h"
#include "app/live/rehearsal.h"
#include "app/verb.h"
#include "fixtures/scene.h"
#include "live/feed.h"
#include "live/page_server.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

Result<> read_place(const Arguments& arguments, live::PageServerOptions& options) {
  if (const auto address = arguments.get("--address")) options.address = *address;
  const auto port = arguments.integer("--port");
  if (!port) return tl::unexpected(port.error());
  constexpr long kMostPort = 65535;
  if (*port && (**port < 0 || **port > kMostPort)) return base::fail(ErrorCode::kUsage, "--port is 0 to 65535");
  if (*port) options.port = static_cast<int>(**port);
  return {};
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  const std::filesystem::path job = *arguments.get("JOB");
  const auto twin = arguments.get("--twin");
  const auto file = arguments.get("--devices");
  if (twin.has_value() == file.has_value())
    return base::fail(ErrorCode::kUsage, "--devices FILE tells what cameras there are, or --twin SCENE takes the digital twin");
  const auto seed = arguments.integer("--seed");
  if (!seed) return tl::unexpected(seed.error());
  if (*seed && (!twin || **seed < 0)) return base::fail(ErrorCode::kUsage, "--seed goes with --twin and is not negative");
  live::PageServerOptions options;
  if (auto read = read_place(arguments, options); !read) return base::fail(std::move(read));

  std::unique_ptr<Rehearsal> rehearsal;
  OpenDevices open;
  if (twin) {
    auto begun = begin_rehearsal(*twin, static_cast<std::uint64_t>(seed->value_or(1)), job, session);
    if (!begun) return base::fail(std::move(begun));
    rehearsal = *std::move(begun);
    open.live = rehearsal->devices();
  } else {
    auto opened = open_devices(*file);
    if (!opened) return base::fail(std::move(opened));
    open = *std::move(opened);
  }

  live::Feed feed;
  auto desk = LiveSession::begin(job, open.live, feed, session.threads());
  if (!desk) return base::fail(std::move(desk));
  options.token = live::make_token();
  options.results = (std::filesystem::is_directory(job) ? job : job.parent_path()) / "results";
  const auto server =
      live::PageServer::start(options, feed, [&](const std::string& command) { return (*desk)->command(command); });
  if (!server) return tl::unexpected(server.error());
  session.say("the operator's page; Ctrl-C ends it");
  session.print((*server)->url());
  const base::Progress progress = session.progress();
  constexpr auto kPeriod = std::chrono::milliseconds(100);
  while (!progress.cancelled()) std::this_thread::sleep_for(kPeriod);
  return Outcome::kOk;
}

}  // namespace

Verb live_verb() {
  return {"live",
          "the operator's page: calibrate, commission and scan at the machine, in a browser",
          "  $ crosstie live segment --twin segment\n"
          "  the operator's page; Ctrl-C ends it\n"
          "  http://127.0.0.1:8137/#5f0c6b8f3a7d41e2b9c04d6e8f1a2b3c",
          {{"JOB", "JOB", "job folder or its job.toml: what is taken goes there, and run does the same with it", true, false},
           {"--devices", "FILE", "cameras, axis and projector of the machine (formats.md)", false, false},
           {"--twin", "SCENE",
            fmt::format(
                "instead: the digital twin of a scene ({}, or FILE.toml), with cameras on 127.0.0.2 and 127.0.0.3; makes JOB "
                "where it is missing",
                fmt::join(fixtures::scene_names(), ", ")),
            false, false, 1, fixtures::scene_names()},
           {"--seed", "N", "with --twin: seed of all noise (default 1)", false, false},
           {"--port", "N", "of the page (default 8137; 0: any that is free)", false, false},
           {"--address", "ADDRESS",
            "at which the page is served (default 127.0.0.1: this computer alone). With another everybody in that network may "
            "watch, and "
            "who has the printed address may command",
            false, false}},
          run};
}

}  // namespace crosstie::app
