// A simulated tile, away from the ground by a known similarity, with wrong control points.
#include "adjust/checks/control_check.h"

#include <gtest/gtest.h>

#include "adjust/orientation/control_alignment.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

struct ShapedTile : SingleTile {
  Similarity to_ground{0.5, rotation_exp<double>({0.2, -0.4, 1.0}), {100, -200, 30}};

  explicit ShapedTile(int control) : SingleTile(simulation(control)) {
    for (Frame& frame : simulated.block.frames) frame.position_prior.reset();
    state = truth();
    const Similarity from_ground = to_ground.inverse();
    for (Pose& pose : state.frames) pose = from_ground(pose);
    for (Eigen::Vector3d& point : state.points) point = from_ground(point);
    set_aside(testable_control(problem), problem);
  }
  static SimulationOptions simulation(int control) {
    SimulationOptions options;
    options.frames = 12;
    options.points_per_frame = 60;
    options.control_points = control;
    options.image_noise_px = 0.5;
    return options;
  }

  std::optional<ControlCheck> check() const {
    return check_control(simulated.block, initial_state(simulated.block), problem, state);
  }
  ControlPoint& control(std::size_t row) { return simulated.block.control_points[row]; }
};

std::vector<PriorId> only(std::int64_t row) { return {{row, 1}}; }

TEST(ControlCheck, FindsNothingWrongAndTheWayToTheGround) {
  const ShapedTile tile(5);
  const auto check = tile.check();
  ASSERT_TRUE(check);
  EXPECT_TRUE(check->wrong.empty());
  EXPECT_NEAR(check->to_control.scale / tile.to_ground.scale, 1, 1e-3);
  EXPECT_LT(rotation_angle(check->to_control.rotation, tile.to_ground.rotation), 1e-3);
}

TEST(ControlCheck, FindsAnErrorOfAnySizeOfEachOfFivePoints) {
  for (std::size_t row = 0; row < 5; ++row)
    for (const double error : {4.0, 30.0, 11000.0})
      for (int axis = 0; axis < 3; ++axis) {
        ShapedTile tile(5);
        tile.control(row).position[axis] += error;
        const auto check = tile.check();
        ASSERT_TRUE(check);
        EXPECT_EQ(check->wrong, only(static_cast<std::int64_t>(row))) << row << " " << error << " " << axis;
        EXPECT_NEAR(check->to_control.scale / tile.to_ground.scale, 1, 1e-2);
      }
}

TEST(ControlCheck, LeavesWhatTheStatedSigmasExplain) {
  ShapedTile tile(6);
  tile.control(2).position.x() += 4;
  tile.control(2).sigma.x() = 2;
  EXPECT_TRUE(tile.check()->wrong.empty());
  tile.control(2).sigma.x() = 0.5;
  EXPECT_EQ(tile.check()->wrong, only(2));
}

// Coordinates that are all much worse than stated are not gross errors.
TEST(ControlCheck, LeavesPointsThatAreAllOff) {
  ShapedTile tile(10);
  for (std::size_t row = 0; row < 10; ++row)
    tile.control(row).position += Eigen::Vector3d(row % 2 ? 1 : -1, row % 3 ? 1 : -1, row % 5 ? 0.5 : -0.5);
  const auto check = tile.check();
  ASSERT_TRUE(check);
  EXPECT_TRUE(check->wrong.empty());
  tile.control(7).position.y() += 200;
  EXPECT_EQ(tile.check()->wrong, only(7));
}

// A tile sees points of its neighbours in images at its edge, which few tie points hold.
TEST(ControlCheck, DoesNotJudgePointsOfOtherTiles) {
  ShapedTile tile(6);
  tile.control(2).position.x() += 30;
  EXPECT_EQ(tile.check()->wrong, only(2));
  std::erase_if(tile.problem.point_priors_aside, [&](const TileProblem::PointTerm& term) {
    return tile.problem.points[static_cast<std::size_t>(term.point.value)].index == 2;
  });
  EXPECT_TRUE(tile.check()->wrong.empty());
}

TEST(ControlCheck, SaysNothingOfFewPoints) { EXPECT_FALSE(ShapedTile(4).check()); }

TEST(ControlCheck, SaysNothingWhereMoreThanAFifthIsWrong) {
  ShapedTile tile(9);
  tile.control(1).position.x() += 500;
  EXPECT_EQ(tile.check()->wrong, only(1));
  tile.control(4).position.y() -= 700;
  EXPECT_FALSE(tile.check());
}

// Each part of a tile in two parts has a similarity of its own.
TEST(ControlCheck, SaysNothingOfAControlInTwoParts) {
  ShapedTile tile(8);
  TileProblem& problem = tile.problem;
  const auto half = static_cast<std::int32_t>(problem.frames.size() / 2);
  for (std::int64_t p = 0; p < problem.point_count(); ++p)
    for (std::int64_t row = problem.begin[p]; row < problem.begin[p + 1]; ++row)
      if (problem.points[p].role == PointRole::kTie &&
          (problem.images[static_cast<std::size_t>(problem.image[row].value)].frame.value < half) != (p % 2 == 0))
        problem.kept[row] = 0;
  EXPECT_FALSE(tile.check());
}

// A control point that is held is no observation.
TEST(ControlCheck, TestsNoControlThatIsHeld) {
  ShapedTile tile(5);
  SimulatedBlock simulated = tile.simulated;
  simulated.block.control_points[3].sigma.setConstant(1e-9);
  const std::vector<PriorId> testable = testable_control(SingleTile(std::move(simulated)).problem);
  EXPECT_EQ(testable.size(), 4u);
  EXPECT_FALSE(std::ranges::binary_search(testable, PriorId{3, 1}));
}

}  // namespace
}  // namespace megablock
