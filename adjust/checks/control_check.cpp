#include "adjust/checks/control_check.h"

#include <algorithm>
#include <set>

#include "adjust/orientation/control_alignment.h"
#include "adjust/terms/prior_loss.h"
#include "io/base/disjoint_sets.h"

namespace megablock {

namespace {

constexpr double kMark_px = 3;    // a mark in an image is as good as that
constexpr double kExplained = 4;  // sigmas of the coordinates
// Times the rms of the best points, which is about half of that of all right ones. Where coordinates are worse than
// stated, the adjustment judges what is nearer, by sigmas that it knows better.
constexpr double kGross = 10;

// Calls visit(frame) for the kept observations of a point.
void visit_frames(const TileProblem& problem, std::int64_t point, const auto& visit) {
  for (std::int64_t row = problem.begin[point]; row < problem.begin[point + 1]; ++row)
    if (problem.kept[row]) visit(problem.images[static_cast<std::size_t>(problem.image[row].value)].frame.value);
}

// Whether tie points connect all frames in which the tile sees its control points.
bool hangs_together(const TileProblem& problem) {
  DisjointSets sets(std::ssize(problem.frames));
  for (std::int64_t p = 0; p < problem.point_count(); ++p) {
    if (problem.points[p].role != PointRole::kTie || !problem.active(p)) continue;
    const std::int64_t first = frame_of_point(problem, p);
    visit_frames(problem, p, [&](std::int64_t frame) { sets.unite(first, frame); });
  }
  std::set<std::int64_t> with_control;
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    if (problem.points[p].role != PointRole::kTie)
      visit_frames(problem, p, [&](std::int64_t frame) { with_control.insert(sets.find(frame)); });
  return with_control.size() == 1;
}

}  // namespace

std::vector<PriorId> testable_control(const TileProblem& problem) {
  std::vector<PriorId> control;
  for (const auto& term : problem.point_priors)
    if (!held(term)) control.push_back({problem.points[static_cast<std::size_t>(term.point.value)].index, 1});
  std::ranges::sort(control);
  return control;
}

std::optional<ControlCheck> check_control(const Block& block, const BlockState& oriented, const TileProblem& problem,
                                          const TileState& state) {
  if (!hangs_together(problem)) return std::nullopt;
  BlockState adjusted = oriented;
  store_tile_state(problem, state, adjusted);
  const auto aligned = align_with_control(block, adjusted, problem.frames, kMark_px);
  if (!aligned || aligned->points < kFewestControl) return std::nullopt;
  std::set<std::int64_t> own;
  for (const auto& term : problem.point_priors_aside)
    own.insert(problem.points[static_cast<std::size_t>(term.point.value)].index);
  ControlCheck check{aligned->similarity, {}};
  for (const ControlAlignment::Misfit& misfit : aligned->misfits) {
    if (!own.contains(misfit.row) || misfit.residual_px < kGross * aligned->best_rms_px) continue;
    const Eigen::Vector3d sigma = block.control_points[static_cast<std::size_t>(misfit.row)].sigma;
    if ((misfit.off.array().abs() > kExplained * sigma.array()).any()) check.wrong.push_back({misfit.row, 1});
  }
  if (5 * std::ssize(check.wrong) > std::ssize(own)) return std::nullopt;
  return check;
}

}  // namespace megablock
