// Simulates failures of a scratch directory: the error for a file that cannot be read, and a full disk.
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "io/base/error.h"

namespace megablock {

// read() throws a StoreError that names the file and what to do.
template <typename Read>
void expect_named(Read&& read, const std::string& file) {
  try {
    read();
    ADD_FAILURE() << file << " was read";
  } catch (const StoreError& error) {
    EXPECT_EQ(std::string(error.what()), "cannot read " + file + " of the scratch directory; run again to resume");
  }
}

// As on a disk that is full, no file of the folder can be written, or read, while this lives.
class BrokenDisk {
 public:
  explicit BrokenDisk(std::string folder) : folder_(std::move(folder)), aside_(folder_ + "-aside") {
    std::filesystem::rename(folder_, aside_);
    std::ofstream(folder_) << "in the way";
  }
  ~BrokenDisk() {
    std::filesystem::remove(folder_);
    std::filesystem::rename(aside_, folder_);
  }
  BrokenDisk(const BrokenDisk&) = delete;
  BrokenDisk& operator=(const BrokenDisk&) = delete;

 private:
  const std::string folder_, aside_;
};

}  // namespace megablock
