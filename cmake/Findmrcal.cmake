# mrcal's C library as the imported targets mrcal::mrcal and, for its sparse matrices, mrcal::cholmod: Debian's packages bring
# neither CMake nor pkg-config files. Its interface changes with every release; written against 2.2.
find_path(mrcal_INCLUDE_DIR mrcal/mrcal.h)
find_library(mrcal_LIBRARY mrcal)
find_path(mrcal_CHOLMOD_INCLUDE_DIR suitesparse/cholmod.h)
find_library(mrcal_CHOLMOD_LIBRARY cholmod)
set(_required mrcal_LIBRARY mrcal_INCLUDE_DIR mrcal_CHOLMOD_LIBRARY mrcal_CHOLMOD_INCLUDE_DIR)

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(mrcal REQUIRED_VARS ${_required})

if(mrcal_FOUND AND NOT TARGET mrcal::mrcal)
  add_library(mrcal::mrcal UNKNOWN IMPORTED)
  set_target_properties(mrcal::mrcal PROPERTIES
    IMPORTED_LOCATION ${mrcal_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${mrcal_INCLUDE_DIR}
    INTERFACE_SYSTEM_INCLUDE_DIRECTORIES ${mrcal_INCLUDE_DIR})
  add_library(mrcal::cholmod UNKNOWN IMPORTED)
  set_target_properties(mrcal::cholmod PROPERTIES
    IMPORTED_LOCATION ${mrcal_CHOLMOD_LIBRARY}
    INTERFACE_INCLUDE_DIRECTORIES ${mrcal_CHOLMOD_INCLUDE_DIR}
    INTERFACE_SYSTEM_INCLUDE_DIRECTORIES ${mrcal_CHOLMOD_INCLUDE_DIR})
endif()
mark_as_advanced(${_required})
unset(_required)
