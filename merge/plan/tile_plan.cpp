// Makes the plan of a tile: finds its unknowns, divides it into cells, and gives points and observations to the cells.
//
// The cells continue the bisection of the block inside the tile. The graph of the tile's frames, with the number of
// common points as weights, is bisected down to cells. Each inner node of this tree has a separator, a smallest set of
// frames that cuts all links between its two halves (partition/tiles/separators.h). A point belongs to a cell by the
// rule of adjust/problem/owner.h, so that only frames of separators occur in points of two halves. The tile's own
// separator acts as one more separator above the root of this tree.
#include "merge/plan/tile_plan.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "adjust/problem/owner.h"
#include "io/base/disjoint_sets.h"
#include "merge/plan/unknowns.h"
#include "partition/tiles/separators.h"
#include "partition/tiles/tiles.h"

namespace megablock {

namespace {

// The rows of the problem's tables that occur in a kept residual and are unknowns. A frame always is one; a camera
// needs a free parameter, a mount must be free.
struct TouchedRows {
  std::vector<std::uint8_t> frames, cameras, mounts;
};

// Calls visit(TermRow, TermUnknowns) for all observations without a point.
template <typename Visit>
void visit_all_terms(const TileProblem& problem, Visit&& visit) {
  const auto types = observation_types();
  for (std::size_t type = 0; type < types.size(); ++type) {
    for (std::size_t row = 0; row < types[type]->count(problem); ++row) {
      const TermUnknowns unknowns = types[type]->unknowns(problem, row);
      if (unknowns.point < 0) visit(TermRow{static_cast<std::int32_t>(type), static_cast<std::int32_t>(row)}, unknowns);
    }
  }
}

// The masks say which intrinsics are unknowns here; a tile's own adjustment estimates fewer than the block.
TouchedRows touched_rows(const TileProblem& problem, const std::vector<ParameterMask>& camera_free) {
  TouchedRows touched{std::vector<std::uint8_t>(problem.frames.size(), 0),
                      std::vector<std::uint8_t>(problem.cameras.size(), 0),
                      std::vector<std::uint8_t>(problem.mounts.size(), 0)};
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (!problem.active(p)) continue;
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row) {
      if (!problem.kept[row]) continue;
      const TileImage& image = problem.images[problem.image[row].value];
      touched.frames[image.frame.value] = 1;
      touched.cameras[image.camera.value] = camera_free[image.camera.value] != 0;
      touched.mounts[image.mount] = problem.mount_free[image.mount] != 0;
    }
  }
  visit_all_terms(problem, [&](TermRow, const TermUnknowns& term) {
    for (int f = 0; f < term.frame_count; ++f) touched.frames[at(term.frame[at(f)])] = 1;
    if (term.camera >= 0 && camera_free[at(term.camera)]) touched.cameras[at(term.camera)] = 1;
    for (const std::int32_t mount : term.mounts)
      if (mount >= 0 && problem.mount_free[at(mount)]) touched.mounts[at(mount)] = 1;
  });
  return touched;
}

Unknown frame_unknown(const TileProblem& problem, std::size_t row) {
  return {{UnknownKind::kFrame, 0, problem.frames[row].value}, 6};
}
Unknown camera_unknown(const TileProblem& problem, std::size_t row, ParameterMask free) {
  return {{UnknownKind::kCamera, 0, problem.cameras[row].value}, count_of(free)};
}
Unknown mount_unknown(const TileProblem& problem, std::size_t row) {
  return {{UnknownKind::kMount, problem.mounts[row].mount, problem.mounts[row].rig.value}, 6};
}

UnknownList listed(const TileProblem& problem, const TouchedRows& touched,
                   const std::vector<ParameterMask>& camera_free) {
  UnknownList unknowns;
  for (std::size_t row = 0; row < touched.frames.size(); ++row)
    if (touched.frames[row]) unknowns.push_back(frame_unknown(problem, row));
  for (std::size_t row = 0; row < touched.cameras.size(); ++row)
    if (touched.cameras[row]) unknowns.push_back(camera_unknown(problem, row, camera_free[row]));
  for (std::size_t row = 0; row < touched.mounts.size(); ++row)
    if (touched.mounts[row]) unknowns.push_back(mount_unknown(problem, row));
  return unknowns;
}

// The frame rows of an active point's kept observations, ascending; a frame may occur several times.
void frames_of_point(const TileProblem& problem, std::int64_t point, std::vector<std::int32_t>& frames) {
  frames.clear();
  for (std::int64_t row = problem.begin[point]; row < problem.begin[point + 1]; ++row)
    if (problem.kept[row]) frames.push_back(problem.images[problem.image[row].value].frame.value);
  std::sort(frames.begin(), frames.end());
}

// The edges between frames that share points or other observations, ascending. Their weight is the number of shared
// ones. There are millions of pairs of frames: they are sorted by their lower frame by counting, and the pairs of each
// lower frame are counted by their upper one.
FrameGraph graph_of(const TileProblem& problem) {
  const std::size_t frame_count = problem.frames.size();
  std::vector<std::int32_t> frames;
  const auto visit_pairs = [&](auto&& visit) {
    for (std::int64_t p = 0; p < problem.point_count(); ++p) {
      if (!problem.active(p)) continue;
      frames_of_point(problem, p, frames);
      frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
      for (std::size_t a = 0; a < frames.size(); ++a)
        for (std::size_t b = a + 1; b < frames.size(); ++b) visit(frames[a], frames[b]);
    }
    visit_all_terms(problem, [&](TermRow, const TermUnknowns& term) {
      const auto [a, b] = term.frame;
      if (term.frame_count == 2 && a != b) visit(std::min(a, b), std::max(a, b));
    });
  };
  // The end of the pairs of each lower frame; at first it holds their beginning.
  std::vector<std::size_t> end(frame_count + 1, 0);
  visit_pairs([&](std::int32_t a, std::int32_t) { ++end[static_cast<std::size_t>(a) + 1]; });
  std::partial_sum(end.begin(), end.end(), end.begin());
  std::vector<std::int32_t> upper(end.back());
  visit_pairs([&](std::int32_t a, std::int32_t b) { upper[end[static_cast<std::size_t>(a)]++] = b; });

  FrameGraph graph;
  graph.frame_count = static_cast<std::int64_t>(frame_count);
  std::vector<std::int32_t> met;
  std::vector<std::int64_t> weight(frame_count, 0);
  std::size_t row = 0;
  for (std::size_t a = 0; a < frame_count; ++a) {
    met.clear();
    for (; row < end[a]; ++row)
      if (weight[static_cast<std::size_t>(upper[row])]++ == 0) met.push_back(upper[row]);
    std::sort(met.begin(), met.end());
    for (const std::int32_t b : met)
      graph.edges.push_back({FrameIndex(static_cast<std::int64_t>(a)), FrameIndex(b),
                             std::exchange(weight[static_cast<std::size_t>(b)], 0)});
  }
  return graph;
}

// Numbers the connected parts of the tile in the order of their lowest frames. The root of a set is its lowest member.
void number_parts(const FrameGraph& graph, TilePlan& plan) {
  DisjointSets sets(static_cast<std::int32_t>(graph.frame_count));
  for (const auto& edge : graph.edges)
    sets.unite(static_cast<std::int32_t>(edge.a.value), static_cast<std::int32_t>(edge.b.value));
  plan.part_of_frame.assign(static_cast<std::size_t>(graph.frame_count), -1);
  for (std::int32_t f = 0; f < graph.frame_count; ++f) {
    if (plan.unknown_of_frame[static_cast<std::size_t>(f)] < 0) continue;
    const std::int32_t lowest = sets.find(f);
    plan.part_of_frame[static_cast<std::size_t>(f)] =
        lowest == f ? plan.part_count++ : plan.part_of_frame[static_cast<std::size_t>(lowest)];
  }
}

// Gives points, and observations without a point, to cells, and notes the unknowns that each cell touches.
class CellPlanner {
 public:
  CellPlanner(const TileProblem& problem, TilePlan& plan, const std::vector<std::int32_t>& cell_of_frame,
              const std::vector<std::int32_t>& depth_of_frame, std::size_t cells)
      : problem_(problem), plan_(plan), cell_of_frame_(cell_of_frame), depth_of_frame_(depth_of_frame) {
    plan.points.resize(cells);
    plan.terms.resize(cells);
    touched_.assign(cells, std::vector<std::uint8_t>(plan.unknowns.size(), 0));
  }

  std::vector<UnknownList> run() {
    share_points();
    share_terms();
    std::vector<UnknownList> lists(touched_.size());
    for (std::size_t c = 0; c < touched_.size(); ++c)
      for (std::size_t u = 0; u < plan_.unknowns.size(); ++u)
        if (touched_[c][u]) lists[c].push_back(plan_.unknowns[u]);
    return lists;
  }

 private:
  void touch(std::size_t cell, std::int64_t unknown) {
    if (unknown >= 0) touched_[cell][static_cast<std::size_t>(unknown)] = 1;
  }
  std::size_t cell_of(LocalFrame frame) const {
    return static_cast<std::size_t>(cell_of_frame_[static_cast<std::size_t>(frame.value)]);
  }
  // The cell that owns an observation of these frame rows, which may occur several times. A frame counts once for each
  // observation in it.
  std::size_t owner_of(const std::vector<std::int32_t>& frames) {
    candidates_.clear();
    for (const std::int32_t frame : frames) {
      const auto row = static_cast<std::size_t>(frame);
      candidates_.push_back({cell_of_frame_[row], depth_of_frame_[row]});
    }
    return static_cast<std::size_t>(owner_part(candidates_));
  }

  // A cell touches every unknown in the residuals of its points, free cameras and mounts included. These are eliminated
  // high up in the tile, or sent on.
  void share_points() {
    std::vector<std::int32_t> frames;
    for (std::int64_t p = 0; p < problem_.point_count(); ++p) {
      if (!problem_.active(p)) continue;
      frames_of_point(problem_, p, frames);
      const std::size_t cell = owner_of(frames);
      plan_.points[cell].push_back(static_cast<std::int32_t>(p));
      for (std::int64_t row = problem_.begin[p]; row < problem_.begin[p + 1]; ++row) {
        if (!problem_.kept[row]) continue;
        const TileImage& image = problem_.images[problem_.image[row].value];
        touch(cell, plan_.unknown_of_frame[image.frame.value]);
        touch(cell, plan_.unknown_of_camera[image.camera.value]);
        touch(cell, plan_.unknown_of_mount[image.mount]);
      }
    }
    for (auto& points : plan_.points) points.shrink_to_fit();
  }

  void share_terms() {
    // The prior of a camera or mount goes to the cell of its first image.
    std::vector<std::size_t> camera_cell(problem_.cameras.size(), 0), mount_cell(problem_.mounts.size(), 0);
    // Backwards, so that the first image is written last.
    for (auto image = problem_.images.rbegin(); image != problem_.images.rend(); ++image)
      camera_cell[image->camera.value] = mount_cell[static_cast<std::size_t>(image->mount)] = cell_of(image->frame);
    std::vector<std::int32_t> frames;
    visit_all_terms(problem_, [&](TermRow row, const TermUnknowns& term) {
      frames.assign(term.frame.begin(), term.frame.begin() + term.frame_count);
      const std::size_t cell = !frames.empty()    ? owner_of(frames)
                               : term.camera >= 0 ? camera_cell[at(term.camera)]
                                                  : mount_cell[at(term.mounts[0])];
      plan_.terms[cell].push_back(row);
      for (const std::int32_t frame : frames) touch(cell, plan_.unknown_of_frame[at(frame)]);
      for (const std::int32_t mount : term.mounts)
        if (mount >= 0) touch(cell, plan_.unknown_of_mount[at(mount)]);
      if (term.camera >= 0) touch(cell, plan_.unknown_of_camera[at(term.camera)]);
    });
    // A position that is set aside is still tested, for which its unknowns must meet in a front
    // (merge/tile/position_covariances.h).
    for (const TileProblem::PositionTerm& term : problem_.positions_aside) {
      frames.assign(1, term.frame.value);
      const std::size_t cell = owner_of(frames);
      touch(cell, plan_.unknown_of_frame[at(term.frame.value)]);
      for (const std::int32_t mount : {term.receiver, term.group})
        if (mount >= 0) touch(cell, plan_.unknown_of_mount[at(mount)]);
    }
  }

  const TileProblem& problem_;
  TilePlan& plan_;
  const std::vector<std::int32_t>&cell_of_frame_, &depth_of_frame_;
  std::vector<OwnerCandidate> candidates_;
  std::vector<std::vector<std::uint8_t>> touched_;
};

}  // namespace

UnknownList tile_unknowns(const TileProblem& problem) { return tile_unknowns(problem, problem.camera_free); }

UnknownList tile_unknowns(const TileProblem& problem, const std::vector<ParameterMask>& camera_free) {
  UnknownList unknowns = listed(problem, touched_rows(problem, camera_free), camera_free);
  std::sort(unknowns.begin(), unknowns.end());
  return unknowns;
}

namespace {

TilePlan plan_of(const TileProblem& problem, const PlanNode& node, const UnknownList& unknowns,
                 const std::vector<ParameterMask>& camera_free, std::int64_t cell_max_frames) {
  TilePlan plan;
  plan.unknowns = unknowns;
  plan.camera_free = camera_free;
  plan.boundary = node.separator;
  plan.owned = node.owned;
  const auto position = [&](const Unknown& u) { return find_unknown(plan.unknowns, u.id); };
  for (std::size_t row = 0; row < problem.frames.size(); ++row)
    plan.unknown_of_frame.push_back(position(frame_unknown(problem, row)));
  for (std::size_t row = 0; row < problem.cameras.size(); ++row)
    plan.unknown_of_camera.push_back(position(camera_unknown(problem, row, camera_free[row])));
  for (std::size_t row = 0; row < problem.mounts.size(); ++row)
    plan.unknown_of_mount.push_back(position(mount_unknown(problem, row)));

  // The same graph gives the parts of the tile and its cells.
  const FrameGraph graph = graph_of(problem);
  number_parts(graph, plan);
  BisectionTree cells = bisect(graph, cell_max_frames);
  if (cells.tree.nodes.empty()) {  // a tile without frames: one empty cell
    cells.tree.nodes.emplace_back();
    cells.tree.nodes.back().tile = TileIndex(0);
  }
  std::size_t cell_count = 0;
  for (const MergeTree::Node& n : cells.tree.nodes) cell_count += n.left < 0 && n.right < 0;
  // The frames of the tile's separator count as removed, because they lie above the root of the cells.
  std::vector<std::uint8_t> separator(problem.frames.size(), 0);
  for (std::size_t row = 0; row < separator.size(); ++row)
    separator[row] = find_unknown(plan.boundary, frame_unknown(problem, row).id) >= 0;
  std::vector<std::int32_t> depth = separator_depths(graph, cells.leaf_of_node, cells.tree, separator);
  for (std::size_t row = 0; row < separator.size(); ++row)
    // Depth 0 is now the tile's separator, which separator_depths left at -1; the root of the cells has depth 1. Frames
    // that separate nothing keep -1.
    if (separator[row] || depth[row] >= 0) ++depth[row];
  const std::vector<UnknownList> lists = CellPlanner(problem, plan, cells.leaf_of_node, depth, cell_count).run();
  plan.cells = make_plan(cells.tree, lists, plan.boundary);
  for (PlanNode& cell : plan.cells.nodes) cell.owned = {};  // only the `owned` lists of tiles are used
  return plan;
}

}  // namespace

void TilePlan::write(ByteWriter& out) const {
  for (const UnknownList* list : {&unknowns, &boundary, &owned}) out.values(*list);
  cells.write(out);
  for (const RowList& rows : points) rows.write(out);
  for (const std::vector<TermRow>& rows : terms) out.values(rows);
  for (const auto* rows : {&part_of_frame, &unknown_of_frame, &unknown_of_camera, &unknown_of_mount}) out.values(*rows);
  out.value(part_count);
  out.values(camera_free);
}

TilePlan TilePlan::read(ByteReader& in) {
  TilePlan plan;
  for (UnknownList* list : {&plan.unknowns, &plan.boundary, &plan.owned}) *list = in.values<Unknown>();
  plan.cells = EliminationPlan::read(in);
  const std::size_t cell_count = plan.cells.node_of_leaf.size();
  for (std::size_t cell = 0; cell < cell_count; ++cell) plan.points.push_back(RowList::read(in));
  for (std::size_t cell = 0; cell < cell_count; ++cell) plan.terms.push_back(in.values<TermRow>());
  for (auto* rows : {&plan.part_of_frame, &plan.unknown_of_frame, &plan.unknown_of_camera, &plan.unknown_of_mount})
    *rows = in.values<std::int64_t>();
  plan.part_count = in.value<std::int64_t>();
  plan.camera_free = in.values<ParameterMask>();
  return plan;
}

TilePlan make_tile_plan(const TileProblem& problem, const PlanNode& node, std::int64_t cell_max_frames) {
  return plan_of(problem, node, tile_unknowns(problem), problem.camera_free, cell_max_frames);
}

TilePlan make_lone_tile_plan(const TileProblem& problem, const std::vector<ParameterMask>& camera_free) {
  constexpr std::int64_t kCellMaxFrames = 32;
  PlanNode node;
  node.leaf = 0;
  node.eliminated = node.owned = tile_unknowns(problem, camera_free);
  return plan_of(problem, node, node.owned, camera_free, kCellMaxFrames);
}

}  // namespace megablock
