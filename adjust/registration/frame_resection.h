// Resects every frame that sees enough control points (Cannelle 2013: resections of a rig along its path).
#pragma once

#include <string>
#include <vector>

#include "adjust/registration/trajectory.h"
#include "adjust/resection/rig_resection.h"

namespace megablock {

struct FrameResection {
  FrameIndex frame;
  std::string refused;  // why there is no pose; empty: there is a pose
  int points = 0;       // known points that the frame sees
  RigResection resection;
};

// Resects the frames that see a known control point, ascending. `start` holds one approximate pose per frame, or is
// empty. Control points of unknown height are not used. The seed of a frame's samples is its index.
std::vector<FrameResection> resect_frames(const Block& block, const std::vector<Pose>& start,
                                          const TrajectoryOptions& which, const RigResectionOptions& options);

}  // namespace megablock
