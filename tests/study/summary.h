#pragma once

#include <filesystem>

namespace crosstie::study {

/// Reads the study's lines and puts its tables into DOCS/accuracy.md, between the lines `<!-- study: NAME -->` and `<!-- end -->`, and plots
/// into DOCS/pictures/accuracy-NAME.svg. Returns 0, or 1 where a file cannot be read or written.
int summarise(const std::filesystem::path& lines, const std::filesystem::path& docs);

}  // namespace crosstie::study
