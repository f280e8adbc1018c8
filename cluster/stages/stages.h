// Holds the results that the stages of a job give to later stages. The rows of the table of stages
// (cluster/job/stage.h) are in stages.cpp.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/stage.h"
#include "cluster/stages/pipeline/features.h"
#include "cluster/stages/pipeline/orientation.h"
#include "io/block/image_graph.h"

namespace megablock {

// Each member is written by the stage that is named; the data themselves stay in the store of the job.
struct StageResults {
  explicit StageResults(JobBlock& of_job) : own(of_job) {}

  JobBlock& own;                      // the block of the job: names come and go, orientation and merge take of it
  std::string tie_points;             // file of given tie points, before all stages; empty: the job starts from images
  bool needs_tiles = true;            // set before all stages; if true, a block without tiles ends the run
  FeatureStage features;              // features
  CandidateGraph candidates;          // candidates
  std::vector<std::string> matches;   // matching: units by cell; false_pairs replaces those without pairs that it drops
  Tiles tiles;                        // tiles
  std::vector<std::string> tracks;    // tracks: units by tile
  OrientationStage oriented;          // orientation
  bool begins_again = false;          // cameras: the matching needs a better focal length, which focal_lengths has kept
  std::vector<std::string> adjusted;  // adjustment: units by tile; empty for tiles that could not be adjusted
};

}  // namespace megablock
