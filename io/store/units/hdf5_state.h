// Reads and writes the current values of a block as groups of a file. State files and result/block.h5 share them. The
// groups frames, cameras, rigs and mounts must exist already (docs/reference/file-formats.md, "State").
#pragma once

#include "io/block/block.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

void put_state(Hdf5Writer& file, const BlockState& state);
// Reads the number of mounts of each rig from rigs/mounts and the camera models from cameras/model, which put_block and
// write_state both write.
BlockState get_state(const Hdf5Reader& file);

}  // namespace megablock
