// The project file's `verticals`: where images see down, as `megablock verticals` writes them or an inclinometer says.
// CSV, one row per image; rows without down_x are images without a vertical.
//   image,down_x,down_y,down_z         camera axes (x right, y down, z along the view)
//   sigma_roll_deg,sigma_pitch_deg,correlation    of measuring alone; or
//   sigma_deg                                     the same across the direction in all azimuths
//   camera,down_by_camera              optional: the camera's parameters it was found with, and the derivatives of
//                                      down_x, down_y, down_z by each; numbers separated by spaces
// Other columns are for the reader of the table.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/vanishing/interpretation_plane.h"
#include "io/block/block.h"
#include "io/block/set_aside_vertical.h"

namespace megablock {

// Replaces those of the block. Images named in `left_out` are passed over. InputError naming file:line for unknown and
// repeated images, sigmas that are not positive, numbers that are none, a camera that has another model by now, or
// parameters that lie three sigmas of an uncalibrated one from those in the file.
void read_verticals(const std::string& path, const std::vector<std::string>& left_out, Block& block);

// The columns that are read, with roll and pitch (degrees); no line ends.
std::string verticals_header();
std::string verticals_row(const SeenVertical& vertical, const std::string& image);

// Of `down` by each of the camera's parameters, times its prior sigma (parameters without a prior: weak_sigmas).
Eigen::Matrix3Xd camera_error(const SeenVertical& vertical, const Camera& camera);

// Down as a camera with these values sees it, with all its errors: of measuring, and what camera_error adds, the
// same for all its images. For those who do not estimate the camera with it.
AxisDirection whole_error(const SeenVertical& vertical, const Camera& camera, const Intrinsics& values);

// "3 of 40 verticals take no part: 3 contradicted by most others (a.jpg, b.jpg, c.jpg)"; empty for none. `all`: with
// them.
std::string set_aside_text(const Block& block, std::span<const SetAsideVertical> aside, std::size_t all);

}  // namespace megablock
