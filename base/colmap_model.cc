#include "base/colmap_model.h"

#include <algorithm>
#include <map>
#include <system_error>

#include <fmt/format.h>

#include "base/detail/colmap_camera.h"
#include "base/detail/colmap_files.h"
#include "base/file.h"

namespace crosstie::base {
namespace {

using detail::kColmapFiles;

std::string_view ending(ColmapFormat format) { return format == ColmapFormat::kText ? ".txt" : ".bin"; }

detail::ColmapPaths paths_of(const std::filesystem::path& folder, ColmapFormat format) {
  detail::ColmapPaths paths;
  for (std::size_t i = 0; i < paths.size(); ++i) paths[i] = folder / fmt::format("{}{}", kColmapFiles[i], ending(format));
  return paths;
}

template <typename T>
void sort_by_id(std::vector<T>& list) {
  std::stable_sort(list.begin(), list.end(), [](const T& a, const T& b) { return a.id < b.id; });
}

/// "camera 3 occurs twice", or nothing; the list is sorted.
template <typename T>
std::string double_id(const std::vector<T>& list, const char* what) {
  const auto twice = std::adjacent_find(list.begin(), list.end(), [](const T& a, const T& b) { return a.id == b.id; });
  return twice == list.end() ? "" : fmt::format("{} {} occurs twice", what, twice->id);
}

/// The entry with that id; the list is sorted.
template <typename T>
const T* find(const std::vector<T>& list, std::uint64_t id) {
  const auto found =
      std::lower_bound(list.begin(), list.end(), id, [](const T& e, std::uint64_t value) { return e.id < value; });
  return found == list.end() || found->id != id ? nullptr : &*found;
}

/// What contradicts itself in a sorted model, or nothing. Tracks and image points must say the same.
std::string contradiction(const ColmapModel& model) {
  if (auto twice = double_id(model.cameras, "camera"); !twice.empty()) return twice;
  if (auto twice = double_id(model.images, "image"); !twice.empty()) return twice;
  if (auto twice = double_id(model.points, "point"); !twice.empty()) return twice;
  std::vector<std::vector<bool>> in_a_track;
  for (const ColmapImage& image : model.images) {
    if (find(model.cameras, image.camera_id) == nullptr) {
      return fmt::format("image {} has camera {}, which does not exist", image.id, image.camera_id);
    }
    in_a_track.emplace_back(image.points.size(), false);
  }
  for (const ColmapPoint& point : model.points) {
    for (const ColmapTrackElement& element : point.track) {
      const ColmapImage* image = find(model.images, element.image_id);
      if (image == nullptr)
        return fmt::format("point {} is seen in image {}, which does not exist", point.id, element.image_id);
      if (element.point_index >= image->points.size()) {
        return fmt::format("point {} is image point {} of image {}, which has only {}", point.id, element.point_index,
                           image->id, image->points.size());
      }
      auto marked = in_a_track[static_cast<std::size_t>(image - model.images.data())].begin() + element.point_index;
      if (image->points[element.point_index].point_id != point.id || *marked) {
        return fmt::format("the track of point {} and image point {} of image {} contradict each other", point.id,
                           element.point_index, image->id);
      }
      *marked = true;
    }
  }
  for (std::size_t i = 0; i < model.images.size(); ++i) {
    for (std::size_t k = 0; k < in_a_track[i].size(); ++k) {
      if (!model.images[i].points[k].point_id || in_a_track[i][k]) continue;
      return fmt::format("image point {} of image {} shows point {}, whose track does not know it", k, model.images[i].id,
                         *model.images[i].points[k].point_id);
    }
  }
  return "";
}

/// Why a model cannot be written, or nothing.
std::string obstacle(const ColmapModel& model, ColmapFormat format) {
  for (const ColmapCamera& camera : model.cameras) {
    if (const auto values = detail::colmap_of_camera(camera.camera); !values) {
      return fmt::format("camera {}: {}", camera.id, values.error());
    }
  }
  for (const ColmapImage& image : model.images) {
    using namespace std::string_view_literals;
    const auto separators = format == ColmapFormat::kText ? " \t\r\n\0"sv : "\0"sv;
    if (image.name.empty() || image.name.find_first_of(separators) != std::string::npos) {
      return fmt::format("the name \"{}\" of image {} cannot be written in this format", shown(image.name), image.id);
    }
  }
  return contradiction(model);
}

}  // namespace

std::optional<ColmapFormat> colmap_format_of(const std::filesystem::path& folder) {
  for (const ColmapFormat format : {ColmapFormat::kBinary, ColmapFormat::kText}) {
    const auto paths = paths_of(folder, format);
    std::error_code ignored;
    if (std::all_of(paths.begin(), paths.end(), [&](const auto& path) { return std::filesystem::exists(path, ignored); })) {
      return format;
    }
  }
  return std::nullopt;
}

Result<ColmapModel> read_colmap_model(const std::filesystem::path& folder) {
  const auto format = colmap_format_of(folder);
  if (!format) {
    return fail(
        ErrorCode::kBadInput,
        fmt::format("{}: no COLMAP model: cameras, images and points3D (.bin or .txt) are not all there", shown(folder)));
  }
  const auto paths = paths_of(folder, *format);
  detail::ColmapContents contents;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    auto read = read_file(paths[i]);
    if (!read) return fail(std::move(read));
    contents[i] = *std::move(read);
  }
  auto model = *format == ColmapFormat::kText ? detail::parse_colmap_text(paths, contents)
                                              : detail::parse_colmap_binary(paths, contents);
  if (!model) return model;
  sort_by_id(model->cameras);
  sort_by_id(model->images);
  sort_by_id(model->points);
  if (const std::string what = contradiction(*model); !what.empty()) {
    return fail(ErrorCode::kBadInput, fmt::format("{}: {}", shown(folder), what));
  }
  return model;
}

Result<> write_colmap_model(const std::filesystem::path& folder, const ColmapModel& model, ColmapFormat format) {
  ColmapModel sorted = model;
  sort_by_id(sorted.cameras);
  sort_by_id(sorted.images);
  sort_by_id(sorted.points);
  if (const std::string what = obstacle(sorted, format); !what.empty()) {
    return fail(ErrorCode::kBadInput, fmt::format("cannot write {}: {}", shown(folder), what));
  }
  const auto paths = paths_of(folder, format);
  const auto contents =
      format == ColmapFormat::kText ? detail::format_colmap_text(sorted) : detail::format_colmap_binary(sorted);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (auto written = write_file_atomically(paths[i], contents[i]); !written) return written;
  }
  return {};
}

ColmapModel colmap_model_of(const AdjustedNetwork& network) {
  constexpr std::array<std::uint8_t, 3> kGrey = {128, 128, 128};
  ColmapModel model;
  std::map<std::string, std::uint32_t> camera_ids;
  for (const AdjustedCamera& camera : network.cameras) {
    const auto id = static_cast<std::uint32_t>(model.cameras.size() + 1);
    camera_ids.emplace(camera.name, id);
    model.cameras.push_back({id, camera.camera});
  }
  for (const AdjustedImage& adjusted : network.images) {
    ColmapImage image;
    image.id = static_cast<std::uint32_t>(model.images.size() + 1);
    image.name = adjusted.name;
    image.camera_id = camera_ids[adjusted.camera];
    image.camera_from_world = adjusted.network_from_camera.inverse();
    model.images.push_back(std::move(image));
  }
  for (const AdjustedPoint& adjusted : network.points) {
    ColmapPoint point;
    point.id = static_cast<std::uint64_t>(adjusted.id);
    point.xyz = adjusted.xyz_mm;
    point.rgb = kGrey;
    model.points.push_back(std::move(point));
  }
  std::vector<double> residual_sums(model.points.size(), 0.0);
  for (const AdjustedObservation& observation : network.residuals) {
    const auto point_index = static_cast<std::size_t>(observation.point);
    ColmapImage& image = model.images[static_cast<std::size_t>(observation.image)];
    ColmapPoint& point = model.points[point_index];
    point.track.push_back({image.id, static_cast<std::uint32_t>(image.points.size())});
    image.points.push_back({observation.measured_px, point.id});
    residual_sums[point_index] += observation.residual_px.norm();
  }
  for (std::size_t i = 0; i < model.points.size(); ++i) {
    const std::size_t rays = model.points[i].track.size();
    if (rays > 0) model.points[i].error_px = residual_sums[i] / static_cast<double>(rays);
  }
  return model;
}

}  // namespace crosstie::base
