#include "app/lens_word.h"

#include <algorithm>

namespace crosstie::app {
namespace {

constexpr std::string_view kPrefix = "LENSMODEL_";

std::string mapped(std::string_view text, char from, char to) {  // the case of ASCII letters, whatever the locale
  std::string result(text);
  for (char& c : result) {
    if (c >= from && c <= from + 25) c = static_cast<char>(c - from + to);
  }
  return result;
}

}  // namespace

const std::vector<std::string>& lens_words() {
  static const std::vector<std::string> words = {"pinhole", "opencv4", "opencv5", "opencv8", "opencv12"};
  return words;
}

std::optional<base::LensModel> lens_from_word(std::string_view word) {
  const auto& words = lens_words();
  if (std::find(words.begin(), words.end(), word) == words.end()) return std::nullopt;
  return base::lens_model_from_name(std::string(kPrefix) + mapped(word, 'a', 'A'));
}

std::string lens_word(base::LensModel lens) {
  const std::string full_name = base::lens_model_name(lens);
  std::string_view name = full_name;
  if (name.starts_with(kPrefix)) name.remove_prefix(kPrefix.size());
  return mapped(name, 'A', 'a');
}

}  // namespace crosstie::app
