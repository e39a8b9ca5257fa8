// crosstie detect: images -> marker observations

#include "app/steps.h"
#include "app/verb.h"
#include "markers/family.h"

namespace crosstie::app {
namespace {

using base::Result;

Result<DetectionTask> task_of(const Arguments& arguments) {
  auto family = markers::marker_family(*arguments.get("--family"));
  if (!family) return base::fail(std::move(family));
  DetectionTask task;
  task.family = std::move(*family);
  task.base_folder = std::filesystem::current_path();
  task.title = "Marker detection";
  for (const std::string& word : arguments.all("IMAGE")) {
    // A word that is no file may be a pattern that the shell did not expand.
    std::error_code ignored;
    if (std::filesystem::exists(word, ignored) || word.find_first_of("*?") == std::string::npos) {
      task.images.push_back({{}, "camera", word});
      continue;
    }
    auto files = match_files(word);
    if (!files) return base::fail(std::move(files));
    for (std::filesystem::path& path : *files) task.images.push_back({{}, "camera", std::move(path)});
  }
  auto named = name_images(std::move(task.images));
  if (!named) return base::fail(std::move(named));
  task.images = std::move(*named);
  if (arguments.has("--ids")) {
    auto ids = ids_in_use(arguments.all("--ids"), task.family);
    if (!ids) return base::fail(std::move(ids));
    task.options.ids = *std::move(ids);
  }
  return task;
}

Result<Outcome> run(const Arguments& arguments, Session& session) {
  auto task = task_of(arguments);
  if (!task) return base::fail(std::move(task));
  auto step = detect_step(*task, *arguments.get("--out"), arguments.has("--timings"), session);
  if (!step) return base::fail(std::move(step));
  session.say(step->summary);
  session.print((step->folder / "result.json").string());
  return step->outcome;
}

}  // namespace

Verb detect_verb() {
  return {
      "detect",
      "find coded markers in photographs, with a covariance for each centre",
      "  $ crosstie detect --family ring10 photographs/*.png --out found\n"
      "  24 images, 1042 coded markers\n"
      "  found/result.json",
      {{"IMAGE", "IMAGE", "photographs (PNG, TIFF, BMP, PGM, JPEG) or patterns", true, true},
       {"--family", "FAMILY", "ring10, aicon12/14/20, agisoft12/14/16/20, apriltag:tag36h11, ...", true, false, 1,
        markers::marker_family_names()},
       {"--ids", "IDS", "ids in use, such as 0-127 or 2-71,80 (default: all of the family); others are refused", false, true},
       {"--out", "DIR", "folder for observations.csv, overlays and report; replaced as a whole", true, false},
       {"--timings", "", "write the time each image took into the result (which then differs from run to run)", false, false}},
      run};
}

}  // namespace crosstie::app
