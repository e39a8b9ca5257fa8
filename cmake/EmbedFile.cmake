# Writes a C++ source that holds the bytes of a file; called by crosstie_embed (CrosstieEmbed.cmake):
#   cmake -DINPUT=page.css -DOUTPUT=page_css.cc -DFUNCTION=page_css -DHEADER=report/detail/assets.h
#         -DNAMESPACE=crosstie::report::detail -P EmbedFile.cmake
file(READ ${INPUT} hex HEX)
string(REGEX REPLACE "(................................)" "\\1\n" hex "${hex}")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
file(WRITE ${OUTPUT} "// Made by EmbedFile.cmake.
#include \"${HEADER}\"

namespace ${NAMESPACE} {
namespace {
constexpr unsigned char kBytes[] = {
${bytes}
};
}  // namespace

std::string_view ${FUNCTION}() { return {reinterpret_cast<const char*>(kBytes), sizeof kBytes}; }

}  // namespace ${NAMESPACE}
")
