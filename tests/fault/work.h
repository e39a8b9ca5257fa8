#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace crosstie::tests {

/// Something that a verb writes, small enough to be done a thousand times. FOLDER in the words stands for the folder of the work.
struct Work {
  std::string name;
  std::function<bool(const std::filesystem::path&)> make;  ///< the files that it reads
  std::vector<std::string> words;
  std::vector<std::string> outputs;  ///< each is there as it was or as it will be, never in between
  /// What makes the second result differ from the first; none: there is no earlier result.
  std::function<void(const std::filesystem::path&)> change = {};
  /// Exit code where the output is there already: of verbs that never write over anything.
  int again = 0;
};

/// One of every verb that writes files; those of the scanning head are in the work of whole jobs (CROSSTIE_FAULT_SOAK).
std::vector<Work> works();

std::vector<std::string> words_in(const Work& work, const std::filesystem::path& folder);

void PrintTo(const Work& work, std::ostream* out);
std::string name_of(const Work& work);

/// A job of a few small photographs of the twin, with network, reference and one length of it that defines the scale.
bool make_small_job(const std::filesystem::path& folder);

}  // namespace crosstie::tests
