# Every folder of the house is a static library made by one call, so that all of them build, install and export alike:
#
#   crosstie_module(markers
#     HEADERS detect.h                  public headers, installed
#     SOURCES detect.cc detail/edge.cc
#     PUBLIC  crosstie::base            modules and libraries that the headers need
#     PRIVATE crosstie::math fmt::fmt)  those that only the sources need
function(crosstie_module name)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "" "HEADERS;SOURCES;PUBLIC;PRIVATE")
  if(arg_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "crosstie_module(${name}): unexpected ${arg_UNPARSED_ARGUMENTS}")
  endif()
  set(target crosstie_${name})
  add_library(${target} STATIC ${arg_SOURCES})
  add_library(crosstie::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${arg_HEADERS})
  # <crosstie/base/pose.h> for those who install it; the headers themselves say "base/pose.h".
  target_include_directories(${target} PUBLIC $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_compile_options(${target} PRIVATE ${CROSSTIE_WARNINGS})
  target_link_libraries(${target} PUBLIC ${arg_PUBLIC} PRIVATE ${arg_PRIVATE} Eigen3::Eigen fmt::fmt)
  target_precompile_headers(${target} REUSE_FROM crosstie_headers)
  set_property(GLOBAL APPEND PROPERTY CROSSTIE_MODULES ${target})
endfunction()
