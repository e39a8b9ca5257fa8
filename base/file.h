#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/result.h"

namespace crosstie::base {

/// Largest text or result file that is read into memory.
inline constexpr std::size_t kMaxFileBytes = std::size_t{2} << 30;

/// Reads a regular file whole; directories, FIFOs, devices and files over `max_bytes` are refused.
Result<std::string> read_file(const std::filesystem::path& path, std::size_t max_bytes = kMaxFileBytes);

/// Writes to a temporary name in the same folder, syncs and renames: afterwards `path` holds the old or the new contents,
/// never a mix, and no temporary file is left behind by an error. The folder must exist. A symbolic link is followed; what
/// exists and is no regular file is refused.
Result<> write_file_atomically(const std::filesystem::path& path, std::string_view contents);

/// Creates a folder with its parents; it may exist.
Result<> make_folder(const std::filesystem::path& path);

/// SHA-256 as 64 hexadecimal digits.
std::string sha256_hex(std::string_view bytes);
Result<std::string> sha256_of_file(const std::filesystem::path& path);

/// A path for messages: control characters escaped, so that a message stays one line.
std::string shown(const std::filesystem::path& path);

}  // namespace crosstie::base
