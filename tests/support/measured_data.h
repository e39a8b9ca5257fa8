#pragma once

#include <cstdlib>
#include <filesystem>

namespace crosstie::tests {

/// The folder of real measurements that belong to nobody here: $CROSSTIE_DATA, else ../shared/data beside the project.
/// Tests that need one of them start with
///     const auto folder = measured_data("aicon-panel");
///     if (folder.empty()) GTEST_SKIP() << "no aicon-panel in CROSSTIE_DATA";
inline std::filesystem::path measured_data(const char* name) {
  const char* from_environment = std::getenv("CROSSTIE_DATA");
  const std::filesystem::path root = from_environment != nullptr
                                         ? std::filesystem::path(from_environment)
                                         : std::filesystem::path(CROSSTIE_SOURCE_DIR) / ".." / "shared" / "data";
  const std::filesystem::path folder = root / name;
  return std::filesystem::is_directory(folder) ? folder : std::filesystem::path();
}

}  // namespace crosstie::tests
