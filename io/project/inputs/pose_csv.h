// Poses of frames as a CSV file: the truth that `simulate` writes and `evaluate` reads, or any other program's poses.
//
//     # origin: 48.85 2.35 100     (optional: latitude, longitude [deg], ellipsoidal height [m] of the ground frame)
//     name,qw,qx,qy,qz,x,y,z[,pass]
//     f000012.jpg,0.707...,...
//
// name: the frame's (of a single image: the image's). qw qx qy qz: unit quaternion of the rotation ground -> rig (R_cw;
// camera x right, y down, looking along +z). x y z: the rig's origin in the ground frame, metres (east, north, up).
// Columns are found by the names in the header line and may stand in any order; further ones are ignored. Lines that
// start with '#' are comments.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

struct PoseTable {
  std::optional<GroundFrame> ground;  // of the file's origin comment
  std::vector<std::string> names;
  std::vector<Pose> poses;           // [names]
  std::vector<std::int64_t> passes;  // [names] or empty: no such column
};

// Oriented frames of the state, by name.
PoseTable pose_table(const Block& block, const BlockState& state);

void write_pose_csv(const std::string& path, const PoseTable& table);

// InputError with file:line for missing columns, numbers that are none, quaternions that are not unit (1e-3; they are
// normalised), names that appear twice.
PoseTable read_pose_csv(const std::string& path);

}  // namespace megablock
