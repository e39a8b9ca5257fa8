# Headers that most sources read, parsed once: the modules share one precompiled header, the tests another that adds GoogleTest.
# Both stand for time only; every source still names what it includes (presets dev, asan and tidy build without them).
set(CROSSTIE_PRECOMPILED <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <map> <numbers> <optional> <set> <span>
                         <string> <string_view> <vector> <Eigen/Core> <Eigen/Geometry> <Eigen/Cholesky> <Eigen/Eigenvalues>
                         <fmt/format.h> <tl/expected.hpp>)
if(CCACHE_PROGRAM AND CMAKE_CXX_COMPILER_LAUNCHER STREQUAL CCACHE_PROGRAM AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # What ccache asks for before it stores objects that were compiled with one.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE_PROGRAM})
  add_compile_options(-fpch-preprocess)
endif()

# crosstie_precompile(crosstie_headers POSITION_INDEPENDENT_CODE HEADERS <vector> LINKS fmt::fmt) makes one; a target with the
# same options takes it by target_precompile_headers(REUSE_FROM).
function(crosstie_precompile name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "POSITION_INDEPENDENT_CODE" "" "HEADERS;LINKS")
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${name}.cc CONTENT "")
  add_library(${name} OBJECT ${CMAKE_CURRENT_BINARY_DIR}/${name}.cc)
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE ${arg_POSITION_INDEPENDENT_CODE})
  target_link_libraries(${name} PRIVATE ${arg_LINKS})
  target_compile_options(${name} PRIVATE ${CROSSTIE_WARNINGS})
  target_precompile_headers(${name} PRIVATE ${arg_HEADERS})
endfunction()

crosstie_precompile(crosstie_headers POSITION_INDEPENDENT_CODE HEADERS ${CROSSTIE_PRECOMPILED} LINKS Eigen3::Eigen fmt::fmt)
