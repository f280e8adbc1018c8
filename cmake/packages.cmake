# Tools and packages of the build. Every package comes from Debian 12 (see .ci/packages).

find_program(CCACHE ccache)
if(CCACHE)
  # It caches files with precompiled headers only when told that their macros and times do not matter.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE})
endif()
find_program(MOLD mold)
if(MOLD)
  add_link_options(-fuse-ld=mold)
endif()

# CMake passes over a dependency that is missing; here each is wanted.
set(CMAKE_FIND_PACKAGE_NAME megablock)
set(megablock_FIND_REQUIRED TRUE)
include(${CMAKE_CURRENT_LIST_DIR}/dependencies.cmake)

# What the program needs besides the library.
find_package(MPI REQUIRED COMPONENTS CXX)
find_package(spdlog REQUIRED)
find_package(CLI11 REQUIRED)
