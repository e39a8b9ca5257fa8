// COLMAP models, text and binary. What is read can be written in both formats and is then read as the same.
#include <array>
#include <cstdio>

#include "base/colmap_model.h"
#include "tests/fuzz/input.h"

namespace {

using namespace crosstie;

void write_and_read(const base::ColmapModel& model, base::ColmapFormat format) {
  const auto again_folder = fuzz::folder() / "again";
  std::filesystem::remove_all(again_folder);
  std::filesystem::create_directory(again_folder);
  const auto written = base::write_colmap_model(again_folder, model, format);
  if (!written) {
    fuzz::expect_sensible(written.error());  // a name that the text format cannot hold
    return;
  }
  const auto again = base::read_colmap_model(again_folder);
  if (!again) std::fprintf(stderr, "%s\n", again.error().message.c_str());
  fuzz::expect(again && again->cameras.size() == model.cameras.size() && again->images.size() == model.images.size() &&
                   again->points.size() == model.points.size(),
               "a model that was written is read as the same");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::array<std::string_view, 6> kNames = {"cameras.txt", "images.txt", "points3D.txt",
                                                      "cameras.bin", "images.bin", "points3D.bin"};
  const auto model = base::read_colmap_model(fuzz::unpack(fuzz::text_of(data, size), kNames));
  if (!fuzz::sensible(model)) return 0;
  write_and_read(*model, base::ColmapFormat::kText);
  write_and_read(*model, base::ColmapFormat::kBinary);
  return 0;
}
