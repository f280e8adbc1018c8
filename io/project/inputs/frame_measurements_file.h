// Reads numbers that were measured between two frames: the files that the project file names under the keys of
// frame_measurement_types(). They are CSV files with one measurement per line:
//
//     from,to,<value column>,<sigma column>
//
// `from` and `to` are names of frames, or of images of these frames.
#pragma once

#include <string>
#include <vector>

#include "io/block/block.h"
#include "io/block/frame_measurements.h"

namespace megablock {

// Adds the measurements to the block. Lines that name an image of `left_out` are not used and give a warning. Throws
// InputError with file:line for unknown names, for two names of the same frame, for a pair of frames that is measured
// twice, and for numbers beyond the limits of the type.
void read_frame_measurements(const FrameMeasurementType& type, const std::string& path,
                             const std::vector<std::string>& left_out, Block& block,
                             std::vector<std::string>& warnings);

}  // namespace megablock
