#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/result.h"

namespace crosstie::app {

/// A job.toml's text with another axis_mm of one [[station]]; comments, order and every other byte stay as their author wrote them.
/// kBadInput where the text is no TOML or has no such station with a reading; `file` is what messages call it.
base::Result<std::string> with_station_axis(std::string_view text, const std::filesystem::path& file,
                                            const std::string& station, double axis_mm);

/// The same in the file, old or new, never half; a file that says so already is left alone.
base::Result<> write_station_axis(const std::filesystem::path& file, const std::string& station, double axis_mm);

}  // namespace crosstie::app
