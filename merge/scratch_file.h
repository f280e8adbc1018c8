// Files of a scratch directory, written again and again with much the same length.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

namespace megablock {

inline void remove_scratch_file(const std::string& path) {
  std::error_code ignored;
  std::filesystem::remove(path, ignored);
}

// Calls write(std::ofstream&) and leaves a file of what it wrote. What was there is written over: pages and blocks
// fetched anew cost more than the copy. False, and no file, when the disk is full.
template <typename Write>
bool write_scratch_file(const std::string& path, Write&& write) {
  std::ofstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  if (!file.is_open()) file.open(path, std::ios::binary | std::ios::out);
  write(file);
  const std::ofstream::pos_type end = file.tellp();
  file.close();
  std::error_code error;
  if (file) std::filesystem::resize_file(path, static_cast<std::uintmax_t>(end), error);
  if (file && !error) return true;
  remove_scratch_file(path);
  return false;
}

}  // namespace megablock
