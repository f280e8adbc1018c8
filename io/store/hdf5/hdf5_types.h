// Gives the common parts of the HDF5 reader and writer: types, errors, properties of files. Internal to io/store/hdf5/.
#pragma once

#include <hdf5.h>

#include <string>

#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

// The type in memory, and the little-endian type in files.
hid_t memory_type(ElementType type);
hid_t file_type(ElementType type);

// Turns off HDF5's own output of errors; they are reported as exceptions.
void silence_hdf5();

// The innermost entry of HDF5's error stack.
std::string last_hdf5_failure();

// File access properties for all files: libver latest, no file locking, and closing a file closes its open objects.
Hdf5Handle file_access();

}  // namespace megablock
