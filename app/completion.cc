// Completion of bash from the table of verbs.

#include "app/completion.h"

#include <algorithm>
#include <array>

#include <fmt/core.h>
#include <fmt/ranges.h>

namespace crosstie::app {
namespace {

constexpr std::array<std::string_view, 1> kFolders = {"DIR"};
constexpr std::array<std::string_view, 14> kFiles = {"FILE", "PATH", "JOB",  "RIG",   "IMAGE",   "IN",          "OUT",
                                                     "A",    "B",    "WORD", "SCENE", "PATTERN", "A.ply B.ply", "LEFT RIGHT"};

template <std::size_t kSize>
bool is_one_of(const std::array<std::string_view, kSize>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// In single quotes for bash.
std::string quoted(const std::string& text) {
  std::string safe = "'";
  for (const char c : text) safe += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return safe + "'";
}

/// Words that a place completes to; @file and @folder stand for those that are there.
std::string domain_of(const Option& option) {
  std::vector<std::string> words = option.domain;
  if (is_one_of(kFolders, option.value)) words.emplace_back("@folder");
  if (is_one_of(kFiles, option.value)) words.emplace_back("@file");
  return fmt::format("{}", fmt::join(words, " "));
}

std::string verb_case(const Verb& verb) {
  std::vector<std::string> options, values, domains, places;
  const auto add = [&](const Option& option) {
    if (!option.name.starts_with("--")) {
      places.push_back(quoted(domain_of(option)));
      return;
    }
    options.push_back(option.name);
    if (option.value.empty()) return;
    values.push_back(fmt::format("[{}]={}", option.name, option.values));
    domains.push_back(fmt::format("[{}]={}", option.name, quoted(domain_of(option))));
  };
  for (const Option& option : verb.options) add(option);
  for (const Option& option : common_options()) add(option);
  const bool endless = std::any_of(verb.options.begin(), verb.options.end(),
                                   [](const Option& option) { return !option.name.starts_with("--") && option.repeated; });
  return fmt::format(
      "    {})\n      options={}\n      values=({})\n      domains=({})\n      places=({})\n      endless={}\n      ;;\n",
      verb.name, quoted(fmt::format("{}", fmt::join(options, " "))), fmt::join(values, " "),
      fmt::join(domains, "\n               "), fmt::join(places, " "), endless ? 1 : 0);
}

constexpr const char* kBegin = R"(# bash completion for crosstie; made by `crosstie help --bash-completion`
_crosstie()
{
  local cur=${COMP_WORDS[COMP_CWORD]} prev cword=$COMP_CWORD
  local -a words=("${COMP_WORDS[@]}")
  # Words such as apriltag:tag36h11 are one word here, where the package bash-completion is there to tell.
  declare -F _get_comp_words_by_ref >/dev/null && _get_comp_words_by_ref -n := cur prev words cword
  COMPREPLY=()
  local options='' endless=0
  local -A values domains
  local -a places
)";

constexpr const char* kEnd =
    R"(  # Which place of the line this is: the value of an option, an option, or the place-th word beside these.
  local place=0 pending=0 option='' domain='' word i
  for ((i = 2; i < cword; ++i)); do
    word=${words[i]}
    if ((pending > 0)); then
      ((--pending))
    elif [[ $word == --*=* ]]; then
      :
    elif [[ $word == --* ]]; then
      option=$word
      pending=${values[$word]:-0}
    else
      ((++place))
    fi
  done
  if ((pending > 0)); then
    domain=${domains[$option]}
  elif [[ $cur == --*=* ]]; then
    domain=${domains[${cur%%=*}]}
    cur=${cur#*=}
  elif [[ $cur == -* ]]; then
    domain=$options
  else
    if ((endless && place >= ${#places[@]})); then place=$((${#places[@]} - 1)); fi
    domain=${places[place]:-}
  fi
  local -a found=()
  local names=''
  for word in $domain; do
    case $word in
      @file) mapfile -t -O ${#found[@]} found < <(compgen -f -- "$cur") ;;
      @folder) mapfile -t -O ${#found[@]} found < <(compgen -d -- "$cur") ;;
      *) names+=" $word" ;;
    esac
  done
  if ((${#found[@]} > 0)); then compopt -o filenames 2>/dev/null; fi
  mapfile -t COMPREPLY < <(compgen -W "$names" -- "$cur")
  COMPREPLY+=("${found[@]}")
  declare -F __ltrim_colon_completions >/dev/null && __ltrim_colon_completions "$cur"
  return 0
}
complete -F _crosstie crosstie
)";

}  // namespace

std::string bash_completion(const std::vector<Verb>& verbs) {
  std::vector<std::string> names;
  for (const Verb& verb : verbs) names.push_back(verb.name);
  const std::string all = fmt::format("{}", fmt::join(names, " "));
  std::string text = kBegin;
  text += fmt::format(
      "  if ((cword == 1)); then\n    mapfile -t COMPREPLY < <(compgen -W '{} help --help --version' -- \"$cur\")\n"
      "    return 0\n  fi\n",
      all);
  text += "  case ${words[1]} in\n";
  text += fmt::format("    help)\n      places=('{}')\n      ;;\n", all);
  for (const Verb& verb : verbs) text += verb_case(verb);
  text += "    *) return 0 ;;\n  esac\n";
  return text + kEnd;
}

}  // namespace crosstie::app
