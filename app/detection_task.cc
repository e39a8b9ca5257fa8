// Which photographs of a job are looked at for which markers.

#include <algorithm>
#include <set>

#include <fmt/core.h>

#include "app/steps.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

tl::unexpected<base::Error> bad_job(const Job& job, const std::string& message) {
  return base::fail(ErrorCode::kBadInput, fmt::format("{}: {}", job.file.string(), message));
}

/// Family, ids and white levels of the job for these images, which have their names.
Result<DetectionTask> task_of(const Job& job, std::vector<ImageFile> images) {
  auto choice = marker_choice(job);
  if (!choice) return tl::unexpected(choice.error());
  DetectionTask task;
  task.family = std::move(choice->family);
  task.options = std::move(choice->options);
  task.base_folder = job.folder;
  task.title = job.name;
  task.images = std::move(images);
  for (const ImageFile& file : task.images) {
    const auto settings = job.cameras.find(file.camera);
    if (settings != job.cameras.end() && settings->second.white_level)
      task.white_levels[file.camera] = *settings->second.white_level;
  }
  return task;
}

/// One file, or those that a pattern fits.
Result<std::vector<fs::path>> photographs_of(const Job& job, const fs::path& photograph) {
  if (photograph.string().find_first_of("*?") == std::string::npos) return std::vector<fs::path>{job.resolve(photograph)};
  auto files = match_files(job.resolve(photograph));
  if (!files) return base::fail(files.error().code, fmt::format("{}: {}", job.file.string(), files.error().message));
  return files;
}

}  // namespace

Result<std::vector<int>> ids_in_use(const std::vector<std::string>& texts, const markers::MarkerFamily& family) {
  const auto ranges = parse_id_ranges(texts);
  if (!ranges) return base::fail(ErrorCode::kUsage, "--ids: " + ranges.error().message);
  std::vector<int> ids;
  for (const auto& code : family.codes) {
    if (ranges->contains(code.id)) ids.push_back(code.id);
  }
  if (ids.empty()) return base::fail(ErrorCode::kUsage, fmt::format("--ids holds no id of {}", family.name));
  return ids;
}

Result<MarkerChoice> marker_choice(const Job& job) {
  auto family = markers::marker_family(job.family);
  if (!family) return bad_job(job, family.error().message);
  MarkerChoice choice{std::move(*family), {}};
  if (job.ids.ranges.empty() && job.exclude_ids.ranges.empty()) return choice;
  for (const auto& code : choice.family.codes) {
    if ((job.ids.ranges.empty() || job.ids.contains(code.id)) && !job.exclude_ids.contains(code.id))
      choice.options.ids.push_back(code.id);
  }
  if (choice.options.ids.empty()) {
    return bad_job(job, fmt::format("[markers] ids and exclude_ids leave no id of {} in use", job.family));
  }
  return choice;
}

Result<DetectionTask> detection_task(const Job& job) {
  if (!job.network) return bad_job(job, "the job has no [network] images to detect markers in");
  std::vector<ImageFile> images;
  for (const auto& [camera, pattern] : job.network->images) {
    auto files = match_files(job.resolve(pattern));
    if (!files) return base::fail(files.error().code, fmt::format("{}: {}", job.file.string(), files.error().message));
    for (fs::path& path : *files) images.push_back({{}, camera, std::move(path)});
  }
  auto named = name_images(std::move(images));
  if (!named) return base::fail(std::move(named));
  return task_of(job, std::move(*named));
}

Result<DetectionTask> station_detection_task(const Job& job) {
  std::vector<ImageFile> images;
  std::set<fs::path> seen;
  for (const JobStation& station : job.stations) {
    for (const auto& [camera, photograph] : station.cross) {
      const auto files = photographs_of(job, photograph);
      if (!files) return tl::unexpected(files.error());
      for (std::size_t i = 0; i < files->size(); ++i) {
        const fs::path& path = (*files)[i];
        if (!seen.insert(path).second) {
          return bad_job(job, fmt::format("the image {} is named twice, again by station {}", path.string(), station.name));
        }
        const std::string name = station_image(station.name, camera);
        images.push_back({i == 0 ? name : fmt::format("{}-{}", name, i + 1), camera, path});
      }
    }
  }
  if (images.empty()) return bad_job(job, "no [[station]] has photographs of the cross");
  if (job.family.empty()) return bad_job(job, "[markers] needs a family, such as \"ring10\"");
  std::sort(images.begin(), images.end(), [](const ImageFile& a, const ImageFile& b) { return a.name < b.name; });
  return task_of(job, std::move(images));
}

Result<DetectionTask> pair_detection_task(const Job& job, const std::vector<std::pair<std::string, fs::path>>& pair) {
  std::vector<ImageFile> images;
  for (const auto& [camera, path] : pair) images.push_back({camera, camera, path});
  std::sort(images.begin(), images.end(), [](const ImageFile& a, const ImageFile& b) { return a.name < b.name; });
  if (images.size() > 1 && fs::weakly_canonical(images[0].path) == fs::weakly_canonical(images[1].path)) {
    return base::fail(ErrorCode::kUsage, "the left and the right image are the same file");
  }
  return task_of(job, std::move(images));
}

std::string station_image(const std::string& station, const std::string& camera) {
  return fmt::format("{}/{}", station, camera);
}

}  // namespace crosstie::app
