#include "live/detail/results.h"

#include <algorithm>
#include <array>
#include <system_error>
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>

namespace crosstie::live::detail {
namespace {

namespace fs = std::filesystem;
using base::FileDescriptor;

/// Names only, none of them hidden: neither "." nor "..".
bool plain(const fs::path& path) {
  return !path.empty() && path.is_relative() && std::all_of(path.begin(), path.end(), [](const fs::path& name) {
    const std::string& text = name.native();
    return !text.empty() && text.front() != '.';
  });
}

/// Follows no symbolic link below `folder`, also none that is put there meanwhile.
FileDescriptor open_below(const fs::path& folder, const fs::path& path) {
  FileDescriptor at(::open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
  for (auto name = path.begin(); at.valid() && name != path.end(); ++name) {
    const bool last = std::next(name) == path.end();
    // Without O_NONBLOCK a FIFO would be waited for.
    const int flags = last ? O_RDONLY | O_NONBLOCK | O_NOCTTY : O_PATH | O_DIRECTORY;
    at = FileDescriptor(::openat(at.number(), name->c_str(), flags | O_NOFOLLOW | O_CLOEXEC));
  }
  return at;
}

constexpr std::string_view kBytes = "application/octet-stream";

std::string_view type_of(const std::string& extension) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 20> kTypes = {{
      {".html", "text/html; charset=utf-8"},
      {".json", "application/json"},
      {".csv", "text/csv; charset=utf-8"},
      {".txt", "text/plain; charset=utf-8"},
      {".toml", "text/plain; charset=utf-8"},
      {".yaml", "text/plain; charset=utf-8"},
      {".yml", "text/plain; charset=utf-8"},
      {".cameramodel", "text/plain; charset=utf-8"},
      {".ngc", "text/plain; charset=utf-8"},
      {".dxf", "image/vnd.dxf"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".jpeg", "image/jpeg"},
      {".tif", "image/tiff"},
      {".tiff", "image/tiff"},
      {".pdf", "application/pdf"},
      {".ply", kBytes},
      {".pcd", kBytes},
      {".npy", kBytes},
  }};
  const auto* found = std::find_if(kTypes.begin(), kTypes.end(), [&](const auto& one) { return one.first == extension; });
  return found == kTypes.end() ? kBytes : found->second;
}

/// Reports bring a policy of their own. A job may come from others, so that what runs in its reports must not reach the page's origin, where
/// the token is: a sandbox gives them an origin of their own, as they have it when they are opened as files.
std::string policy_of(const std::string& extension) {
  if (extension == ".html") return "sandbox allow-scripts allow-popups allow-downloads allow-modals; frame-ancestors 'none'";
  if (extension == ".svg") return "default-src 'none'; style-src 'unsafe-inline'; sandbox; frame-ancestors 'none'";
  return "frame-ancestors 'none'";
}

}  // namespace

std::optional<ResultFile> open_result(const fs::path& folder, std::string_view path) {
  if (folder.empty()) return std::nullopt;
  // A path of names cannot hold a zero byte.
  if (path.find('\0') != std::string_view::npos) return std::nullopt;
  fs::path wanted(path.empty() || path.ends_with('/') ? std::string(path) + "index.html" : std::string(path));
  if (!plain(wanted)) return std::nullopt;
  std::error_code failed;
  const fs::path root = fs::canonical(folder, failed);
  if (failed) return std::nullopt;
  const fs::path target = fs::canonical(root / wanted, failed);
  if (failed) return std::nullopt;
  const fs::path below = target.lexically_relative(root);
  if (!plain(below)) return std::nullopt;

  ResultFile result;
  result.file = open_below(root, below);
  struct stat status {};
  if (!result.file.valid() || ::fstat(result.file.number(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  result.size = static_cast<std::uint64_t>(status.st_size);
  const std::string extension = wanted.extension().string();
  result.type = type_of(extension);
  result.policy = policy_of(extension);
  return result;
}

}  // namespace crosstie::live::detail
