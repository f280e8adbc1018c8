// Reads and writes the file that the project file names under `verticals`: the direction of the vertical in images.
// `megablock verticals` finds these directions in the images; an inclinometer can measure them as well. The file is a
// CSV file with one line per image; a line without down_x belongs to an image without a vertical. The columns are:
//
//     image,down_x,down_y,down_z                    unit vector downwards in camera axes (x right, y down, z along the
//                                                   view)
//     sigma_roll_deg,sigma_pitch_deg,correlation    errors of the measurement alone; or
//     sigma_deg                                     the same for all directions across the vertical
//     camera,down_by_camera                         optional: the camera parameters that were used, and the derivatives
//                                                   of down_x, down_y, down_z by each; numbers separated by spaces
//
// Other columns are for people and are not read.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/vanishing/interpretation_plane.h"
#include "io/block/block.h"
#include "io/block/set_aside_vertical.h"

namespace megablock {

// Replaces the verticals of the block. Lines of images in `left_out` are ignored. Throws InputError with file:line for
// unknown and repeated images, for sigmas that are not positive, for malformed numbers, for a camera that now has
// another model, and for a camera parameter that differs from the file's by more than three sigmas of an uncalibrated
// camera.
void read_verticals(const std::string& path, const std::vector<std::string>& left_out, Block& block);

// The header and a line of the file, without line ends. They also contain roll and pitch (degrees), for people.
std::string verticals_header();
std::string verticals_row(const SeenVertical& vertical, const std::string& image);

// The errors of `down` that come from the camera: for each parameter, the derivative times the prior sigma
// (weak_sigmas for a parameter without a prior).
Eigen::Matrix3Xd camera_error(const SeenVertical& vertical, const Camera& camera);

// `down` for a camera with these values, with the covariance of its whole error: that of the measurement and that of
// camera_error(), which all images of the camera share. It is for callers that do not estimate the camera together with
// the verticals.
AxisDirection whole_error(const SeenVertical& vertical, const Camera& camera, const Intrinsics& values);

// "3 of 40 verticals take no part: 3 contradicted by most others (a.jpg, b.jpg, c.jpg)"; empty if there are none. `all`
// is the number of all verticals, these included.
std::string set_aside_text(const Block& block, std::span<const SetAsideVertical> aside, std::size_t all);

}  // namespace megablock
