// Reads and writes poses of frames as a CSV file. `simulate` writes the true poses in this form, `evaluate` reads them,
// and other programs can provide poses in it:
//
//     # origin: 48.85 2.35 100     (optional: latitude, longitude [deg], ellipsoidal height [m] of the ground frame)
//     name,qw,qx,qy,qz,x,y,z[,pass]
//     f000012.jpg,0.707...,...
//
// `name` is the name of the frame; the frame of a single image has the name of its image. qw, qx, qy, qz are the unit
// quaternion of the rotation ground -> rig (R_cw; camera x right, y down, looking along +z). x, y, z are the origin of
// the rig in the ground frame, metres (east, north, up). Columns are found by their names in the header and may have
// any order; other columns are ignored. Lines that start with '#' are comments.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

struct PoseTable {
  std::optional<GroundFrame> ground;  // from the comment "# origin:"
  std::vector<std::string> names;
  std::vector<Pose> poses;           // [names]
  std::vector<std::int64_t> passes;  // [names]; empty if there is no such column
};

// The poses of the oriented frames.
PoseTable pose_table(const Block& block, const BlockState& state);

void write_pose_csv(const std::string& path, const PoseTable& table);

// Reads a file. Quaternions are normalised. Throws InputError with file:line for missing columns, malformed numbers,
// quaternions whose norm differs from 1 by more than 1e-3, and repeated names.
PoseTable read_pose_csv(const std::string& path);

}  // namespace megablock
