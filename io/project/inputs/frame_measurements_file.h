// The project file's entries of frame_measurement_types(): numbers measured between two frames.
// CSV, one row a number:   from,to,<value column>,<sigma column>
// `from` and `to` name an image of the frame, or the frame.
#pragma once

#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/frame_measurements.h"

namespace megablock {

// Adds them to the block. Rows of images named in `left_out` are warned of and not used. InputError naming file:line
// for unknown images, two images of one frame, values and sigmas that are not positive.
void read_frame_measurements(const FrameMeasurementType& type, const std::string& path,
                             const std::vector<std::string>& left_out, Block& block,
                             std::vector<std::string>& warnings);

}  // namespace megablock
