# Foreign libraries, all from Debian bookworm. crosstieConfig.cmake.in finds the same ones for those who link the installed modules.
find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(Ceres 2.1 REQUIRED)
find_package(opengv REQUIRED)
find_package(fmt 9 REQUIRED)
find_package(nlohmann_json 3.11 REQUIRED)
find_package(hwy 1.0 REQUIRED)
find_package(nanoflann 1.4 REQUIRED)
find_package(OpenSSL REQUIRED COMPONENTS Crypto)
find_package(exiv2 REQUIRED)
find_package(JPEG REQUIRED)
find_package(PNG REQUIRED)
find_package(TIFF REQUIRED)
find_package(mrcal REQUIRED)
find_package(OpenCVModules REQUIRED COMPONENTS core imgproc features2d calib3d)
list(APPEND CMAKE_PREFIX_PATH /usr/share/apriltag/cmake)  # where Debian's package puts it
find_package(apriltag 3 REQUIRED)
find_package(PkgConfig REQUIRED)
pkg_check_modules(aravis REQUIRED IMPORTED_TARGET aravis-0.8)
# Its -pthread asks for nothing that Threads::Threads does not give, and would part its users from the precompiled headers.
set_property(TARGET PkgConfig::aravis PROPERTY INTERFACE_COMPILE_OPTIONS)
pkg_check_modules(sdl2 REQUIRED IMPORTED_TARGET sdl2)
set_property(TARGET PkgConfig::sdl2 PROPERTY INTERFACE_COMPILE_OPTIONS)  # -D_REENTRANT, as above
