// Names the cameras whose focal length the block hardly determines, or finds to be another one than was stated.
#pragma once

#include <string>
#include <vector>

#include "io/result/result.h"

namespace megablock {

// One line each, in block order.
std::vector<std::string> camera_texts(const BlockResult& result);

}  // namespace megablock
