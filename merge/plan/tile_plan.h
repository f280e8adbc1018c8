// Plans the work on a tile: its unknowns, its cells, and the points and observations that each cell owns. The plan is
// made again only when the kept observations change, and serves every sweep over the tile.
#pragma once

#include <cstdint>
#include <vector>

#include "adjust/terms/terms.h"
#include "merge/plan/plan.h"
#include "merge/scratch/row_list.h"

namespace megablock {

// Every unknown that a kept residual of the tile touches, ascending. What make_plan needs of each tile.
UnknownList tile_unknowns(const TileProblem& problem);
// With other intrinsics estimated than those of the problem, one mask per camera.
UnknownList tile_unknowns(const TileProblem& problem, const std::vector<ParameterMask>& camera_free);

// Symbolic work of a tile, done once per verdict on observations.
struct TilePlan {
  UnknownList unknowns;                     // touched, ascending
  UnknownList boundary;                     // passed to the merge tree, ascending
  UnknownList owned;                        // no tile with a lower number touches them
  EliminationPlan cells;                    // leaves = cells
  std::vector<RowList> points;              // [cells] active points (rows), ascending
  std::vector<std::vector<TermRow>> terms;  // [cells] observations without a point, ascending by type and row
  // Part of every frame row that hangs together by points and observations between frames, by lowest frame; -1:
  // untouched. [frames]
  std::vector<std::int64_t> part_of_frame;
  std::int64_t part_count = 0;
  // Position in `unknowns`, -1: held or untouched.
  std::vector<std::int64_t> unknown_of_frame, unknown_of_camera, unknown_of_mount;
  std::vector<ParameterMask> camera_free;  // [cameras] estimated intrinsics
  void write(ByteWriter& out) const;
  static TilePlan read(ByteReader& in);
};
// Frame row of an active point's first kept observation.
std::int64_t frame_of_point(const TileProblem& problem, std::int64_t point);
// `node` is the tile's leaf in the plan of the merge tree.
TilePlan make_tile_plan(const TileProblem& problem, const PlanNode& node, std::int64_t cell_max_frames = 16);
// Of a tile that is a block of its own: nothing is passed on.
TilePlan make_lone_tile_plan(const TileProblem& problem, const std::vector<ParameterMask>& camera_free);

}  // namespace megablock
