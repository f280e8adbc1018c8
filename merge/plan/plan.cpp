// An unknown of leaves_of(u) leaves goes up the tree with the number of leaves below the present node that touch it. At
// the lowest node where this number is leaves_of(u), no leaf elsewhere has the unknown, and it is eliminated. The lists
// of two children are merged in ascending order, so the work is the total size of the separators, and no node looks at
// the whole table of unknowns.
#include "merge/plan/plan.h"

#include <algorithm>

#include "io/base/error.h"

namespace megablock {

namespace {

// An unknown of the table, and the number of leaves below a node that touch it.
struct Touched {
  std::size_t unknown;
  std::int64_t leaves;
};
using TouchedList = std::vector<Touched>;  // ascending

TouchedList merged(const TouchedList& a, const TouchedList& b) {
  TouchedList sum;
  sum.reserve(a.size() + b.size());
  auto left = a.begin(), right = b.begin();
  while (left != a.end() || right != b.end()) {
    if (right == b.end() || (left != a.end() && left->unknown < right->unknown)) {
      sum.push_back(*left++);
    } else if (left == a.end() || right->unknown < left->unknown) {
      sum.push_back(*right++);
    } else {
      sum.push_back({left->unknown, left->leaves + right->leaves});
      ++left, ++right;
    }
  }
  return sum;
}

}  // namespace

EliminationPlan make_plan(const MergeTree& tree, const std::vector<UnknownList>& leaf_unknowns,
                          const UnknownList& kept) {
  std::vector<const UnknownList*> lists = {&kept};
  for (const UnknownList& list : leaf_unknowns) lists.push_back(&list);
  const UnknownList table = unite(lists);

  std::vector<TouchedList> touched_by_leaf(leaf_unknowns.size());
  std::vector<std::int64_t> leaves_of(table.size(), 0);
  std::vector<UnknownList> owned(leaf_unknowns.size());
  for (std::size_t leaf = 0; leaf < leaf_unknowns.size(); ++leaf) {
    for (const Unknown& u : leaf_unknowns[leaf]) {
      const auto row = static_cast<std::size_t>(find_unknown(table, u.id));
      touched_by_leaf[leaf].push_back({row, 1});
      // The first leaf that touches an unknown owns it.
      if (leaves_of[row]++ == 0) owned[leaf].push_back(u);
    }
  }
  // Kept unknowns are never eliminated, because no node has a negative number of leaves.
  for (const Unknown& u : kept) leaves_of[static_cast<std::size_t>(find_unknown(table, u.id))] = -1;

  EliminationPlan plan;
  plan.nodes.resize(tree.nodes.size());
  plan.node_of_leaf.assign(leaf_unknowns.size(), -1);
  std::vector<TouchedList> open(tree.nodes.size());
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    // Children come before parents, so that `open` of both children is there.
    const MergeTree::Node& source = tree.nodes[i];
    PlanNode& node = plan.nodes[i];
    node.left = source.left;
    node.right = source.right;
    node.parent = source.parent;
    if (node.parent < 0 && i + 1 != tree.nodes.size())
      throw ComputeError("merge tree: node " + std::to_string(i) + " has no parent and is not the last node");
    TouchedList here;
    if (source.left < 0 && source.right < 0) {
      node.leaf = source.tile.value;
      const auto leaf = static_cast<std::size_t>(node.leaf);
      plan.node_of_leaf.at(leaf) = static_cast<std::int64_t>(i);
      here = std::move(touched_by_leaf[leaf]);
      node.owned = std::move(owned[leaf]);
    } else {
      static const TouchedList kNothing;
      here = merged(source.left < 0 ? kNothing : open[static_cast<std::size_t>(source.left)],
                    source.right < 0 ? kNothing : open[static_cast<std::size_t>(source.right)]);
    }
    for (const Touched& t : here) {
      if (t.leaves == leaves_of[t.unknown]) {
        node.eliminated.push_back(table[t.unknown]);
      } else {
        node.separator.push_back(table[t.unknown]);
        open[i].push_back(t);
      }
    }
  }
  for (std::size_t leaf = 0; leaf < plan.node_of_leaf.size(); ++leaf)
    if (plan.node_of_leaf[leaf] < 0) throw ComputeError("merge tree: no leaf for tile " + std::to_string(leaf));
  return plan;
}

void EliminationPlan::write(ByteWriter& out) const {
  out.value<std::uint64_t>(nodes.size());
  for (const PlanNode& node : nodes) {
    for (const std::int64_t number : {node.left, node.right, node.parent, node.leaf}) out.value(number);
    for (const UnknownList* list : {&node.eliminated, &node.separator, &node.owned}) out.values(*list);
  }
  out.values(node_of_leaf);
}

EliminationPlan EliminationPlan::read(ByteReader& in) {
  constexpr std::size_t kNodeBytes = 7 * sizeof(std::int64_t);  // four numbers, and the lengths of three lists
  EliminationPlan plan;
  plan.nodes.resize(in.count(kNodeBytes));
  for (PlanNode& node : plan.nodes) {
    for (std::int64_t* number : {&node.left, &node.right, &node.parent, &node.leaf}) *number = in.value<std::int64_t>();
    for (UnknownList* list : {&node.eliminated, &node.separator, &node.owned}) *list = in.values<Unknown>();
  }
  plan.node_of_leaf = in.values<std::int64_t>();
  const auto none_or_within = [](std::int64_t number, const auto& table) {
    return number >= -1 && number < std::ssize(table);
  };
  for (const PlanNode& node : plan.nodes)
    if (!none_or_within(node.left, plan.nodes) || !none_or_within(node.right, plan.nodes) ||
        !none_or_within(node.parent, plan.nodes) || !none_or_within(node.leaf, plan.node_of_leaf))
      throw StoreError("merge: a plan names nodes that it has not");
  for (const std::int64_t node : plan.node_of_leaf)
    if (node < 0 || !none_or_within(node, plan.nodes)) throw StoreError("merge: a plan names nodes that it has not");
  return plan;
}

FrontCosts front_costs(const EliminationPlan& plan) {
  FrontCosts costs;
  for (const PlanNode& node : plan.nodes) {
    if (node.leaf >= 0) continue;
    const std::int64_t width = node.front_dimension();
    costs.widest = std::max(costs.widest, width);
    // The Cholesky factorisation of e columns (e^3 / 3), the p rows below them (Y, p e^2), and the update (Y Y', p^2 e;
    // its lower triangle alone, two operations an element).
    const auto e = static_cast<double>(total_dimension(node.eliminated)), p = static_cast<double>(width) - e;
    costs.operations += e * e * e / 3 + p * e * e + p * p * e;
  }
  if (!plan.nodes.empty()) costs.root = plan.nodes.back().front_dimension();
  return costs;
}

}  // namespace megablock
