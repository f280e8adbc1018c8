# A room is a folder of sources that becomes one static library, megablock::<room>. Every .cpp in the folder and in the
# folders below it belongs to it, except those in a folder named `main` or `module`.
# Files named *_avx2.cpp are compiled for AVX2 and FMA, *_avx512.cpp for AVX-512, *_portable.cpp for any processor; they
# hold raw-pointer kernels only, reached by run-time dispatch (no Eigen, Ceres or OpenCV types may cross into them:
# their ABI depends on the flags). Without errno a square root is one instruction.

# What everybody who links the library needs, in this tree and in others.
add_library(megablock_base INTERFACE)
add_library(megablock::base ALIAS megablock_base)
target_compile_features(megablock_base INTERFACE cxx_std_20)
# In the installed tree a program may write <megablock/io/result/result.h>; the headers name one another without the
# first folder, as here.
target_include_directories(megablock_base INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
                           $<INSTALL_INTERFACE:include> $<INSTALL_INTERFACE:include/megablock>)
target_link_libraries(megablock_base INTERFACE OpenMP::OpenMP_CXX)  # everywhere: precompiled headers are shared
# Contraction off: a*b+c gives the same bits wherever the compiler could have fused it or not. Inline functions of the
# headers are compiled by whoever includes them, so that this holds for the users of the library, too.
target_compile_options(megablock_base INTERFACE -ffp-contract=off)

# What is compiled in this tree has these options besides.
add_library(megablock_options INTERFACE)
target_link_libraries(megablock_options INTERFACE megablock_base)
target_compile_options(megablock_options INTERFACE -Wall -Wextra -Wshadow)
# Programs start with the libraries they use: each test is a process.
target_link_options(megablock_options INTERFACE LINKER:--as-needed)
# GCC 12's false alarms on inlined copies of std::string and std::vector.
target_compile_options(megablock_options INTERFACE -Wno-restrict -Wno-stringop-overflow -Wno-array-bounds
                                                   -Wno-stringop-overread)
# GCC collects its garbage from 1.5 GB on only: with Eigen's templates that saves a seventh of the build's time.
target_compile_options(megablock_options INTERFACE --param=ggc-min-heapsize=1500000)
if(MEGABLOCK_WERROR)
  target_compile_options(megablock_options INTERFACE -Werror)
endif()
if(MEGABLOCK_SANITIZE)
  # Without the checks of pointers that the address sanitizer makes anyway: in Eigen they triple the build's time.
  target_compile_options(megablock_options INTERFACE -fsanitize=address,undefined
                         -fno-sanitize=null,object-size,alignment,vptr
                         -fno-omit-frame-pointer -fno-sanitize-recover=undefined
                         # GCC's manual: with sanitizers this warning errs, here on Eigen's temporaries.
                         -Wno-maybe-uninitialized)
  # Debian's static libceres holds Eigen code compiled without sanitizers, which takes memory from malloc as it is.
  target_compile_definitions(megablock_options INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
  # dlopen is called by the sanitizer then, which only looks where the program's RPATH says, not its RUNPATH.
  target_link_options(megablock_options INTERFACE -fsanitize=address,undefined LINKER:--disable-new-dtags)
endif()

# Tests only call the rooms, which keep the full optimisation: at -O1 they compile in half the time.
set(megablock_test_options $<$<CONFIG:Release>:-O1>)

# Headers that nearly every file reads, precompiled once for all rooms and once for all tests: half of the build's time.
if(NOT EXISTS ${CMAKE_BINARY_DIR}/headers.cpp)
  file(WRITE ${CMAKE_BINARY_DIR}/headers.cpp "")
endif()
function(megablock_headers target)
  cmake_parse_arguments(HEADERS "" "" "LINK;HEADERS;OPTIONS" ${ARGN})
  add_library(${target} OBJECT ${CMAKE_BINARY_DIR}/headers.cpp)
  target_link_libraries(${target} PRIVATE megablock_options ${HEADERS_LINK})
  target_precompile_headers(${target} PRIVATE ${HEADERS_HEADERS})
  target_compile_options(${target} PRIVATE ${HEADERS_OPTIONS})
endfunction()

set(megablock_portable_options -fno-math-errno)
set(megablock_avx2_options -mavx2 -mfma -fno-math-errno)
set(megablock_avx512_options -mavx512f -mavx512dq -mavx512vl -mprefer-vector-width=512 -fno-math-errno)

function(megablock_room name)
  cmake_parse_arguments(ROOM "" "" "DEPENDS" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${name}/*.cpp)
  list(FILTER sources EXCLUDE REGEX "^${PROJECT_SOURCE_DIR}/${name}/(.*/)?(main|module)/")
  if(NOT sources)
    set(type INTERFACE)
    add_library(megablock_${name} INTERFACE)
  else()
    set(type PUBLIC)
    add_library(megablock_${name} STATIC ${sources})
    foreach(source IN LISTS sources)
      if(source MATCHES "_(portable|avx2|avx512)\\.cpp$")
        set_source_files_properties(${source} PROPERTIES COMPILE_OPTIONS "${megablock_${CMAKE_MATCH_1}_options}"
                                                         SKIP_PRECOMPILE_HEADERS ON)
      endif()
    endforeach()
    target_precompile_headers(megablock_${name} REUSE_FROM megablock_room_headers)
  endif()
  target_link_libraries(megablock_${name} ${type} megablock_base $<BUILD_INTERFACE:megablock_options> ${ROOM_DEPENDS})
  set_target_properties(megablock_${name} PROPERTIES EXPORT_NAME ${name})
  add_library(megablock::${name} ALIAS megablock_${name})
endfunction()

# A text file of a room as a constant: <room>/<header>.h with `extern const char* <name>`, made when building.
function(megablock_embed room file header name)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${room}/${file})
  file(READ ${PROJECT_SOURCE_DIR}/${room}/${file} text)
  set(folder ${CMAKE_BINARY_DIR}/embedded)
  file(CONFIGURE OUTPUT ${folder}/${room}/${header}.h @ONLY CONTENT
       "// Made of ${room}/${file}.\n#pragma once\nnamespace megablock { inline constexpr const char* ${name} = R\"text(@text@)text\"; }\n")
  target_include_directories(megablock_${room} PRIVATE ${folder})
endfunction()

# One test program from the .cpp files of a folder under tests/, all of its cases labelled.
function(megablock_tests target folder)
  cmake_parse_arguments(TESTS "" "LABEL;TIMEOUT" "LINK" ${ARGN})
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.cpp)
  if(NOT sources)
    return()
  endif()
  if(NOT TESTS_TIMEOUT)
    set(TESTS_TIMEOUT 120)
  endif()
  add_executable(${target} ${sources})
  target_link_libraries(${target} PRIVATE ${TESTS_LINK} GTest::gmock GTest::gtest_main)
  target_precompile_headers(${target} REUSE_FROM megablock_test_headers)
  target_compile_options(${target} PRIVATE ${megablock_test_options})
  gtest_discover_tests(${target} DISCOVERY_TIMEOUT 60
                       PROPERTIES LABELS ${TESTS_LABEL} TIMEOUT ${TESTS_TIMEOUT}
                                  # As the program itself: more threads would spin, and those that wait beside others.
                                  ENVIRONMENT OPENBLAS_NUM_THREADS=1
                                  ENVIRONMENT_MODIFICATION OMP_WAIT_POLICY=set:passive)
endfunction()
