// Stores poses, intrinsics and mounts of the block, and the initial orientation, in files (shapes, types and units:
// docs/reference/file-formats.md, "State").
//
// The writers make plain HDF5 files at `path`, which JobStore::write seals. The readers throw StoreError with the name
// of the file.
//
// Values of frames that are not oriented are stored too; `oriented` tells that they mean nothing.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "io/block/block.h"
#include "io/block/set_aside_vertical.h"

namespace megablock {

// Poses, intrinsics and mounts of the whole block, after the initial orientation and after each iteration.
void write_state(const std::string& path, const BlockState& state);
BlockState read_state(const std::string& path);

// The initial orientation: a state, the reasons why frames have no pose, and the rejected verticals.
struct InitialOrientation {
  BlockState state;
  std::vector<std::pair<FrameIndex, std::string>> failed;
  std::vector<SetAsideVertical> verticals_aside;
};
void write_orientation(const std::string& path, const InitialOrientation& orientation);
InitialOrientation read_orientation(const std::string& path);

}  // namespace megablock
