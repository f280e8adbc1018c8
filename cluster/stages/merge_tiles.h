// This rank's tiles in the merge: from the tiles' own adjustments, between rounds of screening, back to the block's
// state.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "adjust/sigma_scales.h"
#include "cluster/job.h"
#include "cluster/rank_runner.h"
#include "cluster/stages/merge_start.h"

namespace megablock {

// What the merge is computed from; unit names by tile, empty ones of tiles that could not be adjusted.
struct MergeInputs {
  BlockState oriented;  // until the tiles are loaded
  const Tiles& tiles;
  const std::vector<std::string>& tracks;
  const std::vector<std::string>& adjusted;
  const VerticalsOfTiles verticals;
};

// Adds this rank's tiles to `own`, each as `prepare` leaves it.
void load_own_tiles(const Job& job, const MergeInputs& inputs, const MergeStart& start,
                    const std::vector<int>& rank_of_tile, const std::function<void(RankTile&)>& prepare,
                    TileStore& own);

// The block's state from all ranks' tiles. Tiles hold the same bits of what they share, so their order does not matter.
// Collective.
BlockState gather_state(Job& job, const BlockState& start, const TileStore& tiles, const RankRunner& runner);

// Every tile takes over what others have moved: before observations are tested against it.
void follow(const BlockState& state, TileStore& tiles);

// Whether the sigmas of positions, attitudes and relative poses have changed enough to matter. Collective.
bool adopt_sigma_scales(RankRunner& runner, TileStore& tiles, SigmaScales& scales);

// Re-tests every observation at the solution; how many verdicts changed in the whole block. Collective.
std::int64_t screen(Job& job, TileStore& tiles);

// Of this rank, in the job's scratch.
std::string scratch_folder_of_rank(const Job& job);
// The memory of a rank: half of it for tiles; factors get what these leave of it.
MemoryOptions memory_of_tiles(const Job& job);
MemoryOptions memory_of_factors(const Job& job, const TileStore& tiles);
// Says how large the fronts were, where the time of the last round went, and what `--memory` led to, over all ranks.
// Collective.
void say_memory(Job& job, const TileStore& tiles, const RankRunner& runner);

}  // namespace megablock
