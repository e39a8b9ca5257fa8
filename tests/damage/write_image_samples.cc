// Writes the image samples into a folder, one file each. OpenCV's encoders load a hundred libraries, which 400 processes of the damage tests need not do.
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/base/image_samples.h"

int main(int count, char** words) {
  if (count != 2) {
    std::fprintf(stderr, "usage: write_image_samples FOLDER\n");
    return 2;
  }
  const std::filesystem::path folder = words[1];
  std::filesystem::create_directories(folder);
  for (const auto& [name, bytes] : crosstie::tests::image_samples()) {
    std::ofstream file(folder / name, std::ios::binary);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    if (!file.flush()) return 1;
  }
  return 0;
}
