#pragma once

#include <filesystem>
#include <string>

#include "base/file_descriptor.h"
#include "base/result.h"

namespace crosstie::base::detail {

/// "cannot <doing> <path>: <strerror(number)>", kFileSystem.
tl::unexpected<Error> system_failure(std::string_view doing, const std::filesystem::path& path, int number);

/// Opens a regular file for reading without ever waiting for it (a FIFO would).
Result<FileDescriptor> open_regular(const std::filesystem::path& path);

/// read() that repeats after signals; -1 with errno on failure.
long read_some(int fd, char* buffer, std::size_t size);

}  // namespace crosstie::base::detail
