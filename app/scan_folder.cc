#include "app/scan_folder.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/head_files.h"
#include "base/image.h"
#include "base/json_file.h"
#include "base/ply.h"

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::fail;
using base::Result;

const std::vector<double>* field_of(const base::Cloud& cloud, const std::string& name) {
  const auto found =
      std::find_if(cloud.fields.begin(), cloud.fields.end(), [&](const auto& field) { return field.name == name; });
  return found == cloud.fields.end() ? nullptr : &found->values;
}

/// The cloud's depths and sigmas, back at their pixels.
Result<> read_depths(const fs::path& path, int width, int height, ScanFolder& scan) {
  const auto cloud = base::read_ply(path);
  if (!cloud) return tl::unexpected(cloud.error());
  const auto* column = field_of(*cloud, "column");
  const auto* row = field_of(*cloud, "row");
  const auto* sigma = field_of(*cloud, "sigma_mm");
  if (column == nullptr || row == nullptr || sigma == nullptr)
    return fail(ErrorCode::kBadInput, path.string() + ": no fields column, row and sigma_mm; is it the cloud of a scan?");
  scan.depth_mm.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                       std::numeric_limits<float>::quiet_NaN());
  scan.sigma_mm = scan.depth_mm;
  for (std::size_t i = 0; i < cloud->points.size(); ++i) {
    if (!((*column)[i] >= 0.0 && (*column)[i] < width && (*row)[i] >= 0.0 && (*row)[i] < height)) {
      return fail(ErrorCode::kBadInput, fmt::format("{}: point {} belongs to pixel {}, {} of an image of {} x {} px",
                                                    path.string(), i, (*column)[i], (*row)[i], width, height));
    }
    const auto at =
        static_cast<std::size_t>((*row)[i]) * static_cast<std::size_t>(width) + static_cast<std::size_t>((*column)[i]);
    scan.depth_mm[at] = static_cast<float>(cloud->points[i].z());
    scan.sigma_mm[at] = static_cast<float>((*sigma)[i]);
  }
  return {};
}

/// Size of the left image.
Result<base::ImageInfo> size_of(const nlohmann::ordered_json& result, const fs::path& path) {
  constexpr int kMost = 100000;
  const auto size = result.find("image_px");
  const bool known = size != result.end() && size->is_array() && size->size() == 2 && (*size)[0].is_number_integer() &&
                     (*size)[1].is_number_integer();
  if (!known) return fail(ErrorCode::kBadInput, path.string() + ": image_px is missing; scan again");
  const auto width = (*size)[0].get<std::int64_t>();
  const auto height = (*size)[1].get<std::int64_t>();
  if (width < 1 || height < 1 || width > kMost || height > kMost || width * height > base::kMaxImagePixels)
    return fail(ErrorCode::kBadInput, fmt::format("{}: image_px is {} x {}", path.string(), width, height));
  return base::ImageInfo{static_cast<int>(width), static_cast<int>(height), 8};
}

/// Places of the test of the head.
Result<std::vector<base::HeadTest::Place>> places_of(const nlohmann::ordered_json& result, const fs::path& path) {
  std::vector<base::HeadTest::Place> places;
  const auto test = result.find("head_test");
  if (test == result.end() || !test->is_object() || !test->contains("places")) return places;
  for (const auto& row : (*test)["places"]) {
    const bool is_good = row.is_array() && row.size() == 4 &&
                         std::all_of(row.begin(), row.end(), [](const auto& one) { return one.is_number(); });
    if (!is_good || !(row[3].get<double>() > 0.0))
      return fail(ErrorCode::kBadInput,
                  path.string() + ": head_test.places holds rows of column, row, off_px, sigma_px; scan again");
    places.push_back({{row[0].get<double>(), row[1].get<double>()}, row[2].get<double>(), row[3].get<double>()});
  }
  return places;
}

}  // namespace

Result<ScanFolder> read_scan_folder(const fs::path& folder, const std::string& head_text) {
  const fs::path result_path = folder / "result.json";
  const auto result = base::read_json(result_path);
  if (!result) return tl::unexpected(result.error());
  const auto verb = result->find("verb");
  if (verb == result->end() || !verb->is_string() || verb->get<std::string>() != "scan")
    return fail(ErrorCode::kBadInput, result_path.string() + ": not the result of a scan");
  std::string head_name = head_text;
  if (head_name.empty()) {
    const auto options = result->find("options");
    if (options == result->end() || !options->is_object() || !options->contains("head") || !(*options)["head"].is_string())
      return fail(ErrorCode::kBadInput, result_path.string() + ": it does not say with which head it was made; give --rig");
    head_name = (*options)["head"].get<std::string>();
  }
  const auto size = size_of(*result, result_path);
  if (!size) return tl::unexpected(size.error());
  auto head = read_head(head_name, size->width, size->height);
  if (!head) {
    return fail(head.error().code, fmt::format("{} (the head of {}; --rig names it where it lies elsewhere)",
                                               head.error().message, folder.string()));
  }
  ScanFolder scan{.head = std::move(head->head),
                  .edges = {},
                  .depth_mm = {},
                  .sigma_mm = {},
                  .off_curve = {},
                  .files = std::move(head->files)};
  auto places = places_of(*result, result_path);
  if (!places) return fail(std::move(places));
  scan.off_curve = *std::move(places);
  if (auto ok = read_depths(folder / "cloud.ply", size->width, size->height, scan); !ok) return fail(std::move(ok));
  auto edges = base::read_edge_pixels(folder / "edge_pixels.csv");
  if (!edges) return fail(std::move(edges));
  for (std::size_t camera = 0; camera < 2; ++camera) {
    const base::Camera& lens = camera == 0 ? scan.head.left : scan.head.right;
    const std::string& name = camera == 0 ? scan.head.left_name : scan.head.right_name;
    const auto found =
        std::find_if(edges->begin(), edges->end(), [&](const base::EdgePixels& one) { return one.camera == name; });
    if (found != edges->end()) scan.edges[camera] = *std::move(found);
    scan.edges[camera].camera = name;
    scan.edges[camera].width = lens.width_px();
    scan.edges[camera].height = lens.height_px();
    const auto list = result->find("edges");
    const bool known = list != result->end() && list->is_array() && list->size() == 2 && (*list)[camera].is_object() &&
                       (*list)[camera].contains("piece_px") && (*list)[camera]["piece_px"].is_number();
    if (!known || !((*list)[camera]["piece_px"].get<double>() > 0.0))
      return fail(ErrorCode::kBadInput, result_path.string() + ": edges[].piece_px is missing; scan again");
    scan.edges[camera].piece_px = (*list)[camera]["piece_px"].get<double>();
  }
  for (const char* name : {"cloud.ply", "edge_pixels.csv", "result.json"}) scan.files.push_back(folder / name);
  return scan;
}

}  // namespace crosstie::app
