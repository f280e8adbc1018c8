// Reads the file that the project file names under `lines`: straight lines of the scene that are known to be vertical
// or horizontal. It is a CSV file with one line per image in which a line of the scene is measured:
//
//     name,direction,image,column1_px,row1_px,column2_px,row2_px[,sigma_px]     direction: vertical or horizontal
//
// The two ends are any two points of the line, not the same ones in each image. Pixel centres are at +0.5. sigma_px is
// the standard deviation of each end across the line (default 1). A horizontal line needs at least two images.
#pragma once

#include <string>
#include <vector>

#include "io/block/block.h"

namespace megablock {

// Adds the lines to the block. Measurements in images of `left_out` are not used and give a warning. Throws InputError
// with file:line for unknown images, for ends outside the image or less than ten pixels apart, and for a line with two
// directions.
void read_lines(const std::string& path, const std::vector<std::string>& left_out, Block& block,
                std::vector<std::string>& warnings);

}  // namespace megablock
