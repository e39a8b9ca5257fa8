#pragma once

#include <optional>
#include <string>
#include <vector>

namespace crosstie::tests {

/// A file that is read well, and where its contents can be hurt. The words stand in it as written here; an empty one means that
/// the format has no such thing.
struct Sample {
  std::string good;
  bool is_text = false;
  bool sees_every_cut = true;  ///< false where a shorter file is a good file, too
  std::string number = {};     ///< a measured value
  std::string id = {};
  std::string row = {};  ///< with an id that may occur once
};

enum class Fate {
  kRead,      ///< the file is as good as before
  kRefused,   ///< an error that names the file
  kAnswered,  ///< read or refused: the damage may make another good file
};

struct Damage {
  std::string name;
  std::string bytes;
  Fate fate = Fate::kAnswered;
};

/// What editors and other systems do to a text; nothing is lost by it.
std::vector<Damage> harmless(const Sample& sample);
/// Cut at every sixteenth.
std::vector<Damage> cuts(const Sample& sample);
/// One bit flipped, `count` times, every other time among the first 128 bytes.
std::vector<Damage> flipped_bits(const Sample& sample, int count);
/// Values, ids and rows that nobody measured.
std::vector<Damage> wrong_values(const Sample& sample);
/// Files of another kind and a million bytes of one character.
std::vector<Damage> something_else();

/// `text` with its first `from` replaced, or nothing where it has none.
std::optional<std::string> replaced(std::string text, const std::string& from, const std::string& to);

}  // namespace crosstie::tests
