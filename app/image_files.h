#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.h"

namespace crosstie::app {

/// A photograph of a job.
struct ImageFile {
  std::string name;  ///< unique in the job: the file's stem, or camera/stem where two cameras' files are named alike
  std::string camera;
  std::filesystem::path path;
};

/// The image files that a pattern names: `*` and `?` in the file's name, sorted by name. A pattern without an ending takes the
/// known image types only. No match is a kBadInput Error.
base::Result<std::vector<std::filesystem::path>> match_files(const std::filesystem::path& pattern);

/// Names the files; sorted by name. The same file twice is a kBadInput Error.
base::Result<std::vector<ImageFile>> name_images(std::vector<ImageFile> files);

/// NAME='PATTERN', the value of `option`: the name of a camera and the pattern of its files. A kUsage Error for anything else.
base::Result<std::pair<std::string, std::string>> named_pattern(const std::string& option, const std::string& word);

/// What the `*` and `?` of a file pattern stand for in a file that fits it, each `*` taking as little as it can.
std::string wildcard_text(std::string_view name, std::string_view pattern);

/// Whether a file name fits a pattern of `*` and `?`.
bool fits_pattern(std::string_view name, std::string_view pattern);

}  // namespace crosstie::app
