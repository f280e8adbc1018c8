// What is said of a file of the scratch directory that cannot be read.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "io/error.h"

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

}  // namespace megablock
