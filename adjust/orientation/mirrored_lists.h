// Finds lists of control points or of positions whose east and north are exchanged, by comparing them with the shape
// that the images give a part of the block (mirrored_layout.h), and leaves such a list out.
//
// An exchanged list turns a block without other observations upside down: hardly anything contradicts it then, and all
// sigmas are small.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "adjust/orientation/mirrored_layout.h"
#include "io/block/block.h"

namespace megablock {

// What the images of a part say of the control points that they see. `in_place`: the part has its place from positions.
// `frames` ascend, and hang together in `state`.
std::optional<MirroredLayout> find_mirrored_control(const Block& block, const BlockState& state,
                                                    const std::vector<FrameIndex>& frames, bool in_place);

// What they say of the positions. Empty where positions are held or have a shift: they stay in any case.
std::optional<MirroredLayout> find_mirrored_positions(const Block& block, const BlockState& state,
                                                      const std::vector<FrameIndex>& frames);
// The same while a component is oriented. Its shape must be that of the images alone, in any model.
struct FramePosition {
  Eigen::Vector3d centre;  // in the model
  PositionPrior prior;
};
std::optional<MirroredLayout> find_mirrored_positions(const std::vector<FramePosition>& positions,
                                                      const MeanAxes& axes);

// Control points become check points.
void leave_out_control(Block& block);
void leave_out_positions(const std::vector<FrameIndex>& frames, Block& block);

// "the control points fit with x and y exchanged (to 0.02 m, as given to 35 m): are east and north exchanged in the
// list? ...".
std::string mirrored_control_text(const MirroredLayout& found, bool in_place);
std::string mirrored_positions_text(const MirroredLayout& found);

}  // namespace megablock
