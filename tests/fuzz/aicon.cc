// The files of an AICON project, alone and as the network that they make together.
#include <array>

#include "base/aicon_files.h"
#include "base/aicon_network.h"
#include "tests/fuzz/input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace crosstie;
  constexpr std::array<std::string_view, 5> kNames = {"p.obc", "p.phc", "p.ior", "p.eor", "p.scale"};
  const auto folder = fuzz::unpack(fuzz::text_of(data, size), kNames);
  const auto there = [&](std::string_view name) { return std::filesystem::exists(folder / name); };
  if (there("p.obc")) fuzz::sensible(base::read_aicon_object_points(folder / "p.obc"));
  if (there("p.phc")) fuzz::sensible(base::read_aicon_image_points(folder / "p.phc"));
  if (there("p.ior")) fuzz::sensible(base::read_aicon_cameras(folder / "p.ior"));
  if (there("p.eor")) fuzz::sensible(base::read_aicon_images(folder / "p.eor"));
  if (there("p.scale")) fuzz::sensible(base::read_aicon_scales(folder / "p.scale"));
  const auto project = base::find_aicon_project(folder);
  if (!fuzz::sensible(project)) return 0;
  const auto network = base::read_aicon_network(*project);
  if (!fuzz::sensible(network)) return 0;
  for (const auto& image : network->images) {
    const auto of_image = [&](const base::NetworkCamera& camera) { return camera.name == image.camera; };
    fuzz::expect(std::any_of(network->cameras.begin(), network->cameras.end(), of_image), "every image has its camera");
  }
  return 0;
}
