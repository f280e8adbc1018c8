// Says in words which tiles and seams disagree (seam_check.h), and which tile is behind each alarm.
#pragma once

#include <string>
#include <vector>

#include "io/block/image_graph.h"
#include "merge/checks/seam_check.h"

namespace megablock {

// One line per disagreement, the three worst of each kind. The first lines name tiles that disagree with themselves
// (noisy_tiles). The next ones name unknowns about which a tile disagrees with the rest, with the figures and the tile.
// Other tiles that explain the disagreement about as well are named too: where only two tiles see a frame, either of
// them may be wrong. Twice the logarithm of a likelihood ratio is a difference of T; a tile is named alone when the
// likelihood ratio is at least 1 : kSeamAlarmProbability.
std::vector<std::string> describe_disagreements(
    const std::vector<TileCheck>& tiles, const UnknownName& name = [](const UnknownId& id) { return describe(id); });

// One line per alarm, with the seam, its figures and the tile below it that explains the alarm. `tiles` are all tiles,
// in their order. Tiles of noisy_tiles come first. Then follows the tile that clears most alarms when it is taken out:
// the alarms of the seams above it, and its own alarm against the rest. Among equals it is the tile whose T is the
// largest share of its limit. This is repeated for the alarms that are left.
std::vector<std::string> describe_seams(const MergeTree& tree, const std::vector<SeamReport>& seams,
                                        const std::vector<TileCheck>& tiles);

}  // namespace megablock
