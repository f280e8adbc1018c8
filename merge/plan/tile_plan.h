// Plans the work on a tile: its unknowns, its cells, and the points and observations that each cell owns. The plan is
// made again only when the kept observations change, and serves every sweep over the tile.
#pragma once

#include <cstdint>
#include <vector>

#include "adjust/terms/terms.h"
#include "merge/plan/plan.h"
#include "merge/scratch/row_list.h"

namespace megablock {

// Every unknown in the kept residuals of a tile, ascending. make_plan() needs this list of each tile.
UnknownList tile_unknowns(const TileProblem& problem);
// The same when other intrinsics are estimated than those of the problem, one mask for each camera.
UnknownList tile_unknowns(const TileProblem& problem, const std::vector<ParameterMask>& camera_free);

// The symbolic work on a tile. It is done once for each set of kept observations.
struct TilePlan {
  UnknownList unknowns;                     // touched, ascending
  UnknownList boundary;                     // separator unknowns, ascending
  UnknownList owned;                        // unknowns that no tile with a lower number touches
  EliminationPlan cells;                    // leaves = cells
  std::vector<RowList> points;              // [cells] active points (rows), ascending
  std::vector<std::vector<TermRow>> terms;  // [cells] observations without a point, ascending by type and row
  // For each frame row, the part of the tile to which it belongs; -1: untouched. A part holds together by points and by
  // observations between frames. Parts are numbered by their lowest frame.
  std::vector<std::int64_t> part_of_frame;
  std::int64_t part_count = 0;
  // Position in `unknowns`; -1: held or untouched.
  std::vector<std::int64_t> unknown_of_frame, unknown_of_camera, unknown_of_mount;
  std::vector<ParameterMask> camera_free;  // [cameras] estimated intrinsics
  void write(ByteWriter& out) const;
  static TilePlan read(ByteReader& in);
};
// `node` is the tile's leaf in the plan of the merge tree: its `separator` unknowns are the separator of the tile.
// Cells have at most `cell_max_frames` frames; 24 and 32 were slower for two threads and no faster for one.
TilePlan make_tile_plan(const TileProblem& problem, const PlanNode& node, std::int64_t cell_max_frames = 16);
// For a tile that is a block of its own: it has no separator unknowns.
TilePlan make_lone_tile_plan(const TileProblem& problem, const std::vector<ParameterMask>& camera_free);

}  // namespace megablock
