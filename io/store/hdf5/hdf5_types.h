// Types and checks that the HDF5 reader and writer share. Internal to io/store/hdf5/: the only header that includes
// HDF5.
#pragma once

#include <hdf5.h>

#include <string>

#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

// Type in memory, and the little-endian type in files.
hid_t memory_type(ElementType type);
hid_t file_type(ElementType type);

// Turns off HDF5's printing of its error stack; errors are reported through exceptions.
void silence_hdf5();

// The innermost entry of HDF5's error stack.
std::string last_hdf5_failure();

// File access properties of every file: libver latest, no file locking, closing takes open objects along.
Hdf5Handle file_access();

}  // namespace megablock
