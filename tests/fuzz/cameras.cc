// Camera files that are told apart by their contents, .cameramodel first of all. What is read can be written and is then the same camera.
#include <cstdio>

#include "base/camera_file.h"
#include "tests/fuzz/input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace crosstie;
  const auto camera = base::read_camera(fuzz::file("lens.cameramodel", fuzz::text_of(data, size)));
  if (!fuzz::sensible(camera)) return 0;
  const auto path = fuzz::folder() / "again.cameramodel";
  fuzz::expect(base::write_cameramodel(path, *camera).has_value(), "a camera that was read can be written");
  const auto again = base::read_camera(path);
  if (!again) std::fprintf(stderr, "%s\n", again.error().message.c_str());
  fuzz::expect(again && again->parameters() == camera->parameters(), "a camera that was written is read as the same");
  // The lens itself, at the corner of its image and beside it.
  for (const Eigen::Vector3d& point :
       {Eigen::Vector3d(0.1, -0.2, 1.0), Eigen::Vector3d(3.0, 3.0, 1.0), Eigen::Vector3d(0, 0, -1)})
    static_cast<void>(camera->project(point));
  static_cast<void>(camera->unproject(Eigen::Vector2d(camera->width_px() - 1.0, 0.0)));
  return 0;
}
