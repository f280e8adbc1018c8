// Measurements of a tile freed of atmospheric refraction and, where the ground frame is flat, of the earth's curvature
// (geometry/camera/environment.h): pixels become those of a perspective image of the ground frame.
#pragma once

#include <string>

#include "adjust/problem/tile_problem.h"

namespace megablock {

struct EnvironmentOptions {
  bool refraction = false;  // of the atmosphere
  // Of the earth: x, y, z of the block are easting, northing and height of a map projection. A georeferenced block has
  // a topocentric frame, which is straight.
  bool earth_curvature = false;
  bool any() const { return refraction || earth_curvature; }
  void check() const {}  // all values are possible; see check_environment
};

// InputError when the curvature is asked for and the block is georeferenced, and when anything is asked for and the
// block has neither positions (of frames, observed or approximate) nor control points: its vertical and heights are not
// known; or has lines of known direction, whose measurements are not corrected.
void check_environment(const EnvironmentOptions& options, const Block& block);

// InputError when anything is asked for: `command` takes measurements as they are.
void refuse_environment(const EnvironmentOptions& options, const std::string& command);

// Corrects every measurement of the problem, tie points' in units of 2^-10 px as they are stored. Where rays come from
// is taken from `at`: poses, cameras, mounts and points, of which a few metres and degrees matter little; points that
// are not known get the median height of those that are. Heights above sea level are those of the block (z, above the
// origin's height where there is one). Without any known point, and where a camera has no ray, measurements stay.
void correct_measurements(const EnvironmentOptions& options, const GroundFrame& ground, const TileState& at,
                          TileProblem& problem);

}  // namespace megablock
