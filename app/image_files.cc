#include "app/image_files.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include <fmt/core.h>

namespace crosstie::app {
namespace {

namespace fs = std::filesystem;
using base::ErrorCode;
using base::Result;

bool is_image_name(const fs::path& path) {
  static constexpr std::array<std::string_view, 8> kEndings = {".png", ".tif", ".tiff", ".bmp",
                                                               ".pgm", ".jpg", ".jpeg", ".ppm"};
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  return std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end();
}

}  // namespace

bool fits_pattern(std::string_view name, std::string_view pattern) {
  // Greedy with one way back: `star` is the last * met, `resume` where in the name it may swallow one character more.
  std::size_t n = 0;
  std::size_t p = 0;
  std::size_t star = std::string_view::npos;
  std::size_t resume = 0;
  while (n < name.size()) {
    if (p < pattern.size() && (pattern[p] == '?' || pattern[p] == name[n]) && pattern[p] != '*') {
      ++n;
      ++p;
    } else if (p < pattern.size() && pattern[p] == '*') {
      star = p++;
      resume = n;
    } else if (star != std::string_view::npos) {
      p = star + 1;
      n = ++resume;
    } else {
      return false;
    }
  }
  return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

std::string wildcard_text(std::string_view name, std::string_view pattern) {
  std::string text;
  while (!pattern.empty() && !name.empty()) {
    if (pattern.front() == '*') {
      pattern.remove_prefix(1);
      while (!name.empty() && !fits_pattern(name, pattern)) {
        text += name.front();
        name.remove_prefix(1);
      }
      continue;
    }
    if (pattern.front() == '?') text += name.front();
    pattern.remove_prefix(1);
    name.remove_prefix(1);
  }
  return text;
}

Result<std::pair<std::string, std::string>> named_pattern(const std::string& option, const std::string& word) {
  const std::size_t equals = word.find('=');
  const std::string name = word.substr(0, equals);
  const bool plain =
      !name.empty() &&
      name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") == std::string::npos;
  if (equals == std::string::npos || !plain || equals + 1 == word.size()) {
    return base::fail(ErrorCode::kUsage,
                      fmt::format("{} takes NAME='PATTERN' (NAME of letters, digits, _ and -), not '{}'", option, word));
  }
  return std::pair{name, word.substr(equals + 1)};
}

Result<std::vector<fs::path>> match_files(const fs::path& pattern) {
  const fs::path folder = pattern.has_parent_path() ? pattern.parent_path() : fs::path(".");
  const std::string name = pattern.filename().string();
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("there is no folder {} (for the images {})", folder.string(), pattern.string()));
  }
  std::vector<fs::path> files;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const fs::path& path = it->path();
    if (fits_pattern(path.filename().string(), name) && is_image_name(path) && it->is_regular_file(error))
      files.push_back(path);
  }
  if (error)
    return base::fail(ErrorCode::kFileSystem, fmt::format("cannot read the folder {}: {}", folder.string(), error.message()));
  if (files.empty()) {
    return base::fail(ErrorCode::kBadInput,
                      fmt::format("no image fits {} (PNG, TIFF, BMP, PGM or JPEG files are looked for)", pattern.string()));
  }
  std::sort(files.begin(), files.end());
  return files;
}

Result<std::vector<ImageFile>> name_images(std::vector<ImageFile> files) {
  std::map<std::string, int> stems;
  std::set<fs::path> seen;
  for (const ImageFile& file : files) {
    if (!seen.insert(file.path).second) {
      return base::fail(ErrorCode::kBadInput, fmt::format("the image {} is named twice", file.path.string()));
    }
    ++stems[file.path.stem().string()];
  }
  std::set<std::string> names;
  for (ImageFile& file : files) {
    const std::string stem = file.path.stem().string();
    file.name = stems[stem] == 1 ? stem : fmt::format("{}/{}", file.camera, stem);
    if (!names.insert(file.name).second) file.name = file.path.lexically_normal().string();
  }
  std::sort(files.begin(), files.end(), [](const ImageFile& a, const ImageFile& b) { return a.name < b.name; });
  return files;
}

}  // namespace crosstie::app
