#include <cstdio>

#include <crosstie/base/camera.h>
#include <crosstie/bundle/adjust.h>
#include <crosstie/devices/aravis_camera.h>
#include <crosstie/markers/family.h>

int main() {
  const auto camera = crosstie::base::Camera::nominal(crosstie::base::LensModel::kOpenCv5, 2000, 1500, 2100.0);
  if (!camera) return 1;
  const auto pixel = camera->project({100.0, 0.0, 1000.0});
  const auto family = crosstie::markers::marker_family("ring10");
  if (!pixel || !family) return 1;
  // A network without images has no solution; what is proven here is that the adjustment and all it needs link and run.
  const auto adjusted = crosstie::bundle::adjust({});
  std::printf("pixel %.1f %.1f, %zu ids, adjust: %s\n", pixel->x(), pixel->y(), family->codes.size(),
              adjusted ? "solved" : adjusted.error().message.c_str());
  const auto camera_device = crosstie::devices::open_aravis_camera("");
  if (camera_device) return 1;
  return family->codes.size() == 54 && !adjusted ? 0 : 1;
}
