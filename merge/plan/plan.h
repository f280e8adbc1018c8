// Plans an elimination along a tree: says which unknowns are eliminated at which node.
//
// An unknown is eliminated at the lowest node whose subtree holds all leaves that touch it. There the equations of all
// its residuals are in one front, so that it can be eliminated for good. Every node below that one sends it to its
// parent. The same plan serves the merge tree (leaves = tiles) and the inside of a tile (leaves = cells).
//
// The plan is symbolic: it depends on which unknowns a leaf touches, not on values. It is the same on every rank, and
// one plan serves all iterations with the same kept observations.
#pragma once

#include <vector>

#include "io/block/image_graph.h"
#include "merge/plan/unknowns.h"
#include "merge/scratch/bytes.h"

namespace megablock {

struct PlanNode {
  std::int64_t left = -1, right = -1, parent = -1;  // as in the tree; -1: none
  std::int64_t leaf = -1;                           // leaf number (tile or cell), -1 for inner nodes
  UnknownList eliminated;                           // eliminated here, ascending
  UnknownList separator;                            // separator unknowns, those of the update matrix, ascending
  // What must be counted once for each unknown of the block (constraints and sums of the datum, the motion of the
  // block) is left to the leaf that owns it.
  UnknownList owned;  // leaves: touched here and by no leaf with a lower number
  std::int64_t front_dimension() const { return total_dimension(eliminated) + total_dimension(separator); }
};

struct EliminationPlan {
  std::vector<PlanNode> nodes;             // children before parents; the last node is the root
  std::vector<std::int64_t> node_of_leaf;  // [leaves]
  std::int64_t root() const { return static_cast<std::int64_t>(nodes.size()) - 1; }
  void write(ByteWriter& out) const;
  static EliminationPlan read(ByteReader& in);  // throws StoreError
};

// The cost of the inner nodes. The cost of the leaves is in their own plans.
struct FrontCosts {
  std::int64_t root = 0, widest = 0;  // number of unknowns of the root's front, of the largest front
  double operations = 0;              // floating-point additions and multiplications of eliminating all of them once
};
// A front counts as dense, also where its children fill it only in part.
FrontCosts front_costs(const EliminationPlan& plan);

// `leaf_unknowns` has an ascending list for each leaf: the unknowns in its residuals. `kept` is ascending; these
// unknowns are never eliminated, and the root sends them on (the separator unknowns of a tile). Throws ComputeError
// when a leaf of the list is not in the tree, when a node other than the last has no parent, and when an unknown has
// two dimensions.
EliminationPlan make_plan(const MergeTree& tree, const std::vector<UnknownList>& leaf_unknowns,
                          const UnknownList& kept = {});

}  // namespace megablock
