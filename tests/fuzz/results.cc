// Result folders: result.json, residuals.csv, covariance.json and covariance.npy. The first byte of an input chooses the reader.
#include <array>

#include "base/calibration_reader.h"
#include "base/commissioning_reader.h"
#include "base/envelope_reader.h"
#include "base/json_file.h"
#include "base/network_reader.h"
#include "base/npy.h"
#include "base/result_document.h"
#include "base/scan_markers_reader.h"
#include "base/stitching_reader.h"
#include "tests/fuzz/input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace crosstie;
  constexpr std::array<std::string_view, 6> kNames = {"result.json",    "residuals.csv", "covariance.json",
                                                      "covariance.npy", "markers.csv",   "marker_points.csv"};
  std::string_view input = fuzz::text_of(data, size);
  const std::size_t reader = fuzz::choose(input, 8);
  const auto folder = fuzz::unpack(input, kNames);
  const auto readable = [](const auto& result) {
    if (!result && result.error().code != base::ErrorCode::kFileSystem)
      fuzz::expect_sensible(result.error());  // a file is missing
    return result.has_value();
  };
  switch (reader) {
    case 0:
      readable(base::read_adjusted_network(folder));
      break;
    case 1:
      readable(base::read_calibration(folder));
      break;
    case 2:
      readable(base::read_commissioning(folder));
      break;
    case 3:
      readable(base::read_stitching(folder));
      break;
    case 4:
      readable(base::read_covariance(folder));
      break;
    case 5:
      readable(base::read_envelope(folder));
      break;
    case 6:
      readable(base::read_scan_markers(folder));
      break;
    default:
      readable(base::points_from_network_json(folder / "result.json"));
      break;
  }
  return 0;
}
