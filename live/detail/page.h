#pragma once

#include <string>
#include <string_view>

namespace crosstie::live::detail {

/// live/page/dist/index.html, put into the library at build time (crosstie_embed).
std::string_view index_html();

/// The content security policy of a page whose scripts and styles are inline: those blocks as they are and no others, pictures and
/// requests from the page's own origin only.
std::string page_policy(std::string_view html);

}  // namespace crosstie::live::detail
