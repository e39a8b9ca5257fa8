#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "app/session.h"
#include "base/result.h"

namespace crosstie::app {

/// An option of a verb as data, from which the parser, `--help`, the man pages, the completion of shells and docs/cli.md are made.
struct Option {
  std::string name;   ///< "--family", or "JOB" for a positional argument
  std::string value;  ///< name of the value in the help: "FAMILY", "MM"; empty for a switch
  std::string help;   ///< effect, unit and default
  bool required = false;
  bool repeated = false;  ///< may be given several times (a positional one: takes all that follow)
  int values = 1;         ///< how many words it takes each time it is given
  /// Its values where they are a known list, of which some may be names and others files (a scene): what a shell completes.
  std::vector<std::string> domain = {};
};

/// What the user gave.
class Arguments {
 public:
  void add(const std::string& name, std::string value) { values_[name].push_back(std::move(value)); }

  [[nodiscard]] bool has(const std::string& name) const { return values_.contains(name); }
  /// The value given last.
  [[nodiscard]] std::optional<std::string> get(const std::string& name) const;
  [[nodiscard]] std::vector<std::string> all(const std::string& name) const;
  /// A kUsage Error where the value is not a number; nothing where the option was not given.
  [[nodiscard]] base::Result<std::optional<double>> number(const std::string& name) const;
  [[nodiscard]] base::Result<std::optional<long>> integer(const std::string& name) const;

 private:
  std::map<std::string, std::vector<std::string>> values_;
};

/// How a verb ended when it did not fail: kVerdictFailed means that there is a result, but it does not keep a limit.
enum class Outcome { kOk = 0, kVerdictFailed = 1 };

/// One word of the command line.
struct Verb {
  std::string name;
  std::string summary;
  std::string example;  ///< a real session, shown by --help
  std::vector<Option> options;
  base::Result<Outcome> (*run)(const Arguments&, Session&) = nullptr;
};

/// The table of verbs, in the order of the work they do.
[[nodiscard]] const std::vector<Verb>& verbs();

/// What every verb takes beside its own options.
[[nodiscard]] const std::vector<Option>& common_options();

Verb init_verb();
Verb calibrate_verb();
Verb detect_verb();
Verb adjust_verb();
Verb patterns_verb();
Verb plan_verb();
Verb scan_verb();
Verb edge_verb();
Verb stitch_verb();
Verb verify_verb();
Verb run_verb();
Verb report_verb();
Verb live_verb();
Verb simulate_verb();
Verb targets_verb();
Verb commission_verb();
Verb compare_verb();
Verb convert_verb();
Verb fit_verb();

}  // namespace crosstie::app
