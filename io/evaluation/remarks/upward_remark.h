// Says that a block may be upside down: most of its cameras look up, and the observations that place it lie in a plane.
//
// A plane is its own mirror image. Positions or control points in a plane with east and north exchanged, or any other
// mirror image of it, turn a block over without a residual. Attitudes or verticals would contradict, so that blocks
// with some get no remark; nor do blocks whose observations leave the plane.
#pragma once

#include <string>

#include "io/result/result.h"

namespace megablock {

// "12 of 12 cameras look upward: the block may be upside down; ...". Empty for most blocks.
std::string upward_text(const BlockResult& result);

}  // namespace megablock
