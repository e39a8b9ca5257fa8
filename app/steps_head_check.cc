// one pair of photographs -> whether rig and frame still hold

#include <algorithm>

#include <fmt/core.h>
#include <nlohmann/json.hpp>

#include "app/current.h"
#include "app/detected_images.h"
#include "app/result_folder.h"
#include "app/steps_commission.h"
#include "base/commissioning_reader.h"
#include "base/result_document.h"
#include "base/sphere_list.h"
#include "bundle/check_head.h"
#include "report/head_check_report.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::HeadCheck;
using base::Result;
using nlohmann::ordered_json;

/// What the operator reads first.
std::string verdict_line(const HeadCheck& check) {
  switch (check.verdict) {
    case HeadCheck::Verdict::kHolds:
      return check.cross_markers > 0 ? "rig and frame hold"
                                     : "the rig holds as far as a pair without the cross tells; the frame is not tested";
    case HeadCheck::Verdict::kRig:
      return "RIG MOVED: the cameras moved against each other; calibrate and commission the head anew";
    case HeadCheck::Verdict::kHeadOrCross:
      return "HEAD OR CROSS MOVED: one pair cannot tell which; probe the spheres again (--probed-again)";
    case HeadCheck::Verdict::kHead:
      return "HEAD MOVED on its carriage; the cross did not: commission anew";
    case HeadCheck::Verdict::kCross:
      return "CROSS MOVED on the machine; the head did not: commission anew before the next use of the cross";
    case HeadCheck::Verdict::kHeadAndCross:
      return "HEAD AND CROSS MOVED: commission anew";
  }
  return "";
}

std::vector<std::string> lines_of(const HeadCheck& check) {
  std::vector<std::string> lines = {verdict_line(check)};
  if (!check.message.empty()) lines.push_back(check.message);
  for (const HeadCheck::Test& test : check.tests) {
    std::string value;
    if (!test.unit.empty()) {
      value = test.sigma > 0.0 ? fmt::format("{:.4g} +- {:.2g} {}, ", test.value, test.sigma, test.unit)
                               : fmt::format("{:.4g} {}, ", test.value, test.unit);
    }
    lines.push_back(fmt::format("{:<24}{}p {:.3g}{}", test.name, value, test.p, test.accused ? "  ACCUSED" : ""));
  }
  return lines;
}

Result<base::ImageObservations> image_of(const std::vector<base::ImageObservations>& images, const std::string& camera,
                                         const Job& job) {
  const auto found = std::find_if(images.begin(), images.end(), [&](const auto& image) { return image.image == camera; });
  if (found == images.end()) return base::fail(ErrorCode::kInternal, fmt::format("no detection of the {} image", camera));
  base::ImageObservations image = *found;
  image.camera = camera;
  image.family = job.family;
  return image;
}

}  // namespace

Result<HeadCheckOutcome> check_head_step(const Job& job, const HeadCheckTask& task, const fs::path& commissioning,
                                         const fs::path& out, Session& session) {
  const auto [left, right] = head_cameras(job);
  const auto known = base::read_commissioning(commissioning);
  if (!known) {
    if (known.error().code != ErrorCode::kFileSystem) return tl::unexpected(known.error());
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("{}: there is no commissioning to check against; run `crosstie commission` "
                                  "first ({})",
                                  job.file.string(), known.error().message));
  }
  bundle::CheckInput input{.commissioning = &*known, .axis_mm = task.axis_mm, .left = {}, .right = {}};
  input.temperature_c = task.temperature_c;
  if (task.probed_again) {
    auto probed = base::read_probed_spheres(*task.probed_again);
    if (!probed) return base::fail(std::move(probed));
    input.probed_again = std::move(*probed);
  }
  const auto detection = pair_detection_task(job, {{left, task.left}, {right, task.right}});
  if (!detection) return tl::unexpected(detection.error());
  const auto detected = detect_step(*detection, out.parent_path() / "detect-check", false, session);
  if (!detected) return tl::unexpected(detected.error());
  const auto images = detected_images(detected->folder);
  if (!images) return tl::unexpected(images.error());
  auto left_image = image_of(*images, left, job);
  if (!left_image) return base::fail(std::move(left_image));
  auto right_image = image_of(*images, right, job);
  if (!right_image) return base::fail(std::move(right_image));
  input.left = std::move(*left_image);
  input.right = std::move(*right_image);

  const bundle::CheckOptions check_options;
  const auto check = bundle::check_head(input, check_options);
  if (!check) return tl::unexpected(check.error());

  std::vector<base::ResultInput> inputs;
  for (const fs::path& file : {task.left, task.right}) {
    auto hashed = hashed_input(file, job.folder);
    if (!hashed) return base::fail(std::move(hashed));
    inputs.push_back(std::move(*hashed));
  }
  auto of_commissioning = hashed_input(commissioning / "result.json", job.folder);
  if (!of_commissioning) return base::fail(std::move(of_commissioning));
  of_commissioning->path = "results/commission/result.json";
  inputs.push_back(std::move(*of_commissioning));

  auto folder = ResultFolder::begin(out);
  if (!folder) return base::fail(std::move(folder));
  const bool holds = check->verdict == HeadCheck::Verdict::kHolds;
  std::vector<base::Verdict> verdicts;
  for (const HeadCheck::Test& test : check->tests) {
    verdicts.push_back({test.name, test.p, check->level, "p", "level of the check: how often an unmoved head is accused",
                        test.accused ? base::VerdictLevel::kFail : base::VerdictLevel::kOk});
  }
  const base::ResultEnvelope envelope{"check", "machine", std::move(inputs), std::move(verdicts), check->warnings};
  ordered_json options = {{"axis_mm", task.axis_mm},
                          {"significance", check_options.significance},
                          {"temperature_limit_c", check_options.temperature_limit_c}};
  if (task.temperature_c) options["temperature_c"] = *task.temperature_c;
  const std::string html = report::head_check_report(
      *check, verdict_line(*check), {"Check of the head", job.name, envelope, options.dump(2), overview_of(out, session)});
  const ordered_json json = base::result_json(envelope, options, base::head_check_json(*check));
  if (auto published = publish(*folder, html, json); !published) return base::fail(std::move(published));
  return HeadCheckOutcome{{out, verdict_line(*check), false, holds ? Outcome::kOk : Outcome::kVerdictFailed}, lines_of(*check)};
}

}  // namespace crosstie::app
