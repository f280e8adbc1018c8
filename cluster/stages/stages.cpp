#include "cluster/stages/stages.h"

#include <algorithm>

#include "cluster/mpi/collective.h"
#include "cluster/process/process_memory.h"
#include "cluster/stages/common/block_tables.h"
#include "cluster/stages/merge/merge.h"
#include "cluster/stages/pipeline/adjustment.h"
#include "cluster/stages/pipeline/candidates.h"
#include "cluster/stages/pipeline/matching.h"
#include "cluster/stages/pipeline/orientation.h"
#include "cluster/stages/pipeline/tiles.h"
#include "cluster/stages/pipeline/tracks.h"
#include "io/base/error.h"

namespace megablock {

namespace {

void features(Job& job, StageResults& results) { results.features = run_features(job); }

void candidates(Job& job, StageResults& results) { results.candidates = run_candidates(job, results.features); }

void matching(Job& job, StageResults& results) {
  results.matches = run_matching(job, results.features, results.candidates);
  release_names(job);
  use_memory_sparingly();
}

void tiles(Job& job, StageResults& results) {
  results.tiles =
      results.tie_points.empty() ? run_tiles(job, results.matches) : run_tiles_of_tracks(job, results.tie_points);
}

void tracks(Job& job, StageResults& results) {
  results.tracks = results.tie_points.empty() ? run_tracks(job, results.matches, results.tiles)
                                              : run_given_tracks(job, results.tie_points, results.tiles);
  if (results.tiles.tile_count == 0)
    throw AgreedError<ComputeError>(
        "no two images could be matched: nothing to orient; check overlap, masks and the match options");
  index_measurements(job, results.tracks);
}

// Whether the report of the orientation may name single images. It does not when all poses are taken from the project.
bool orients_by_names(const Block& block) {
  return !block.verticals.empty() ||
         std::any_of(block.frames.begin(), block.frames.end(), [](const Frame& f) { return !f.given_pose; });
}

void orientation(Job& job, StageResults& results) {
  return_freed_memory();  // memory of the tracks
  job.tables.release();
  if (orients_by_names(job.block)) restore_names(job);
  results.oriented = run_orientation(job, results.matches);
  release_names(job);
  job.tables.release();
  const auto& oriented = results.oriented.oriented;
  if (std::none_of(oriented.begin(), oriented.end(), [](auto o) { return o != 0; }))
    throw AgreedError<ComputeError>(
        "no image could be oriented from the matches; check that images overlap and that focal lengths are right, "
        "leave out wrong GPS positions ('gps: {use: false}'), or give approximate poses ('poses')");
}

void adjustment(Job& job, StageResults& results) {
  results.adjusted = run_adjustment(job, results.oriented, results.tiles, results.tracks);
}

void merge(Job& job, StageResults& results) {
  run_merge(job, std::move(results.oriented), results.tiles, results.tracks, results.adjusted);
}

constexpr Stage kStages[] = {
    // name, command, in a job of given tie points, help, folder, optional, run
    {"features", "", nullptr, nullptr, "features", false, features},
    {"candidates", "partition", nullptr, "Run as far as the candidate pairs and cells", nullptr, false, candidates},
    {"matching", "", nullptr, nullptr, "matches", false, matching},
    {"tiles", "", "partition", nullptr, nullptr, false, tiles},
    {"tracks", "match", "match", "Run as far as matches, tiles and tracks", "tracks", false, tracks},
    {"orientation", "orient", "orient", "Run as far as the initial orientation", "orient", true, orientation},
    {"adjustment", "adjust", "adjust", "Run as far as the adjustment of the tiles", "adjust", false, adjustment},
    {"merge", "merge", "merge", "Run as far as the merged block", nullptr, false, merge},
};

}  // namespace

std::span<const Stage> all_stages() { return kStages; }

std::vector<ExpectedStage> expected_stages(bool given_tie_points) {
  std::vector<ExpectedStage> stages;
  for (const Stage& stage : kStages)
    if (stage.runs(given_tie_points)) stages.push_back({stage.name, stage.optional});
  return stages;
}

}  // namespace megablock
