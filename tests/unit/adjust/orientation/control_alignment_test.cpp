// A simulated aerial block, moved by a known similarity, against the similarity that the control points give.
#include "adjust/orientation/control_alignment.h"

#include <gtest/gtest.h>

#include "geometry/numbers/angles.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

struct MovedBlock {
  Block block;
  BlockState truth, moved;
  std::vector<FrameIndex> frames;
  Similarity to_ground;

  explicit MovedBlock(std::int64_t control, double seed = 1) {
    SimulationOptions options;
    options.frames = 40;
    options.points_per_frame = 20;
    options.control_points = static_cast<int>(control);
    options.image_noise_px = 0.5;
    options.seed = static_cast<std::uint64_t>(seed);
    SimulatedBlock simulated = simulate_block(options);
    block = std::move(simulated.block);
    truth = moved = simulated.truth;
    to_ground.scale = 37;
    to_ground.rotation = rotation_exp<double>({0.4, -1.1, 2.0});
    to_ground.translation = {100, -2000, 300};
    for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
      block.frames[f].position_prior.reset();
      frames.push_back(f);
    }
    move_frames(to_ground.inverse(), frames, moved);
  }

  // The largest distance of a frame from its true position after the alignment, metres.
  double position_error(const Similarity& similarity) const {
    double largest = 0;
    for (const FrameIndex f : frames)
      largest = std::max(largest, (similarity(moved.frames[f].centre) - truth.frames[f].centre).norm());
    return largest;
  }
};

// Marks of half a pixel leave the similarity good to a share of the control's own precision in the block.
TEST(ControlAlignment, FindsTheSimilarity) {
  const MovedBlock block(8);
  const auto aligned = align_with_control(block.block, block.moved, block.frames);
  ASSERT_TRUE(aligned);
  EXPECT_EQ(aligned->points, 8);
  EXPECT_EQ(aligned->agreeing, 8);
  EXPECT_LT(aligned->median_residual_px, 1.5);
  EXPECT_NEAR(aligned->similarity.scale / 37, 1, 1e-3);
  EXPECT_LT(block.position_error(aligned->similarity), 0.5);
  EXPECT_FALSE(aligned->on_a_line);
}

TEST(ControlAlignment, StandsAnyGrossErrorOfOneAmongFive) {
  const MovedBlock good(5);
  const auto before = align_with_control(good.block, good.moved, good.frames);
  ASSERT_TRUE(before);
  for (std::size_t point = 0; point < 5; ++point)
    for (int kind = 0; kind < 4; ++kind) {
      MovedBlock block = good;
      ControlPoint& wrong = block.block.control_points[point];
      if (kind < 3) {
        wrong.position[kind] += 30;
      } else {
        for (ImageMeasurement& mark : wrong.measurements) mark.pixel.x() += 200;
      }
      const auto aligned = align_with_control(block.block, block.moved, block.frames);
      ASSERT_TRUE(aligned);
      EXPECT_EQ(aligned->agreeing, 4) << point << " " << kind;
      // Four points leave the block as good as five do, but for their own noise.
      EXPECT_LT(block.position_error(aligned->similarity), 1.0) << point << " " << kind;
    }
}

// A mark that is wrong alone leaves its point to the other marks.
TEST(ControlAlignment, StandsOneWrongMarkOfEveryPoint) {
  MovedBlock block(6);
  for (ControlPoint& point : block.block.control_points) {
    ASSERT_GE(point.measurements.size(), 3u);
    point.measurements.front().pixel.y() += 300;
  }
  const auto aligned = align_with_control(block.block, block.moved, block.frames);
  ASSERT_TRUE(aligned);
  EXPECT_EQ(aligned->agreeing, 6);
  EXPECT_LT(block.position_error(aligned->similarity), 1.0);
}

TEST(ControlAlignment, TakesPointsWithoutHeights) {
  MovedBlock block(7);
  for (std::size_t p = 0; p < 4; ++p) {
    block.block.control_points[p].position.z() = std::numeric_limits<double>::quiet_NaN();
    block.block.control_points[p].sigma.z() = std::numeric_limits<double>::infinity();
  }
  for (std::size_t p = 4; p < 7; ++p)
    block.block.control_points[p].sigma.head<2>().setConstant(std::numeric_limits<double>::infinity());
  const auto aligned = align_with_control(block.block, block.moved, block.frames);
  ASSERT_TRUE(aligned);
  EXPECT_EQ(aligned->points, 7);
  EXPECT_LT(block.position_error(aligned->similarity), 5);
}

// The images look down, so that two points suffice; the tilt about their line is as good as the images are vertical.
TEST(ControlAlignment, LevelsTwoPointsByTheImages) {
  const MovedBlock block(2);
  const auto aligned = align_with_control(block.block, block.moved, block.frames);
  ASSERT_TRUE(aligned);
  EXPECT_TRUE(aligned->on_a_line);
  const Eigen::Quaterniond off = aligned->similarity.rotation * block.to_ground.rotation.conjugate();
  EXPECT_LT(rotation_log<double>(off).norm(), 3 * kDegree);
}

TEST(ControlAlignment, NeedsTwoPointsThatTwoImagesSee) {
  MovedBlock block(2);
  block.block.control_points[0].measurements.resize(1);
  EXPECT_FALSE(align_with_control(block.block, block.moved, block.frames));
  block.block.control_points.clear();
  EXPECT_FALSE(align_with_control(block.block, block.moved, block.frames));
}

TEST(ControlAlignment, LeavesTheScaleOfRigsAlone) {
  MovedBlock block(6);
  for (Rig& rig : block.block.rigs) rig.mounts.front().pose.centre = {0, 0, 1e-9};
  const auto aligned = align_with_control(block.block, block.moved, block.frames);
  ASSERT_TRUE(aligned);
  EXPECT_EQ(aligned->similarity.scale, 1);
}

// Check points do not count.
TEST(ControlAlignment, IgnoresCheckPoints) {
  MovedBlock block(6);
  for (ControlPoint& point : block.block.control_points) point.role = PointRole::kCheck;
  EXPECT_FALSE(align_with_control(block.block, block.moved, block.frames));
}

}  // namespace
}  // namespace megablock
