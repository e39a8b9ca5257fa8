set(CROSSTIE_EMBED_SCRIPT ${CMAKE_CURRENT_LIST_DIR}/EmbedFile.cmake)

# Files that become part of a library, so that the program is one file and building needs no Node:
#
#   crosstie_embed(embedded HEADER report/detail/assets.h NAMESPACE crosstie::report::detail FILES assets/page.css)
#
# sets `embedded` to the sources made of them; that of assets/page.css defines std::string_view page_css(), which the header declares.
function(crosstie_embed sources)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "HEADER;NAMESPACE" "FILES")
  set(made)
  foreach(file IN LISTS arg_FILES)
    get_filename_component(name ${file} NAME)
    string(REPLACE "." "_" function ${name})
    set(source ${CMAKE_CURRENT_BINARY_DIR}/${function}.cc)
    add_custom_command(
      OUTPUT ${source}
      COMMAND ${CMAKE_COMMAND} -DINPUT=${CMAKE_CURRENT_SOURCE_DIR}/${file} -DOUTPUT=${source} -DFUNCTION=${function}
              -DHEADER=${arg_HEADER} -DNAMESPACE=${arg_NAMESPACE} -P ${CROSSTIE_EMBED_SCRIPT}
      DEPENDS ${file} ${CROSSTIE_EMBED_SCRIPT}
      COMMENT "Embedding ${file}"
      VERBATIM)
    list(APPEND made ${source})
  endforeach()
  set(${sources} ${made} PARENT_SCOPE)
endfunction()
