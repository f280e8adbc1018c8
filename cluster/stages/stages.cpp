#include "cluster/stages/stages.h"

#include <fmt/core.h>

#include <algorithm>
#include <span>

#include "cluster/job/job.h"
#include "cluster/job/job_options.h"
#include "cluster/job/messages.h"
#include "cluster/mpi/collective.h"
#include "cluster/process/process_memory.h"
#include "cluster/stages/common/block_tables.h"
#include "cluster/stages/merge/merge.h"
#include "cluster/stages/pipeline/adjustment.h"
#include "cluster/stages/pipeline/cameras.h"
#include "cluster/stages/pipeline/candidates.h"
#include "cluster/stages/pipeline/coverage.h"
#include "cluster/stages/pipeline/false_pairs.h"
#include "cluster/stages/pipeline/focal_lengths.h"
#include "cluster/stages/pipeline/matching.h"
#include "cluster/stages/pipeline/orientation.h"
#include "cluster/stages/pipeline/tiles.h"
#include "cluster/stages/pipeline/tracks.h"
#include "io/base/error.h"
#include "io/store/units/adjustment_file.h"
#include "io/store/units/features_file.h"
#include "io/store/units/graph_files.h"
#include "io/store/units/state_file.h"
#include "io/store/units/tracks_file.h"

namespace megablock {

namespace {

void features(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  results.features = run_features(stage, job, record);
}

void candidates(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  results.candidates = run_candidates(stage, job, record, results.features);
}

void focal_lengths(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  run_focal_lengths(stage, job, record, results.features, results.candidates, results.own.block);
}

void matching(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  results.matches = run_matching(stage, job, record, results.features, results.candidates);
}

void false_pairs(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  if (results.tie_points.empty()) results.matches = run_false_pairs(stage, job, record, results.matches);
  release_names(results.own);
  use_memory_sparingly();
}

void tiles(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  results.tiles = results.tie_points.empty() ? run_tiles(stage, job, record, results.matches)
                                             : run_tiles_of_tracks(stage, job, record, results.tie_points);
}

void tracks(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  results.tracks = results.tie_points.empty() ? run_tracks(stage, job, record, results.matches, results.tiles)
                                              : run_given_tracks(stage, job, record, results.tie_points, results.tiles);
  if (results.needs_tiles && results.tiles.tile_count == 0)
    throw AgreedError<ComputeError>(
        "no two frames are held together by enough tie points: nothing to orient; check overlap, masks and the options "
        "'matching', or the given tie points");
  index_measurements(job, results.tracks);
}

void coverage(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  run_coverage(stage, job, record, results.tracks);
}

// Whether the report of the orientation may name single images. It does not when all poses are taken from the project.
bool orients_by_names(const Block& block) {
  return !block.verticals.empty() ||
         std::any_of(block.frames.begin(), block.frames.end(), [](const Frame& f) { return !f.given_pose; });
}

void orientation(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  return_freed_memory();  // memory of the tracks
  job.tables.release();
  if (orients_by_names(job.block)) restore_names(job.store, results.own);
  results.oriented = run_orientation(stage, job, record, results.matches, results.own.block);
  release_names(results.own);
  job.tables.release();
  const auto& oriented = results.oriented.state.oriented;
  if (std::none_of(oriented.begin(), oriented.end(), [](auto o) { return o != 0; }))
    throw AgreedError<ComputeError>(why_nothing_is_oriented(job.block, results.oriented.only_turned));
}

// Positions hold a block together although pairs are lost or turned. The halves of a split test begin with the focal
// length of their job.
void cameras(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  const CameraFindings findings =
      run_cameras(stage, job, record, results.tiles, results.oriented.state, results.own.block);
  return_freed_memory();
  const bool may_begin_again = job.options.half.half == Half::kNone && lacks_positions(job.block);
  for (const BetterFocalLength& found : findings.better) {
    if (!may_begin_again ||
        !keep_focal_length(*find_stage(kFocalLengthStage), job, found.camera, found.focal_px, found.sigma_px))
      continue;
    results.begins_again = true;
    say(job, stage.name,
        fmt::format("camera '{}': the oriented block gives a focal length of {:.0f} px; the run begins again with it, "
                    "since pairs may have been lost or turned by the wrong one",
                    job.block.cameras[found.camera].name, found.focal_px));
  }
  if (results.begins_again) return;
  for (const std::string& note : findings.contradictions) add_note(job, record, stage.name, note);
}

void adjustment(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  results.adjusted = run_adjustment(stage, job, record, results.oriented.state, results.tiles, results.tracks);
}

void merge(const Stage& stage, const Job& job, JobRecord& record, StageResults& results) {
  run_merge(stage, job, record, results.own, std::move(results.oriented), results.tiles, results.tracks,
            results.adjusted);
}

constexpr Stage kStages[] = {
    {.name = kFeatureStage,
     .needs = "images, masks",
     .makes = "features/<shard>.h5",
     .unit = "64 images",
     .parts = "images",
     .algorithm = 2,
     .sections = {&kFeatureSection},
     .kind = "features",
     .read_file = [](const std::string& path) { read_features(path); },
     .run = features},
    {.name = "candidates",
     .needs = "features, positions, attitudes",
     .makes = "graph.h5",
     .unit = "block",
     .command = "partition",
     .help = "Run as far as the candidate pairs and cells",
     .sections = {&kCandidateSection},
     .kind = "candidates",
     .read_file = [](const std::string& path) { read_candidates(path); },
     .run = candidates},
    {.name = kFocalLengthStage,
     .needs = "features, candidates, where a camera leaves its parameters to the block",
     .makes = "focal_lengths/<camera>.txt",
     .unit = "camera",
     .algorithm = 4,
     .optional = true,
     .run = focal_lengths},
    {.name = kMatchingStage,
     .needs = "features, candidates, focal lengths",
     .makes = "matches/<cell>.h5",
     .unit = "cell of pairs",
     .algorithm = 12,
     .sections = {&kMatchingSection},
     .kind = "matches",
     .read_file = [](const std::string& path) { read_matches(path); },
     .run = matching},
    {.name = "false_pairs",
     .needs = "features, matching, where most positions are unknown",
     .makes = "false_pairs/<cell>.h5",
     .unit = "cell of pairs",
     .optional = true,
     .kind = "matches",
     .read_file = [](const std::string& path) { read_matches(path); },
     .run = false_pairs},
    {.name = "tiles",
     .needs = "matching, or given tie points",
     .makes = "tiles.h5",
     .unit = "block",
     .algorithm = 3,
     .command_given = "partition",
     .sections = {&kTileSection},
     .kind = "tiles",
     .read_file = [](const std::string& path) { read_tiles(path); },
     .run = tiles},
    {.name = kTrackStage,
     .needs = "features, matching, or given tie points; tiles",
     .makes = "tracks/<tile>.h5",
     .unit = "block",
     .algorithm = 3,
     .command_given = "",
     .kind = "tracks",
     .read_file = [](const std::string& path) { read_tracks(path); },
     .run = tracks},
    {.name = kCoverageStage,
     .needs = "tracks",
     .makes = "coverage/<tile>.txt",
     .unit = "tile",
     .command = "match",
     .command_given = "match",
     .help = "Run as far as matches, tiles, tracks and their coverage",
     .sections = {&kCoverageSection},
     .check = check_coverage,
     .run = coverage},
    {.name = kOrientationStage,
     .needs = "features, matching, where poses are not given",
     .makes = "orient/<generation>.h5",
     .unit = "images that were added together",
     .algorithm = 11,
     .command = "orient",
     .command_given = "orient",
     .help = "Run as far as the initial orientation",
     .optional = true,
     .sections = {&kOrientationSection},
     .kind = "orientation",
     .read_file = [](const std::string& path) { read_orientation(path); },
     .run = orientation},
    {.name = "cameras",
     .needs = "tracks, orientation, where a camera chooses its parameters",
     .makes = "cameras/<rig>.txt",
     .unit = "rig",
     .algorithm = 5,
     .command_given = "",
     .optional = true,
     .run = cameras},
    {.name = "adjustment",
     .needs = "tiles, tracks, orientation, cameras",
     .makes = "adjust/<tile>.h5",
     .unit = "tile",
     .algorithm = 19,
     .command = "adjust",
     .command_given = "adjust",
     .help = "Run as far as the adjustment of the tiles",
     .sections = {&kEnvironmentSection, &kAdjustmentSection},
     .kind = "adjustment",
     .read_file = [](const std::string& path) { read_adjustment(path); },
     .run = adjustment},
    {.name = kMergeStage,
     .needs = "tiles, tracks, orientation, adjustment",
     .makes = "result/block.h5",
     .unit = "block",
     .algorithm = 26,
     .command = "merge",
     .command_given = "merge",
     .help = "Run as far as the merged block",
     .iterates = true,
     .sections = {&kMergeSection, &kDiagnosticsSection},
     .run = merge},
};

}  // namespace

std::span<const Stage> all_stages() { return kStages; }

}  // namespace megablock
