# install(): the executable, the modules with their headers, and the package that find_package(crosstie) finds.
include(CMakePackageConfigHelpers)

get_property(modules GLOBAL PROPERTY CROSSTIE_MODULES)
install(TARGETS ${modules} EXPORT crosstieTargets FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/crosstie)
install(TARGETS crosstie_app RUNTIME)
install(EXPORT crosstieTargets NAMESPACE crosstie:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/crosstie)

configure_package_config_file(cmake/crosstieConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/crosstieConfig.cmake
  INSTALL_DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/crosstie)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/crosstieConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/crosstieConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/crosstieConfigVersion.cmake
              cmake/FindOpenCVModules.cmake cmake/Findmrcal.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/crosstie)
