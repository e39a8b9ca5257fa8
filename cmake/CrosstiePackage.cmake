# Debian packages by `cpack`, one for each component of CrosstieInstall.cmake: crosstie, crosstie-dev and, with CROSSTIE_PYTHON,
# python3-crosstie. `./run package` does all of it.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME crosstie)
set(CPACK_PACKAGE_VENDOR crosstie)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own
set(CPACK_PACKAGE_CONTACT "crosstie <crosstie@localhost>")  # the project has no address; CPack and Debian ask for one
set(CPACK_PACKAGE_DIRECTORY ${CMAKE_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_COMPONENTS_ALL crosstie crosstie-dev)
if(CROSSTIE_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python3-crosstie)
endif()

set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_CROSSTIE_PACKAGE_NAME crosstie)
set(CPACK_DEBIAN_CROSSTIE_PACKAGE_SECTION science)
set(CPACK_DEBIAN_CROSSTIE_DESCRIPTION "photogrammetric calibration and registration for welding machines
crosstie ties what a large welding machine sees to the machine's own frame:
it detects coded markers, calibrates cameras and rigs, adjusts networks of
photographs, scans with fringes, stitches the scans and finds the edge that
is to be welded. Every number carries a sigma.")

set(CPACK_DEBIAN_CROSSTIE-DEV_PACKAGE_NAME crosstie-dev)
set(CPACK_DEBIAN_CROSSTIE-DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_CROSSTIE-DEV_PACKAGE_SHLIBDEPS OFF)
# What crosstieConfig.cmake looks for.
string(JOIN ", " CPACK_DEBIAN_CROSSTIE-DEV_PACKAGE_DEPENDS
  libapriltag-dev libaravis-dev libceres-dev libcpp-httplib-dev libeigen3-dev libexiv2-dev libexpected-dev libfmt-dev libhwy-dev libjpeg-dev libmrcal-dev
  libnanoflann-dev libopencv-calib3d-dev libopencv-core-dev libopencv-features2d-dev libopencv-imgcodecs-dev libopencv-imgproc-dev
  libopengv-dev libpng-dev libsdl2-dev libssl-dev libsuitesparse-dev libtiff-dev libusb-1.0-0-dev nlohmann-json3-dev pkg-config)
set(CPACK_DEBIAN_CROSSTIE-DEV_PACKAGE_RECOMMENDS "cmake (>= 3.25)")
set(CPACK_DEBIAN_CROSSTIE-DEV_DESCRIPTION "photogrammetry for large welding machines (C++ libraries)
Static C++20 libraries of crosstie with their headers, and the package that
CMake's find_package(crosstie) finds.")

if(CROSSTIE_PYTHON)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  math(EXPR next_minor "${Python3_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON3-CROSSTIE_PACKAGE_NAME python3-crosstie)
  set(CPACK_DEBIAN_PYTHON3-CROSSTIE_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON3-CROSSTIE_PACKAGE_DEPENDS
    "python3 (>= ${Python3_VERSION_MAJOR}.${Python3_VERSION_MINOR}), python3 (<< ${Python3_VERSION_MAJOR}.${next_minor}), python3-numpy")
  set(CPACK_DEBIAN_PYTHON3-CROSSTIE_DESCRIPTION "photogrammetry for large welding machines (Python)
The Python package crosstie: detection, adjustment, scanning, stitching and
fits with numpy arrays in and out, and readers of results and clouds.")
endif()

# What every package brings to /usr/share/doc: copyright, the changelog and its Debian form.
set(documents ${CMAKE_CURRENT_BINARY_DIR}/package-documents)
add_custom_command(OUTPUT ${documents}/changelog.Debian.gz
  COMMAND ${CMAKE_COMMAND} -DSOURCE=${PROJECT_SOURCE_DIR} -DFOLDER=${documents} -DVERSION=${PROJECT_VERSION}
          "-DMAINTAINER=${CPACK_PACKAGE_CONTACT}" -P ${PROJECT_SOURCE_DIR}/cmake/scripts/write_package_documents.cmake
  DEPENDS CHANGELOG.md cmake/scripts/write_package_documents.cmake packaging/changelog.awk
  COMMENT "Writing changelogs of the packages" VERBATIM)
add_custom_target(crosstie_package_documents DEPENDS ${documents}/changelog.Debian.gz)
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  # Only packages have these: EXCLUDE_FROM_ALL keeps them out of `cmake --install`.
  install(FILES packaging/copyright ${documents}/changelog.gz ${documents}/changelog.Debian.gz
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${component} COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()

include(CPack)
