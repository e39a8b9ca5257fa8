// crosstie.detect(), families()

#include <pybind11/stl.h>

#include "markers/detect.h"
#include "python/arrays.h"
#include "python/call.h"
#include "python/module.h"

namespace crosstie::python {
namespace {

markers::Polarity polarity_of(const std::string& word) {
  if (word == "both") return markers::Polarity::kBoth;
  if (word == "bright") return markers::Polarity::kBrightDots;
  if (word == "dark") return markers::Polarity::kDarkDots;
  raise({base::ErrorCode::kUsage, "polarity is both, bright (dots on dark ground) or dark, not '" + word + "'"});
}

py::array detect(const py::object& image, const std::string& family, const std::optional<std::vector<int>>& ids,
                 const std::string& polarity, double white_level) {
  const ArrayImage pixels(image, white_level);
  markers::DetectOptions options;
  options.ids = ids.value_or(std::vector<int>{});
  options.polarity = polarity_of(polarity);
  const auto seen = call([&](const base::Progress& progress) -> base::Result<base::ImageObservations> {
    const auto markers = markers::marker_family(family);
    if (!markers) return tl::unexpected(markers.error());
    return markers::detect(pixels.view(), *markers, options, progress);
  });
  return observations_array(seen.observations);
}

}  // namespace

void add_detect(py::module_& module) {
  module.def(
      "detect", &detect, py::arg("image"), py::arg("family"), py::arg("ids") = py::none(), py::arg("polarity") = "both",
      py::arg("white_level") = 0.0,
      "Finds coded markers and plain dots in an image.\n\n"
      "image        (rows, columns) of uint8 or uint16, grey levels; looked at where it is, not copied\n"
      "family       ring10, aicon14, apriltag:tag36h11, ...: families() lists them\n"
      "ids          those in use; others are Status.REFUSED. None: all of the family\n"
      "polarity     dots that are bright on dark ground, dark on bright, or both\n"
      "white_level  grey level of a saturated pixel; 0: 255 or 65535\n\n"
      "Returns an array of OBSERVATION, sorted by status, id, y, x: id (-1: none), status (Status), centre_px (2,) with its\n"
      "covariance cov_px2 (2, 2), the ellipse (semi_major_px, semi_minor_px, angle_rad) and the margin of the reading.\n"
      "Pixels: (0, 0) is the centre of the first pixel, x to the right, y down.");
  module.def("families", &markers::marker_family_names, "The names of all marker families.");
}

}  // namespace crosstie::python
