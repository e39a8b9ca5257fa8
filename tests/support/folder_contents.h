#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "tests/support/temporary_folder.h"

namespace crosstie::tests {

/// Every byte of all files below a folder, by their path in it.
inline std::map<std::string, std::string> folder_contents(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files[std::filesystem::relative(entry.path(), folder).string()] = read_all(entry.path());
  }
  return files;
}

/// The same without the link of reports to the overview of their job, which a result in a folder of its own does not have.
inline std::map<std::string, std::string> result_contents(const std::filesystem::path& folder) {
  constexpr std::string_view kLink = "<a class=\"overview\"", kEnd = "</a>";
  auto files = folder_contents(folder);
  for (auto& [name, bytes] : files) {
    if (const std::size_t link = bytes.find(kLink); name.ends_with("report.html") && link != std::string::npos)
      bytes.erase(link, bytes.find(kEnd, link) + kEnd.size() - link);
  }
  return files;
}

}  // namespace crosstie::tests
