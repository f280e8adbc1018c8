// The groups of a block's current values in a file, shared by state files and result/block.h5. The groups frames,
// cameras, rigs and mounts must be there (docs/job-format.md, "State").
#pragma once

#include "io/block/block.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

void put_state(Hdf5Writer& file, const BlockState& state);
// Mounts per rig are read from rigs/mounts, camera models from cameras/model: put_block and write_state both write
// them.
BlockState get_state(const Hdf5Reader& file);

}  // namespace megablock
