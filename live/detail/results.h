#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "base/file_descriptor.h"

namespace crosstie::live::detail {

struct ResultFile {
  base::FileDescriptor file;
  std::uint64_t size = 0;
  std::string type;    ///< Content-Type
  std::string policy;  ///< Content-Security-Policy
};

/// Opens a file of the results folder for reading; `path` is relative, with slashes; one that ends with a slash means its index.html.
/// Nothing for whatever is no regular file there: hidden files and folders, "..", symbolic links that lead out of the folder (those
/// within are followed), devices, FIFOs, folders.
[[nodiscard]] std::optional<ResultFile> open_result(const std::filesystem::path& folder, std::string_view path);

}  // namespace crosstie::live::detail
