// Steps that turn the whole block: applied as similarities, they leave the images as they are.
#include "merge/step/block_motion.h"

#include <gtest/gtest.h>

#include "adjust/lanes/residual_squares.h"
#include "adjust/lanes/tile_cost.h"
#include "adjust/terms/linearise.h"
#include "geometry/similarity/similarity.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

SimulationOptions moving_block() {
  SimulationOptions o;
  o.frames = 60;
  o.points_per_frame = 60;
  return o;
}

// Tile 0 of a block with its plan, and a step that is the tangent of a similarity of everything.
class Motion : public testing::Test {
 protected:
  Motion()
      : block_(simulate_block(moving_block()), 12, {}, 0), runner_(block_.tiles.tree, block_.problems, block_.states) {
    runner_.up(1e-3);
    runner_.down(1e-3);
    problem_ = runner_.problems().front();
    problem_.positions.clear();  // only the images shall be heard
    wanted_.centre = Eigen::Vector3d(10, -20, 5);
    wanted_.rotation = Eigen::Vector3d(0.05, -0.08, 0.3);
    wanted_.shift = Eigen::Vector3d(3, 1, -2);
    wanted_.scale = 0.02;
  }
  TileStep tangent_step(std::size_t t, double part) const {
    TileStep step = runner_.steps()[t];
    const TileState& state = runner_.states()[t];
    const TileProblem& problem = runner_.problems()[t];
    std::fill(step.unknowns.values.begin(), step.unknowns.values.end(), 0.0);
    const std::vector<std::int64_t> rows = row_offsets(step.unknowns.unknowns);
    for (std::size_t u = 0; u < step.unknowns.unknowns.size(); ++u) {
      const UnknownId& id = step.unknowns.unknowns[u].id;
      if (id.kind != UnknownKind::kFrame) continue;
      const Pose& pose = state.frames[TiledBlock::row(problem.frames, FrameIndex(id.index))];
      Eigen::Map<PoseIncrement> x(step.unknowns.values.data() + rows[u]);
      x << -part * wanted_.rotation, part * wanted_.tangent(pose.centre);
    }
    for (std::size_t p = 0; p < step.points.size(); ++p) step.points[p] = part * wanted_.tangent(state.points[p]);
    return step;
  }
  std::vector<BlockMotion> motions(double part) const {
    std::vector<MotionSums> sums;
    for (std::size_t t = 0; t < runner_.problems().size(); ++t)
      sums.push_back(MotionSums::from_bytes(motion_sums(runner_.block_gauge(), static_cast<std::int64_t>(t),
                                                        runner_.problems()[t], runner_.tile_plans()[t],
                                                        runner_.states()[t], tangent_step(t, part).unknowns)
                                                .to_bytes()));
    return block_motions(runner_.block_gauge(), sums);
  }
  TileState applied(const std::vector<BlockMotion>& motions, double part) const {
    return apply_step(runner_.block_gauge(), motions, 0, problem_, runner_.tile_plans().front(),
                      runner_.states().front(), tangent_step(0, part));
  }

  TiledBlock block_;
  MergeInMemory runner_;
  TileProblem problem_;
  BlockMotion wanted_;
};

TEST_F(Motion, FindsTheSimilarityOfAStep) {
  const std::vector<BlockMotion> found = motions(1);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LE((found[0].rotation - wanted_.rotation).norm(), 1e-12);
  EXPECT_NEAR(found[0].scale, wanted_.scale, 1e-12);
  for (const Eigen::Vector3d& at : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(100, 50, -30)})
    EXPECT_LE((found[0].tangent(at) - wanted_.tangent(at)).norm(), 1e-9);
}

TEST_F(Motion, LeavesTheImagesAsTheyAre) {
  const double before = evaluate_cost(problem_, runner_.states().front());
  EXPECT_NEAR(evaluate_cost(problem_, applied(motions(1), 1)), before, 1e-9 * before);
  EXPECT_GT(evaluate_cost(problem_, applied({}, 1)), 100 * before);  // along straight lines
}

TEST_F(Motion, IsTheStepToFirstOrder) {
  const auto difference = [&](double part) {
    const TileState moved = applied(motions(part), part), straight = applied({}, part);
    double largest = 0;
    for (std::size_t f = 0; f < moved.frames.size(); ++f) {
      largest = std::max(largest, (moved.frames[f].centre - straight.frames[f].centre).norm());
      largest = std::max(largest, rotation_angle(moved.frames[f].rotation, straight.frames[f].rotation));
    }
    for (std::size_t p = 0; p < moved.points.size(); ++p)
      largest = std::max(largest, (moved.points[p] - straight.points[p]).norm());
    return largest;
  };
  const double coarse = difference(1e-2), fine = difference(1e-3);
  EXPECT_GT(coarse, 0);
  EXPECT_NEAR(fine, 1e-2 * coarse, 0.1 * 1e-2 * coarse);
}

// Positions of metres, a start turned by some degrees: without the similarity this took more than 100 steps.
TEST(GlobalAdjustment, TurnsAWeaklyPlacedBlockInFewSteps) {
  SimulationOptions options = moving_block();
  options.gps_sigma_m = 3;
  TiledBlock block(simulate_block(options), 12, {}, 0.01);
  Similarity turned;
  turned.rotation = rotation_exp<double>({0.01, -0.02, 0.1});
  turned.translation = {2, -1, 3};
  for (TileState& state : block.states) {
    for (Pose& pose : state.frames) pose = turned(pose);
    for (Eigen::Vector3d& point : state.points) point = turned(point);
  }
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalOptions exact;
  exact.max_decrement = 1e-6;
  GlobalState state = start_global(exact);
  adjust_globally(runner, exact, state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged) << describe(state);
  EXPECT_LE(state.iterations, 10) << describe(state);
}

}  // namespace
}  // namespace megablock
