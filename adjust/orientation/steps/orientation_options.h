// Holds the options of initial orientation (orientation.h).
#pragma once

#include <cstdint>

#include "adjust/problem/tile_problem.h"

namespace megablock {

struct OrientationOptions {
  ObservationOptions observations;
  double max_rotation_error_deg = 10;     // relative rotations farther from the average are dropped
  int min_points_per_image = 15;          // an image with fewer triangulated points is not oriented
  std::int64_t tracks_per_pair = 120;     // longest tracks used for positioning (bounds memory)
  // Find shifts of all positions against the control (position_offset.h), and of groups of positions against each other
  // (position_shifts.h).
  bool shift_positions = true;
  int part_frames = 0;  // larger components without any position are oriented in parts of so many frames
                        // (orientation_parts.h); 0: always as a whole
  void check() const;   // throws InputError
};

}  // namespace megablock
