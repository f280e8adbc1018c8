// Reads and writes the groups of the block in a file. block.h5 and result/block.h5 share them
// (docs/reference/file-formats.md, "Block").
#pragma once

#include "io/block/block.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

void put_block(Hdf5Writer& file, const Block& block);
Block get_block(const Hdf5Reader& file);

}  // namespace megablock
