// Brings frames into the order of acquisition and finds the straight flight lines among them.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// The frames with a pose, by pass (of a rig), in the order of acquisition: by time, else by name. Frames of an unknown
// pass form one sequence.
std::vector<std::vector<FrameIndex>> acquisition_order(const Block& block, const BlockState& state);

// A flight line has at least three frames, and each step is within 40 degrees of the previous one. The turn from one
// line to the next belongs to neither.
using FlightLine = std::vector<FrameIndex>;
std::vector<FlightLine> flight_lines(const std::vector<std::vector<FrameIndex>>& order, const BlockState& state);

}  // namespace megablock
