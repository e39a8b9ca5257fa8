#pragma once

#include <string>
#include <string_view>

namespace crosstie::app {

/// A TOML basic string, quoted and escaped.
std::string toml_string(std::string_view text);
/// A TOML number that reads back exactly, always a float or an integer TOML knows.
std::string toml_number(double value);

}  // namespace crosstie::app
