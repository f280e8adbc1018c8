// This rank's tiles in the merge: from the tiles' own adjustments, between rounds of screening, back to the block's
// state.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "adjust/tile/sigma_scales.h"
#include "cluster/job/job.h"
#include "cluster/stages/merge/merge_start.h"
#include "merge/tree/merge_tree_runner.h"

namespace megablock {

// What the merge is computed from; unit names by tile, empty ones of tiles that could not be adjusted.
struct MergeInputs {
  BlockState oriented;  // until the tiles are loaded
  const Tiles& tiles;
  const std::vector<std::string>& tracks;
  const std::vector<std::string>& adjusted;
};

// Adds this rank's tiles to `own`, each as `prepare` leaves it.
void load_own_tiles(const Job& job, const MergeInputs& inputs, const MergeStart& start,
                    const std::vector<int>& rank_of_tile, const std::function<void(RankTile&)>& prepare,
                    TileStore& own);

// The block's state from all ranks' tiles. Tiles hold the same bits of what they share, so their order does not matter.
// Collective.
BlockState gather_state(Job& job, const BlockState& start, const TileStore& tiles, const MergeTreeRunner& runner);

// Every tile takes over what others have moved: before observations are tested against it.
void follow(const BlockState& state, TileStore& tiles);

// Whether the sigmas of positions, attitudes and relative poses have changed enough to matter. Collective.
bool adopt_sigma_scales(MergeTreeRunner& runner, TileStore& tiles, SigmaScales& scales);

// Re-tests every observation at the solution; how many verdicts changed in the whole block. Collective.
std::int64_t screen(Job& job, TileStore& tiles);

// Of this rank, in the job's scratch.
std::string scratch_folder_of_rank(const Job& job);
// The memory of this rank, half of it for tiles, and its scratch, once a job; what tiles leave of it for factors.
MemoryOptions memory_of_rank(const Job& job);
MemoryOptions memory_of_factors(MemoryOptions memory, const TileStore& tiles);

// What a runner's passes cost, over all ranks: a round of the merge.
struct MergeCosts {
  double tile_seconds = 0, front_seconds = 0;  // work on tiles, on fronts above them: sums over the ranks
  double seconds = 0;                          // of all passes, of the slowest rank
  std::int64_t passes = 0;                     // upwards
  std::int64_t tiles = 0, tiles_in_scratch = 0;
  MemoryStatistics factors;           // peak_bytes: of the rank with most
  std::int64_t peak_front_bytes = 0;  // of the rank with most: a front at work, and what waits for others
  FrontCosts fronts;
  std::map<std::string, double> figures() const;  // by name, for the event of the merge
};
// Collective.
MergeCosts gather_costs(Job& job, const TileStore& tiles, const MergeTreeRunner& runner);
// How large the fronts were, where the time went, and what `--memory` led to.
void say_costs(const Job& job, const MergeCosts& costs);

}  // namespace megablock
