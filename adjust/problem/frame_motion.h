// Finds how the frames of a block moved when they were taken, from the poses and times of their neighbours on the path.
//
// Neighbours are the frames of the same rig and acquisition line that come before and after in time. From a parabola
// through the three places follows
//
//     v = (t_+ v_- + t_- v_+) / (t_- + t_+),   v_- = (C - C_-) / t_-,   v_+ = (C_+ - C) / t_+,
//
// with the times t_-, t_+ between them. A frame at the end of the path has one neighbour and its velocity. Where the
// path turns by more than 60 degrees (a drone that begins its next line), only the neighbour that is nearer in time
// counts.
//
// Many headers tell times in whole seconds. A time between neighbours is then almost unknown, but that over a longer
// way is not: the speed is the length of the path divided by its time, over 10 seconds before and after the frame, and
// takes the place of the times.
//
// Three angular velocities tell how the frame turns: that of the path, and those from its attitude to the attitudes of
// both neighbours. Single attitudes and places scatter, as a gimbal does, so a turn that only some of them show is
// none. Each component counts with the smallest magnitude of the three, and not at all where the signs differ.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "geometry/camera/rolling_shutter.h"
#include "io/block/block.h"

namespace megablock {

class FramePaths {
 public:
  explicit FramePaths(const Block& block);

  // The pose of a frame, or nullptr where it has none.
  using PoseOf = std::function<const Pose*(FrameIndex)>;
  // Nothing where the frame has no time, or no neighbour within 30 seconds.
  std::optional<Motion> motion(FrameIndex frame, const PoseOf& pose_of) const;

 private:
  struct Leg;
  std::vector<Leg> legs(FrameIndex frame, int direction, const PoseOf& pose_of) const;

  const Block* block_;
  std::vector<FrameIndex> order_;                     // by rig, line and time; without frames that have no time
  IndexedVector<FrameIndex, std::int64_t> row_;       // in order_; -1: none
  IndexedVector<RigIndex, std::uint8_t> in_seconds_;  // 1: all times are whole seconds
};

// The paths of a block of which any camera has a rolling shutter; nothing for other blocks, which do not need them.
std::optional<FramePaths> paths_for_rolling_shutters(const Block& block);

}  // namespace megablock
