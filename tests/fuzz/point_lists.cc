// Tables and lists without a header: points, balls, scale bars, observations, edge pixels, corners, nominal holes. The first byte of an
// input chooses the reader.
#include "base/aicon_network.h"
#include "base/edge_pixels.h"
#include "base/measured_points.h"
#include "base/point_list.h"
#include "base/result_document.h"
#include "base/sphere_list.h"
#include "base/table.h"
#include "calib/corners.h"
#include "edge/nominal_file.h"
#include "tests/fuzz/input.h"

namespace {

using namespace crosstie;

void read_points(const std::filesystem::path& path) {
  const auto list = base::read_point_list(path, {.unit = "mm"});
  if (!fuzz::sensible(list)) return;
  const auto again_path = fuzz::folder() / "again.csv";
  fuzz::expect(base::write_point_list(again_path, *list).has_value(), "a list that was read can be written");
  const auto again = base::read_point_list(again_path);
  fuzz::expect(again && again->points.size() == list->points.size(), "a list that was written is read as the same");
  for (std::size_t i = 0; i < list->points.size(); ++i) {
    fuzz::expect(again->points[i].id == list->points[i].id && again->points[i].xyz_mm == list->points[i].xyz_mm,
                 "points keep id and coordinates");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string_view input = fuzz::text_of(data, size);
  const std::size_t reader = fuzz::choose(input, 13);
  const auto path = fuzz::file("list", input);
  switch (reader) {
    case 0:
      fuzz::sensible(base::read_table(path));
      break;
    case 1:
      read_points(path);
      break;
    case 2:
      fuzz::sensible(base::read_scale_bars(path));
      break;
    case 3:
      fuzz::sensible(base::read_reference_spheres(path));
      break;
    case 4:
      fuzz::sensible(base::read_probed_spheres(path));
      break;
    case 5:
      fuzz::sensible(base::read_probe_hits(path));
      break;
    case 6:
      fuzz::sensible(base::read_edge_pixels(path));
      break;
    case 7:
      fuzz::sensible(base::read_observations(path));
      break;
    case 8:
      fuzz::sensible(base::read_image_point_sigmas(path));
      break;
    case 9:
      fuzz::sensible(base::read_image_point_ids(path));
      break;
    case 10:
      fuzz::sensible(base::read_measured_points(path, {.unit = "mm", .columns = {}}));
      break;
    case 11:
      fuzz::sensible(calib::read_vnl(path));
      break;
    default:
      fuzz::sensible(edge::read_nominal(path, {.unit = "mm"}));
      break;
  }
  return 0;
}
