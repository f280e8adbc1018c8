# The packages that the library links. The build reads this file, and so does find_package(megablock) from where it is
# installed, so that both find the same targets. Every package comes from Debian 12 (see .ci/packages).

include(CMakeFindDependencyMacro)
find_dependency(Threads)
find_dependency(OpenMP)
find_dependency(Eigen3 3.4)
find_dependency(Boost 1.74)
find_dependency(Ceres 2.1)
find_dependency(OpenCV 4.6 COMPONENTS core imgproc imgcodecs features2d calib3d ml)
set(HDF5_PREFER_PARALLEL OFF)
find_dependency(HDF5 COMPONENTS C)
find_dependency(fmt)
find_dependency(yaml-cpp)
find_dependency(nlohmann_json)
find_dependency(PROJ)
find_dependency(exiv2)

# Packages without a CMake configuration of their own. Targets whose names another package could also choose are in the
# namespace megablock.
function(megablock_library target library header)
  if(TARGET ${target})
    return()
  endif()
  string(MAKE_C_IDENTIFIER "found_${library}" variable)
  find_library(${variable} ${library} REQUIRED)
  find_path(${variable}_include ${header} PATH_SUFFIXES ${ARGN} REQUIRED)
  add_library(${target} UNKNOWN IMPORTED GLOBAL)
  set_target_properties(${target} PROPERTIES IMPORTED_LOCATION ${${variable}}
                        INTERFACE_INCLUDE_DIRECTORIES ${${variable}_include})
endfunction()
megablock_library(megablock::metis metis metis.h)
megablock_library(xxHash::xxHash xxhash xxhash.h)
megablock_library(SuiteSparse::CHOLMOD cholmod cholmod.h suitesparse)
megablock_library(megablock::openblas openblas cblas.h x86_64-linux-gnu/openblas-pthread openblas-pthread)
# CGAL is headers; its exact arithmetic is GMP and MPFR.
megablock_library(megablock::gmp gmp gmp.h)
megablock_library(megablock::mpfr mpfr mpfr.h)
