// Corrects the image observations of a tile for atmospheric refraction and, where the ground frame is flat, for the
// curvature of the earth (geometry/camera/environment.h). Pixels become those of a perspective image of the ground
// frame.
#pragma once

#include <string>

#include "adjust/problem/tile_problem.h"

namespace megablock {

struct EnvironmentOptions {
  bool refraction = false;  // refraction of the atmosphere
  // Curvature of the earth, for blocks whose x, y, z are easting, northing and height of a map projection. A
  // georeferenced block has a topocentric frame, which is straight.
  bool earth_curvature = false;
  bool any() const { return refraction || earth_curvature; }
  void check() const {}  // all values are possible; see check_environment()
};

// Throws InputError when the curvature is asked for and the block is georeferenced. It also throws when any correction
// is asked for and the block has neither positions (of frames, observed or approximate) nor control points, because its
// vertical and heights are then unknown, or when it has lines of known direction, whose measurements are not corrected.
void check_environment(const EnvironmentOptions& options, const Block& block);

// Throws InputError when any correction is asked for, because `command` takes measurements without corrections.
void refuse_environment(const EnvironmentOptions& options, const std::string& command);

// Corrects every image observation of the problem; those of tie points keep units of 2^-10 px, in which they are
// stored. The origins of rays are taken from `at`: poses, cameras, mounts and points, of which a few metres and degrees
// hardly matter. Unknown points get the median height of the known ones. Heights above sea level are those of the block
// (z, above the height of the origin where there is one). Observations stay unchanged without any known point, and
// where a camera has no ray.
void correct_measurements(const EnvironmentOptions& options, const GroundFrame& ground, const TileState& at,
                          TileProblem& problem);

}  // namespace megablock
