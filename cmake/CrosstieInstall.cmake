# install(): the executable with man pages and completion, the modules with their headers, and the package that find_package(crosstie)
# finds. Components are the packages of CrosstiePackage.cmake: crosstie, crosstie-dev, python3-crosstie.
include(CMakePackageConfigHelpers)

get_property(modules GLOBAL PROPERTY CROSSTIE_MODULES)
install(TARGETS ${modules} EXPORT crosstieTargets
  ARCHIVE COMPONENT crosstie-dev
  FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/crosstie COMPONENT crosstie-dev)
install(TARGETS crosstie_app RUNTIME COMPONENT crosstie)
install(EXPORT crosstieTargets NAMESPACE crosstie:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/crosstie COMPONENT crosstie-dev)

configure_package_config_file(cmake/crosstieConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/crosstieConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/crosstie)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/crosstieConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/crosstieConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/crosstieConfigVersion.cmake
              cmake/FindOpenCVModules.cmake cmake/Findmrcal.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/crosstie COMPONENT crosstie-dev)

# What `crosstie --help` says, as man pages and as completion for bash.
set(manual ${CMAKE_CURRENT_BINARY_DIR}/manual)
add_custom_command(OUTPUT ${manual}/written
  COMMAND ${CMAKE_COMMAND} -DCROSSTIE=$<TARGET_FILE:crosstie_app> -DFOLDER=${manual} -P ${PROJECT_SOURCE_DIR}/cmake/scripts/write_manual.cmake
  COMMAND ${CMAKE_COMMAND} -E touch ${manual}/written
  DEPENDS crosstie_app cmake/scripts/write_manual.cmake
  COMMENT "Writing man pages and completion" VERBATIM)
add_custom_target(crosstie_manual ALL DEPENDS ${manual}/written)
install(DIRECTORY ${manual}/man1 DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT crosstie)
install(FILES ${manual}/completions/crosstie DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT crosstie)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/crosstie/docs COMPONENT crosstie)
install(FILES README.md DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/crosstie COMPONENT crosstie)
