#include "tests/support/damage.h"

#include <algorithm>
#include <random>

namespace crosstie::tests {
namespace {

struct Word {
  const char* name;
  const char* text;
  Fate fate = Fate::kRefused;
};

constexpr Word kNumbers[] = {{"nan", "nan"},
                             {"NaN", "NaN"},
                             {"inf", "inf"},
                             {"minus infinity", "-Infinity"},
                             {"1e999", "1e999"},
                             {"1e308", "1e308", Fate::kAnswered},
                             {"-1e308", "-1e308", Fate::kAnswered},
                             {"1e-320", "1e-320", Fate::kAnswered},
                             {"decimal comma", "12,5", Fate::kAnswered},  // two cells of a table, two words of a list
                             {"two points", "1.2.3"},
                             {"two signs", "--2"},
                             {"unit", "12.5mm"},
                             {"hexadecimal", "0x1p3"},
                             {"word", "twelve"}};

constexpr Word kIds[] = {{"negative id", "-7"},         {"id of 20 digits", "99999999999999999999"},
                         {"id past int", "4294967303"}, {"id with a fraction", "7.5"},
                         {"id text", "seven"},          {"id nan", "nan"},
                         {"id 0", "0", Fate::kAnswered}};

void replace_words(const Sample& sample, const std::string& word, const Word* begin, const Word* end,
                   std::vector<Damage>& damages) {
  if (word.empty()) return;
  for (const Word* other = begin; other != end; ++other) {
    if (auto bytes = replaced(sample.good, word, other->text)) damages.push_back({other->name, *std::move(bytes), other->fate});
  }
}

}  // namespace

std::optional<std::string> replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) return std::nullopt;
  return text.replace(at, from.size(), to);
}

std::vector<Damage> harmless(const Sample& sample) {
  std::vector<Damage> damages = {{"undamaged", sample.good, Fate::kRead}};
  if (!sample.is_text) return damages;
  damages.push_back({"byte order mark", "\xEF\xBB\xBF" + sample.good, Fate::kRead});
  std::string crlf;
  for (const char c : sample.good) crlf += c == '\n' ? std::string("\r\n") : std::string(1, c);
  damages.push_back({"CRLF", crlf, Fate::kRead});
  if (sample.good.ends_with('\n')) {
    damages.push_back({"no last newline", sample.good.substr(0, sample.good.size() - 1), Fate::kRead});
  }
  return damages;
}

std::vector<Damage> cuts(const Sample& sample) {
  std::vector<Damage> damages;
  for (std::size_t part = 0; part < 16; ++part) {
    damages.push_back({"cut at " + std::to_string(part) + "/16", sample.good.substr(0, sample.good.size() * part / 16),
                       part == 0 || sample.sees_every_cut ? Fate::kRefused : Fate::kAnswered});
  }
  return damages;
}

std::vector<Damage> flipped_bits(const Sample& sample, int count) {
  std::mt19937_64 random(13);
  std::vector<Damage> damages;
  for (int i = 0; i < count; ++i) {
    std::string bytes = sample.good;
    const std::size_t at = random() % (i % 2 == 0 ? std::min<std::size_t>(bytes.size(), 128) : bytes.size());
    const auto bit = random() % 8;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << bit));
    damages.push_back({"bit " + std::to_string(bit) + " of byte " + std::to_string(at), std::move(bytes)});
  }
  return damages;
}

std::vector<Damage> wrong_values(const Sample& sample) {
  std::vector<Damage> damages;
  replace_words(sample, sample.number, std::begin(kNumbers), std::end(kNumbers), damages);
  replace_words(sample, sample.id, std::begin(kIds), std::end(kIds), damages);
  if (sample.row.empty()) return damages;
  const auto with_row = [&](const char* name, const std::string& row, Fate fate) {
    if (auto bytes = replaced(sample.good, sample.row, row)) damages.push_back({name, *std::move(bytes), fate});
  };
  std::string semicolons = sample.row;
  std::replace(semicolons.begin(), semicolons.end(), ',', ';');
  if (semicolons != sample.row) with_row("mixed delimiters", semicolons, Fate::kRefused);
  with_row("row twice", sample.row + "\n" + sample.row, Fate::kRefused);
  with_row("row cut", sample.row.substr(0, sample.row.find_last_of(", ")), Fate::kRefused);
  with_row("row too long", sample.row + (sample.row.find(',') == std::string::npos ? " 1 1 1" : ",1,1,1"), Fate::kRefused);
  with_row("row of a million blanks", sample.row + "\n" + std::string(1'000'000, ' '), Fate::kAnswered);
  with_row("row of a million digits", sample.row + "\n" + std::string(1'000'000, '9'), Fate::kRefused);
  with_row("zero byte", sample.row + std::string(1, '\0'), Fate::kRefused);
  return damages;
}

std::vector<Damage> something_else() {
  std::mt19937_64 random(14);
  std::string noise(65536, '\0');
  for (char& c : noise) c = static_cast<char>(random());
  std::vector<Damage> damages = {{"an executable",
                                  std::string("\x7f"
                                              "ELF\x02\x01\x01\0\0\0",
                                              10),
                                  Fate::kRefused},
                                 {"noise", noise, Fate::kRefused},
                                 {"zeros", std::string(4096, '\0'), Fate::kRefused}};
  for (const char c : {'a', '[', '{', ',', ' ', '\n', '\t', '"', '#', '9', '-'}) {
    damages.push_back(
        {std::string("a million of ") + std::to_string(static_cast<int>(c)), std::string(1'000'001, c), Fate::kRefused});
  }
  return damages;
}

}  // namespace crosstie::tests
