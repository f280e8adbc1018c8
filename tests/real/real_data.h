// Finds the real images: in the folder of the environment variable MEGABLOCK_DATA, else in ../shared/data beside the
// sources. Tests are skipped with a remark if a set is missing.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

namespace megablock::fixture {

inline std::string real_data(const std::string& set) {
  const char* folder = std::getenv("MEGABLOCK_DATA");
  return (std::filesystem::path(folder ? folder : MEGABLOCK_DATA) / set).lexically_normal().string();
}

}  // namespace megablock::fixture

// Skips where the photographs are not: they are no part of the repository.
#define MEGABLOCK_NEEDS_DATA(set)                                           \
  if (!std::filesystem::is_directory(::megablock::fixture::real_data(set))) \
  GTEST_SKIP() << ::megablock::fixture::real_data(set)                      \
               << " is absent; set MEGABLOCK_DATA to the folder of the photographs"
