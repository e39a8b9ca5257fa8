// python_twin plate|door FOLDER: jobs of the twin for the tests of the Python package, small ones, with their truth.

#include <cstdio>
#include <string>

#include <Eigen/Geometry>

#include "fixtures/fringes.h"
#include "fixtures/simulate.h"

namespace {

using crosstie::base::Result;
using crosstie::fixtures::Scene;

/// A fifth of the markers' size in the images of a real scan is too small to read: scans alone.
Result<Scene> door() {
  auto scene = crosstie::fixtures::make_scene("door");
  if (!scene) return scene;
  scene = crosstie::fixtures::with_image_scale(*std::move(scene), 0.25);
  if (!scene) return scene;
  for (std::size_t i = 1; i < scene->machine->stations.size(); ++i) scene->machine->stations[i].scan = false;
  return scene;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const auto scene = std::string(argv[1]) == "door" ? door() : crosstie::fixtures::make_scene(argv[1]);
  if (!scene) return std::fprintf(stderr, "%s\n", scene.error().message.c_str()), 1;
  const auto done = crosstie::fixtures::simulate(*scene, argv[2], {.seed = 1});
  if (!done) return std::fprintf(stderr, "%s\n", done.error().message.c_str()), 1;
  return 0;
}
