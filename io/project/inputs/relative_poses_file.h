// Reads relative poses of frames, as odometers, gyroscopes or other programs observe them. The file of the key
// `relative_poses` is a CSV file with a header and a line for each pair of frames:
//
//     from,to                  names of frames, or of an image of each
//     qw,qx,qy,qz              unit quaternion of R = R_to R_from', R_cw of each: ground -> rig
//     x,y,z                    T = R_from (C_to - C_from): the origin of `to` in the axes of `from`, metres
//     sigma_position_m         of each coordinate
//     sigma_rotation_deg       about each axis
//
// Internal to io/.
#pragma once

#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// Adds the relative poses; those of a given block give way to them. Lines of `left_out` images are warned of. Throws
// InputError with file:line for malformed lines, unknown names, and a pair that has a relative pose already.
void read_relative_poses(const std::string& path, const std::vector<std::string>& left_out, Block& block,
                         std::vector<std::string>& warnings);

// Writes them so that the same numbers come back.
void write_relative_poses(const std::string& path, const Block& block);

}  // namespace megablock
