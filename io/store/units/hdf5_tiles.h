// Reads and writes tiles and merge tree as groups of a file. tiles.h5 and result/block.h5 share them
// (docs/reference/file-formats.md, "Tiles").
#pragma once

#include "io/block/image_graph.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

void put_tiles(Hdf5Writer& file, const Tiles& tiles);
Tiles get_tiles(const Hdf5Reader& file);

}  // namespace megablock
