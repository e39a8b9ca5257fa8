#pragma once

#include <string>
#include <vector>

#include "report/context.h"

namespace crosstie::report::detail {

/// A figure that answers the reader's first question, with its uncertainty.
struct KeyFigure {
  std::string name;
  std::string value;   ///< with unit
  std::string detail;  ///< U, or what it is to be compared with
  std::string css_class;
};

/// A page built from the top down: banner with the verdict, key figures, sections, and at the end inputs and options. Its
/// markup is well-formed XML as well as HTML, and a content security policy with the hashes of its own style and scripts lets
/// nothing else run and nothing be fetched.
class Page {
 public:
  explicit Page(const ReportContext& context);

  void key_figures(const std::vector<KeyFigure>& figures);
  /// A section with a heading; `content` is finished markup.
  void section(const std::string& name, const std::string& heading, const std::string& content);
  /// The same before verdicts and warnings: what the reader came for.
  void first_section(const std::string& name, const std::string& heading, const std::string& content);
  /// Warnings of the result, beside those of the envelope.
  void warnings(const std::vector<base::Warning>& warnings);
  /// The 3D view of this scene (JSON, see detail/scene.h). Without JavaScript `fallback`, finished markup, stands in its
  /// place.
  void scene(const std::string& heading, const std::string& scene_json, const std::string& fallback);

  /// The finished page.
  [[nodiscard]] std::string html() const;

 private:
  struct Section {
    std::string name;
    std::string heading;
    std::string content;
  };

  ReportContext context_;
  std::string figures_;
  std::vector<Section> first_;
  std::vector<Section> sections_;
  std::vector<base::Warning> warnings_;
  bool has_scene_ = false;
};

/// "ok", "warning", "fail": the style sheet's class of a verdict.
const char* level_class(base::VerdictLevel level);

/// A paragraph of plain text.
std::string paragraph(const std::string& text, const std::string& css_class = "");

}  // namespace crosstie::report::detail
