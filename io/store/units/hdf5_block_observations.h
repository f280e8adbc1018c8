// Reads and writes the observations of a block other than tie points, as groups of its file
// (docs/reference/file-formats.md, "Block"): relative poses, control points, lines of known direction, verticals.
// Without lines or verticals, the file has no such group.
#pragma once

#include <vector>

#include "io/block/block.h"
#include "io/store/hdf5/hdf5_file.h"

namespace megablock {

void put_relative_poses(Hdf5Writer& file, const std::vector<RelativePose>& relatives);
std::vector<RelativePose> get_relative_poses(const Hdf5Reader& file);

// One group per type of frame_measurement_types() (io/block/frame_measurements.h). A block without any has no such
// group.
void put_frame_measurements(Hdf5Writer& file, const Block& block);
void get_frame_measurements(const Hdf5Reader& file, Block& block);
void put_control(Hdf5Writer& file, const std::vector<ControlPoint>& points);
std::vector<ControlPoint> get_control(const Hdf5Reader& file);

void put_lines(Hdf5Writer& file, const std::vector<KnownLine>& lines);
std::vector<KnownLine> get_lines(const Hdf5Reader& file);

void put_verticals(Hdf5Writer& file, const std::vector<SeenVertical>& verticals);
std::vector<SeenVertical> get_verticals(const Hdf5Reader& file);

}  // namespace megablock
