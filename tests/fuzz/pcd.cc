// PCD clouds: text, binary, and compressed. What is read can be written, and read again with as many points and fields.
#include "base/pcd.h"
#include "tests/fuzz/input.h"

using namespace crosstie;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto cloud = base::read_pcd(fuzz::file("cloud.pcd", fuzz::text_of(data, size)));
  if (!fuzz::sensible(cloud)) return 0;
  const auto path = fuzz::folder() / "again.pcd";
  if (!fuzz::sensible(base::write_pcd(path, *cloud))) return 0;  // values may be too large for the floats that are written
  const auto again = base::read_pcd(path);
  fuzz::expect(again && again->points.size() == cloud->points.size() && again->fields.size() == cloud->fields.size() &&
                   again->normals.size() == cloud->normals.size() && again->cov_mm2.size() == cloud->cov_mm2.size(),
               "a cloud that was written is read with as many points and fields");
  return 0;
}
