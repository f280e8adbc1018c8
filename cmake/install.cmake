# The installed tree:
#   bin/megablock                  the program
#   lib/megablock/                 the static libraries of the rooms, and the module that decodes images
#   include/megablock/<room>/...   the public headers
#   lib/cmake/megablock/           for find_package(megablock)
#   share/doc/megablock, share/megablock
#
# A header is public unless a line of its head says "Internal to"; rooms_test.py checks that no public header includes an
# internal one. cluster/ is the program and no part of the library. docs/developer/library.md says how to use it.

include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(library_rooms geometry io partition match adjust merge)
set(package_folder lib/cmake/megablock)

install(TARGETS megablock megablock_image_codecs RUNTIME DESTINATION bin LIBRARY DESTINATION lib/megablock)
install(DIRECTORY cluster/templates/ DESTINATION share/megablock)
install(FILES LICENSE README.md DESTINATION share/doc/megablock)
install(DIRECTORY LICENSES DESTINATION share/doc/megablock)
install(DIRECTORY docs DESTINATION share/doc/megablock)

set(library_targets megablock_base)
foreach(room IN LISTS library_rooms)
  list(APPEND library_targets megablock_${room})
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR} ${room}/*.h)
  foreach(header IN LISTS headers)
    file(STRINGS ${header} internal LIMIT_COUNT 1 REGEX "^// .*Internal to")
    if(NOT internal)
      get_filename_component(folder ${header} DIRECTORY)
      install(FILES ${header} DESTINATION include/megablock/${folder})
    endif()
  endforeach()
endforeach()

set_target_properties(megablock_base PROPERTIES EXPORT_NAME base)
install(TARGETS ${library_targets} EXPORT megablockTargets ARCHIVE DESTINATION lib/megablock)
install(EXPORT megablockTargets NAMESPACE megablock:: DESTINATION ${package_folder})
configure_package_config_file(cmake/megablockConfig.cmake.in ${CMAKE_BINARY_DIR}/megablockConfig.cmake
                              INSTALL_DESTINATION ${package_folder})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/megablockConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/megablockConfig.cmake ${CMAKE_BINARY_DIR}/megablockConfigVersion.cmake
              cmake/dependencies.cmake DESTINATION ${package_folder})
