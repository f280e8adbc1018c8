// Lists the stages of a job in one table.
//
// To add a stage, write one file in cluster/stages/pipeline/ that brings the units of the stage up to date, and add one
// line to the table in stages.cpp. run_stage() in cluster/job/work_queue.h runs the units over all ranks, skips those
// that are up to date, and records failures. The pipeline, the commands that run as far as a stage, `status` and the
// cleaning of a job read the table. docs/developer/add-stage.md has the steps, and the places that do not read it yet.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/stage_record.h"
#include "cluster/stages/pipeline/features.h"
#include "io/block/image_graph.h"

namespace megablock {

// The results of stages that later stages use. Each member is written once, by the stage that is named; the data
// themselves stay in the store of the job.
struct StageResults {
  std::string tie_points;             // file of given tie points, before all stages; empty: the job starts from images
  FeatureStage features;              // features
  CandidateGraph candidates;          // candidates
  std::vector<std::string> matches;   // matching: units by cell
  Tiles tiles;                        // tiles
  std::vector<std::string> tracks;    // tracks: units by tile
  BlockState oriented;                // orientation
  std::vector<std::string> adjusted;  // adjustment: units by tile; empty for tiles that could not be adjusted
};

struct Stage {
  const char* name;           // in records, events, progress and `status`
  const char* command;        // the command that ends with this stage in a job of images; "" where none does
  const char* command_given;  // the same in a job of given tie points; nullptr: the stage does not run there
  const char* help;           // of the command; nullptr where none ends here in a job of images
  const char* folder;  // folder of its unit files, where units of an earlier block may be left over; nullptr: none
  bool optional;              // a job may not need it: `status` leaves it out then
  void (*run)(Job& job, StageResults& results);  // collective; throws the errors of the project, the same on every rank

  // Whether it runs in a job that starts from images, or from given tie points.
  bool runs(bool given_tie_points) const { return !given_tie_points || command_given != nullptr; }
  // Whether `last` is the command that ends with this stage.
  bool ends(const std::string& last, bool given_tie_points) const {
    return !last.empty() && runs(given_tie_points) && last == (given_tie_points ? command_given : command);
  }
};

// All stages, in the order in which they run.
std::span<const Stage> all_stages();

// The stages that a job runs, for stage_status().
std::vector<ExpectedStage> expected_stages(bool given_tie_points);

}  // namespace megablock
