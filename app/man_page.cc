// Man pages from the table of verbs.

#include "app/man_page.h"

#include <fmt/core.h>

#include "base/text.h"
#include "base/version.h"

namespace crosstie::app {
namespace {

/// Text as roff shows it: minus signs that can be copied, and no line taken for a request.
std::string roff(std::string_view text) {
  std::string escaped;
  bool begins_line = true;
  for (const char c : text) {
    if (begins_line && (c == '.' || c == '\'')) escaped += "\\&";
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else if (c == '\'') {
      escaped += "\\(aq";
    } else {
      escaped += c;
    }
    begins_line = c == '\n';
  }
  return escaped;
}

std::string header(std::string_view page) {
  std::string upper;
  for (const char c : page) upper += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  return fmt::format(".TH {} 1 \"\" \"crosstie {}\" \"crosstie\"\n", roff(upper), base::version());
}

std::string paragraph(std::string_view tag, std::string_view text) { return fmt::format(".TP\n{}\n{}\n", tag, roff(text)); }

bool positional(const Option& option) { return !option.name.starts_with("--"); }

/// "--left DIR" with both parts set as man pages set them.
std::string tag_of(const Option& option) {
  if (positional(option)) return fmt::format("\\fI{}\\fR", roff(option.name));
  std::string tag = fmt::format("\\fB{}\\fR", roff(option.name));
  if (!option.value.empty()) tag += fmt::format(" \\fI{}\\fR", roff(option.value));
  return tag;
}

std::string synopsis_of(const Option& option) {
  std::string text = tag_of(option) + (option.repeated ? " ..." : "");
  return option.required ? text : "[" + text + "]";
}

std::string help_of(const Option& option) {
  if (option.required && !positional(option)) return option.help + " (required)";
  return option.help;
}

std::string exit_section() {
  std::string text = ".SH EXIT STATUS\n";
  for (const ExitStatus& status : exit_statuses()) text += paragraph(fmt::format("\\fB{}\\fR", status.code), status.meaning);
  return text;
}

/// A real session, as it looks on a terminal.
std::string example_section(std::string_view example) {
  while (example.ends_with('\n')) example.remove_suffix(1);
  if (example.empty()) return "";
  return fmt::format(".SH EXAMPLE\n.nf\n{}\n.fi\n", roff(example));
}

}  // namespace

const std::vector<ExitStatus>& exit_statuses() {
  static const std::vector<ExitStatus> table = {
      {0, "done, every verdict OK or WARNING"},
      {1, "done, but a verdict is FAIL"},
      {2, "the call is wrong: unknown option, contradictory options"},
      {3, "bad input: a damaged file, an unknown key in a job, measurements out of their domain"},
      {4, "the observations do not determine what was asked for; the message names what is weak"},
      {5, "the system: a file cannot be read or written, memory or threads do not suffice"},
      {6, "a device does not answer"},
      {70, "a defect of crosstie"},
      {130, "stopped by Ctrl-C or SIGTERM; nothing half-written is left"},
  };
  return table;
}

std::string man_page(const std::vector<Verb>& verbs) {
  std::string text = header("crosstie");
  text += ".SH NAME\ncrosstie \\- photogrammetric calibration and registration for large CNC welding machines\n";
  text += ".SH SYNOPSIS\n.B crosstie\n\\fIVERB\\fR [\\fIOPTIONS\\fR]\n.br\n.B crosstie\n\\fIVERB\\fR \\fB\\-\\-help\\fR\n.br\n";
  text += ".B crosstie \\-\\-version\n";
  text += ".SH DESCRIPTION\n";
  text += roff(
      "Ties what a welding machine sees to the machine's own frame; every number carries a sigma.\n"
      "Results go to the standard output, talk to the standard error. Lengths are in mm, angles in rad, image coordinates in "
      "px with (0, 0) in the centre of the first pixel.\n");
  text += ".SH VERBS\n";
  for (const Verb& verb : verbs) text += paragraph(fmt::format("\\fBcrosstie\\-{}\\fR(1)", roff(verb.name)), verb.summary);
  text += ".SH OPTIONS OF ALL VERBS\n";
  for (const Option& option : common_options()) text += paragraph(tag_of(option), option.help);
  return text + exit_section();
}

std::string man_page(const Verb& verb) {
  std::string text = header("crosstie-" + verb.name);
  text += fmt::format(".SH NAME\ncrosstie\\-{} \\- {}\n", roff(verb.name), roff(verb.summary));
  text += fmt::format(".SH SYNOPSIS\n.B crosstie {}\n", roff(verb.name));
  for (const Option& option : verb.options) text += synopsis_of(option) + "\n";
  text += ".SH OPTIONS\n";
  for (const Option& option : verb.options) text += paragraph(tag_of(option), help_of(option));
  for (const Option& option : common_options()) text += paragraph(tag_of(option), option.help);
  return text + example_section(verb.example) + exit_section() + ".SH SEE ALSO\n.BR crosstie (1)\n";
}

}  // namespace crosstie::app
