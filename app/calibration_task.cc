// What a job asks of calibrate.

#include <fmt/core.h>

#include "app/lens_word.h"
#include "app/steps_calibrate.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

tl::unexpected<base::Error> bad_job(const Job& job, const std::string& message) {
  return base::fail(ErrorCode::kBadInput, fmt::format("{}: {}", job.file.string(), message));
}

}  // namespace

Result<CalibrationTask> calibration_task(const Job& job) {
  if (!job.board) {
    return bad_job(job, "the job has no [board]; calibrate needs it, and board_images in the table of each camera");
  }
  CalibrationTask task;
  task.board = *job.board;
  task.cameras = job.board_cameras();
  task.date = job.date;
  task.limits = job.limits;
  task.base_folder = job.folder;
  task.title = job.name;
  std::vector<ImageFile> images;
  for (const std::string& name : task.cameras) {
    const JobCamera& camera = job.cameras.at(name);
    auto files = match_files(job.resolve(*camera.board_images));
    if (!files) return bad_job(job, files.error().message);
    for (std::filesystem::path& path : *files) images.push_back({{}, name, std::move(path)});
    if (camera.temperature_c) task.temperatures_c[name] = *camera.temperature_c;
    if (!camera.lens) continue;
    if (task.options.lens && task.options.lens != camera.lens) {
      return bad_job(job,
                     fmt::format("[camera.{}] lens = \"{}\", but the other camera has {}: cameras that are calibrated together "
                                 "have one lens model",
                                 name, lens_word(*camera.lens), lens_word(*task.options.lens)));
    }
    task.options.lens = camera.lens;
  }
  auto named = name_images(std::move(images));
  if (!named) return bad_job(job, named.error().message);
  task.images = std::move(*named);
  if (job.rig && task.cameras.size() == 2) task.options.expected_baseline_mm = job.rig->baseline_mm;
  return task;
}

}  // namespace crosstie::app
