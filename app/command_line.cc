#include "app/command_line.h"

#include <algorithm>
#include <deque>

#include <fmt/core.h>
#include <CLI/CLI.hpp>

#include "app/completion.h"
#include "app/man_page.h"
#include "base/text.h"
#include "base/version.h"

namespace crosstie::app {
namespace {

using base::ErrorCode;
using base::Result;

/// What CLI11 fills while it parses one verb; the addresses must stay where they are.
struct Slot {
  const Option* option;
  std::vector<std::string> values;
  bool given = false;
};

void add_options(CLI::App& app, const Verb& verb, std::deque<Slot>& slots) {
  for (const Option& option : verb.options) {
    Slot& slot = slots.emplace_back(Slot{&option, {}, false});
    if (option.value.empty() && option.name.starts_with("--")) {
      app.add_flag(option.name, slot.given, option.help);
      continue;
    }
    CLI::Option* added = app.add_option(option.name, slot.values, option.help);
    const bool positional = !option.name.starts_with("--");
    if (positional && option.repeated) {
      added->expected(option.required ? 1 : 0, CLI::detail::expected_max_vector_size);
    } else {
      added->expected(option.values);
      if (option.repeated) added->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
      added->allow_extra_args(false);
    }
    if (!option.value.empty()) added->type_name(option.value);
    if (option.required) added->required();
  }
}

std::string unknown_verb(const std::string& word, const std::vector<Verb>& verbs) {
  std::vector<std::string> names;
  for (const Verb& verb : verbs) names.push_back(verb.name);
  const auto meant = base::nearest_word(word, names);
  return fmt::format("there is no verb '{}'{}; `crosstie --help` lists the verbs", word,
                     meant ? fmt::format(", did you mean '{}'?", *meant) : "");
}

const Option& common_option(std::string_view name) {
  const auto& options = common_options();
  return *std::find_if(options.begin(), options.end(), [&](const Option& option) { return option.name == name; });
}

const Verb* find_verb(const std::string& name, const std::vector<Verb>& verbs) {
  const auto found = std::find_if(verbs.begin(), verbs.end(), [&](const Verb& verb) { return verb.name == name; });
  return found == verbs.end() ? nullptr : &*found;
}

/// `crosstie help --man [VERB]`, `--bash-completion` and `--verbs`: what installations are made of.
Result<std::string> help_text(const std::vector<std::string>& words, const std::vector<Verb>& verbs) {
  const std::string what = words.size() > 1 ? words[1] : "";
  if (what == "--man" && words.size() == 2) return man_page(verbs);
  if (what == "--man" && words.size() == 3) {
    const Verb* verb = find_verb(words[2], verbs);
    if (verb == nullptr) return base::fail(ErrorCode::kUsage, unknown_verb(words[2], verbs));
    return man_page(*verb);
  }
  if (what == "--bash-completion" && words.size() == 2) return bash_completion(verbs);
  if (what == "--verbs" && words.size() == 2) {
    std::string text;
    for (const Verb& verb : verbs) text += verb.name + "\n";
    return text;
  }
  return base::fail(ErrorCode::kUsage,
                    "help takes nothing, a VERB, --man, --man VERB, --verbs or --bash-completion; see `crosstie --help`");
}

}  // namespace

Result<Invocation> parse_command_line(const std::vector<std::string>& words, const std::vector<Verb>& verbs) {
  Invocation invocation;
  if (!words.empty() && words.front() == "help" && find_verb("help", verbs) == nullptr) {
    if (words.size() == 1) return parse_command_line({"--help"}, verbs);
    if (words.size() == 2 && !words[1].starts_with("-")) {
      if (find_verb(words[1], verbs) == nullptr) return base::fail(ErrorCode::kUsage, unknown_verb(words[1], verbs));
      return parse_command_line({words[1], "--help"}, verbs);
    }
    auto text = help_text(words, verbs);
    if (!text) return base::fail(std::move(text));
    invocation.text = *std::move(text);
    return invocation;
  }
  CLI::App app("crosstie ties what a welding machine sees to the machine's own frame; every number carries a sigma.",
               "crosstie");
  app.set_version_flag("--version", std::string(base::version()));
  app.require_subcommand(0, 1);
  app.footer("`crosstie VERB --help` shows the options of a verb and an example.");

  std::deque<std::deque<Slot>> slots;
  std::vector<CLI::App*> subcommands;
  for (const Verb& verb : verbs) {
    CLI::App* sub = app.add_subcommand(verb.name, verb.summary);
    sub->footer("Example:\n" + verb.example);
    add_options(*sub, verb, slots.emplace_back());
    sub->add_flag("--quiet", invocation.quiet, common_option("--quiet").help);
    sub->add_option("--threads", invocation.threads, common_option("--threads").help)
        ->check(CLI::Range(0, 1024))
        ->type_name("N");
    subcommands.push_back(sub);
  }

  if (!words.empty() && !words.front().starts_with("-") && find_verb(words.front(), verbs) == nullptr) {
    return base::fail(ErrorCode::kUsage, unknown_verb(words.front(), verbs));
  }
  try {
    std::vector<std::string> reversed(words.rbegin(), words.rend());
    app.parse(reversed);
  } catch (const CLI::CallForHelp&) {
    invocation.text = app.help();
    return invocation;
  } catch (const CLI::CallForVersion&) {
    invocation.text = fmt::format("crosstie {}\n", base::version());
    return invocation;
  } catch (const CLI::ParseError& error) {
    return base::fail(ErrorCode::kUsage,
                      fmt::format("{}; see `crosstie {}--help`", error.what(), words.empty() ? "" : words.front() + " "));
  }

  for (std::size_t i = 0; i < verbs.size(); ++i) {
    if (!subcommands[i]->parsed()) continue;
    invocation.verb = &verbs[i];
    for (Slot& slot : slots[i]) {
      if (slot.given) invocation.arguments.add(slot.option->name, "");
      for (std::string& value : slot.values) invocation.arguments.add(slot.option->name, std::move(value));
    }
    return invocation;
  }
  invocation.text = app.help();
  return invocation;
}

}  // namespace crosstie::app
