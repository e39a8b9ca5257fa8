// PLY clouds and meshes. What is read can be written, and read again as the same.
#include <cstdio>

#include "base/ply.h"
#include "tests/fuzz/input.h"

namespace {

using namespace crosstie;

void write_and_read(const base::Cloud& cloud) {
  const auto path = fuzz::folder() / "again.ply";
  if (!fuzz::sensible(base::write_ply(path, cloud))) return;  // values may be too large for the floats that are written
  const auto again = base::read_ply(path);
  if (!again) std::fprintf(stderr, "%s\n", again.error().message.c_str());
  fuzz::expect(again && again->points == cloud.points && again->fields.size() == cloud.fields.size() &&
                   again->normals.size() == cloud.normals.size() && again->cov_mm2.size() == cloud.cov_mm2.size(),
               "a cloud that was written is read as the same");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto path = fuzz::file("cloud.ply", fuzz::text_of(data, size));
  const auto cloud = base::read_ply(path);
  if (fuzz::sensible(cloud)) write_and_read(*cloud);
  const auto mesh = base::read_ply_mesh(path);
  if (fuzz::sensible(mesh)) {
    for (const auto& triangle : mesh->triangles) {
      for (const auto corner : triangle) fuzz::expect(corner < mesh->vertices.points.size(), "corners of triangles exist");
    }
  }
  return 0;
}
