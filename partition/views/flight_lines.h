// Frames in the order in which they were taken, and the straight flight lines among them.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// Frames with a pose, by pass (of a rig), in order of acquisition: time, else name. Frames whose pass is not known form
// one sequence.
std::vector<std::vector<FrameIndex>> acquisition_order(const Block& block, const BlockState& state);

// A flight line: three frames and more, each step within 40 degrees of the one before; the turn from one line to the
// next belongs to neither.
using FlightLine = std::vector<FrameIndex>;
std::vector<FlightLine> flight_lines(const std::vector<std::vector<FrameIndex>>& order, const BlockState& state);

}  // namespace megablock
