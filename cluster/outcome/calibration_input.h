// Reads the input of the calibration of single cameras: a project with given tie points, or a job.
#pragma once

#include <string>

#include "adjust/tile/tile_adjustment.h"
#include "io/block/block.h"
#include "io/block/tracks.h"

namespace megablock {

struct CalibrationInput {
  Block block;
  BlockState state;  // start poses and cameras; those of a finished job are adjusted
  TrackSet tracks;
  AdjustOptions adjustment;
};

enum class JobTracks {
  kAll,      // all matches of a job that has run at least as far as `match`
  kAdjusted  // the observations that a finished job keeps
};

// `path` is a project file or a job directory. Throws InputError when it is neither, or has no tie points.
CalibrationInput read_calibration_input(const std::string& path, JobTracks tracks);

}  // namespace megablock
