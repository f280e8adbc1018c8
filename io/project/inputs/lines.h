// The project file's `lines`: straight lines of the scene that are known to be vertical or horizontal.
// CSV, one row per image in which a line is measured; the two ends are any two points of it, in each image others:
//   name,direction,image,column1_px,row1_px,column2_px,row2_px[,sigma_px]     direction: vertical or horizontal
// Pixel centres at +0.5. sigma_px: across the line, of each end [1]. A horizontal line needs two images or more.
#pragma once

#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// Adds them to the block. Measurements in images named in `left_out` are warned of and not used. InputError naming
// file:line for unknown images, ends outside the image or less than ten pixels apart, directions that change.
void read_lines(const std::string& path, const std::vector<std::string>& left_out, Block& block,
                std::vector<std::string>& warnings);

}  // namespace megablock
