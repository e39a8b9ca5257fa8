// The extension crosstie._core, which the package crosstie shows. Wiring only: arrays to nouns, a call, nouns to arrays.

#include "python/module.h"

#include "base/version.h"
#include "python/arrays.h"
#include "python/call.h"

PYBIND11_MODULE(_core, module) {
  using namespace crosstie::python;
  module.doc() = "The compiled part of crosstie.";
  module.attr("__version__") = std::string(crosstie::base::version());
  add_errors(module);
  add_arrays(module);
  add_camera(module);
  add_detect(module);
  add_adjust(module);
  add_scan(module);
  add_stitch(module);
  add_fit(module);
  add_files(module);
}
