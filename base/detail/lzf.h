#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace crosstie::base::detail {

/// Expands data in the format of LibLZF, in which the Point Cloud Library compresses. Nothing where they are damaged or do not make exactly
/// `size` bytes; no more than those are ever allocated, and a `size` that such data cannot make is refused before.
std::optional<std::string> lzf_expanded(std::string_view data, std::size_t size);

}  // namespace crosstie::base::detail
