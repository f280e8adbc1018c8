// Handles the tiles of this rank in the merge: loads them, tests their observations between adjustments, and gathers
// the state of the block.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "adjust/tile/prior_scales.h"
#include "adjust/tile/sigma_scales.h"
#include "cluster/job/job.h"
#include "cluster/stages/merge/merge_checkpoint.h"
#include "cluster/stages/merge/merge_start.h"
#include "merge/tree/merge_tree_runner.h"

namespace megablock {

// The inputs of the merge. Unit names are by tile, and empty for tiles that could not be adjusted.
struct MergeInputs {
  BlockState oriented;  // emptied when the tiles are loaded
  const Tiles& tiles;
  const std::vector<std::string>& tracks;
  const std::vector<std::string>& adjusted;
};

// Adds the tiles of this rank to `own`, each after `prepare` has changed it.
void load_own_tiles(const Job& job, const MergeInputs& inputs, const MergeStart& start,
                    const std::vector<int>& rank_of_tile, const std::function<void(RankTile&)>& prepare,
                    TileStore& own);

// Collective. The state of the block from the tiles of all ranks. Tiles hold the same bits of the unknowns that they
// share, so that their order does not matter.
BlockState gather_state(const Job& job, const BlockState& start, const TileStore& tiles, const MergeTreeRunner& runner);

// Gives the present state to every tile, before its observations are tested against it.
void follow(const BlockState& state, TileStore& tiles);

// Gives the tiles the losses of the options, those that pull from any distance, or none where gross errors are sought
// (prior_scales.h).
void set_losses(const Job& job, const MergePosition& position, TileStore& tiles);
// Collective. The residuals of the positions and control points of all ranks.
PriorLengths prior_lengths(const Job& job, TileStore& tiles);
// Multiplies the sigmas of positions and control points that are stated far too small (prior_scales.h). Returns whether
// they have changed so much that another adjustment is needed.
bool adopt_contradicted_scales(const Job& job, PriorLengths lengths, TileStore& tiles, SigmaScales& scales);

// Collective. Whether the sigmas of positions, attitudes and relative poses have changed so much that another
// adjustment is needed.
bool adopt_sigma_scales(MergeTreeRunner& runner, TileStore& tiles, SigmaScales& scales);

// Whether some control point is far off the block.
bool control_seems_wrong(const PriorLengths& lengths);

// The tests of the positions and control points of a tile, from its covariances at the solution.
PriorTests prior_tests(const RankTile& tile, const TileCovariance& covariance);
// Collective. Those of all tiles of this rank.
PriorTests prior_tests(MergeTreeRunner& runner);

// Collective. Judges positions and control points by the tests of all ranks; `tests` are those of this rank's tiles.
// Sets observations aside, where the block was adjusted without losses to find gross errors (`position` says so), or
// takes them back. Returns whether the block must begin again: after such a change, or to seek gross errors.
bool judge_priors(const Job& job, const PriorTests& tests, TileStore& tiles, MergePosition& position);

// Collective. Tests every observation at the solution again. Returns the number of changed decisions in the whole
// block.
std::int64_t screen(const Job& job, TileStore& tiles);

// Folder of this rank in the scratch of the job.
std::string scratch_folder_of_rank(const Job& job);
// The memory of this rank, half of it for tiles, and its scratch. When the tiles are loaded, the rest is for factors.
MemoryOptions memory_of_rank(const Job& job);
MemoryOptions memory_of_factors(MemoryOptions memory, const TileStore& tiles);

// The cost of the sweeps of one adjustment, over all ranks.
struct MergeCosts {
  double tile_seconds = 0, front_seconds = 0;  // work on tiles and on fronts above them: sums over the ranks, s
  double seconds = 0;                          // all sweeps, on the slowest rank
  std::int64_t passes = 0;                     // sweeps up
  std::int64_t tiles = 0, tiles_in_scratch = 0;
  MemoryStatistics factors;           // peak_bytes: that of the rank with the largest
  std::int64_t peak_front_bytes = 0;  // bytes of a front at work and all pending updates, on the rank with the largest
  FrontCosts fronts;
  std::map<std::string, double> figures() const;  // by name, for the event of the merge
};
// Collective.
MergeCosts gather_costs(const Job& job, const TileStore& tiles, const MergeTreeRunner& runner);
// Reports the size of the fronts, the share of the time, and the effect of `--memory`.
void say_costs(const Job& job, const MergeCosts& costs);

}  // namespace megablock
