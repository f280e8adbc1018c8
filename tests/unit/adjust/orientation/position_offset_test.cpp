// Positions of a simulated block that lie off its control by a known vector.
#include "adjust/orientation/position_offset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "adjust/orientation/control_alignment.h"
#include "io/block/observed_poses.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

// The block has the datum of its positions, which are off by `offset`.
struct OffsetBlock {
  Block block;
  BlockState truth, state;
  std::vector<FrameIndex> frames;

  explicit OffsetBlock(const Eigen::Vector3d& offset, double gps_sigma_m = 0.02, std::uint64_t seed = 1) {
    SimulationOptions options;
    options.frames = 40;
    options.points_per_frame = 20;
    options.control_points = 7;
    options.control_sigma_m = 0.02;
    options.gps_sigma_m = gps_sigma_m;
    options.image_noise_px = 0.5;
    options.seed = seed;
    SimulatedBlock simulated = simulate_block(options);
    block = std::move(simulated.block);
    for (Camera& camera : block.cameras) camera.prior_sigma[kFocal] = 0;  // known
    truth = state = simulated.truth;
    for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
      state.frames[f].centre += offset;
      block.frames[f].position_prior->position += offset;
      frames.push_back(f);
    }
  }
  std::optional<PositionOffset> find() const { return find_position_offset(block, state, frames); }
};

TEST(PositionOffset, OfHeightsIsFoundWithItsSigma) {
  double squares = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const auto found = OffsetBlock({0, 0, 46.9}, 0.02, seed).find();
    ASSERT_TRUE(found);
    EXPECT_EQ(found->points, 7);
    EXPECT_EQ(found->offset.head<2>(), Eigen::Vector2d::Zero());
    EXPECT_NEAR(found->offset.z(), 46.9, 0.1);
    squares += std::pow((found->offset.z() - 46.9) / found->sigma.z(), 2);
  }
  EXPECT_LT(squares / 20, 2);  // 20 squares of a number with sigma 1 have a mean of 1 +- 0.32
  EXPECT_GT(squares / 20, 0.3);
}

// A focal length that is too long puts the ground too low, as an offset of the heights would.
TEST(PositionOffset, IsNoBetterKnownThanTheFocalLength) {
  OffsetBlock block({0, 0, 46.9});
  for (CameraIndex c(0); block.block.cameras.contains(c); ++c.value) {
    block.block.cameras[c].prior_sigma[kFocal] = 0.02 * block.block.cameras[c].intrinsics[kFocal];
    block.state.cameras[c][kFocal] *= 1.02;
  }
  const auto found = block.find();
  ASSERT_TRUE(found);
  EXPECT_GT(std::abs(found->offset.z() - 46.9), 0.5);
  EXPECT_NEAR(std::abs(found->offset.z() - 46.9) / found->sigma.z(), 1, 0.2);
  // 8 m are no more than three sigmas of a height over ground of some 100 m and a focal length good to 5 %.
  OffsetBlock near({0, 0, 8});
  for (Camera& camera : near.block.cameras) camera.prior_sigma[kFocal] = 0.05 * camera.intrinsics[kFocal];
  EXPECT_FALSE(near.find());
}

TEST(PositionOffset, StandsThreeWrongPointsOfSeven) {
  OffsetBlock block({3, -2, 46.9});
  for (const std::size_t wrong : {0u, 3u, 5u}) block.block.control_points[wrong].position += Eigen::Vector3d(8, 0, -12);
  const auto found = block.find();
  ASSERT_TRUE(found);
  EXPECT_LT((found->offset - Eigen::Vector3d(3, -2, 46.9)).norm(), 0.2);
}

TEST(PositionOffset, DoesNotCountWithinTheSigmas) {
  EXPECT_FALSE(OffsetBlock({0, 0, 0}).find());
  EXPECT_FALSE(OffsetBlock({0, 0, 8}, 3).find());
  // What differs from point to point is no offset.
  OffsetBlock bent({0, 0, 1});
  for (std::size_t i = 0; i < 7; ++i) bent.block.control_points[i].position.z() += 0.5 * static_cast<double>(i);
  EXPECT_FALSE(bent.find());
}

// Eighteen positions of an ordinary receiver, 3 m and 6 m, and eight control points. The receiver's errors have a part
// in common, `bias` of the sigmas; the block has its datum from the positions.
struct OrdinaryBlock {
  Block block;
  BlockState state;
  std::vector<FrameIndex> frames;

  OrdinaryBlock(double heights_m, double bias, std::uint64_t seed) {
    SimulationOptions options;
    options.frames = 18;
    options.points_per_frame = 20;
    options.control_points = 8;
    options.control_sigma_m = 0.02;
    options.gps_sigma_m = 0.02;
    options.image_noise_px = 0.5;
    options.seed = seed;
    SimulatedBlock simulated = simulate_block(options);
    block = std::move(simulated.block);
    state = simulated.truth;
    for (Camera& camera : block.cameras) camera.prior_sigma[kFocal] = 0.02 * camera.intrinsics[kFocal];
    const Eigen::Vector3d sigma(3, 3, 6);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    std::vector<Eigen::Vector3d> centres, positions;
    for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
      const double east = normal(random), north = normal(random), up = normal(random);
      const Eigen::Vector3d error =
          sigma.cwiseProduct(Eigen::Vector3d(east, north, up) + Eigen::Vector3d::Constant(bias));
      centres.push_back(state.frames[f].centre);
      positions.push_back(centres.back() + error + Eigen::Vector3d(0, 0, heights_m));
      if (!block.frames[f].position_prior) block.frames[f].position_prior = PositionPrior{};
      block.frames[f].position_prior->position = positions.back();
      block.frames[f].position_prior->sigma = sigma;
      frames.push_back(f);
    }
    const auto by_positions = fit_similarity(centres, positions);
    EXPECT_TRUE(by_positions);
    move_frames(*by_positions, frames, state);
  }
  std::optional<PositionOffset> find() const { return find_position_offset(block, state, frames); }
};

// Many positions place a block better than one of them, as far as their errors have nothing in common.
TEST(PositionOffset, OfHeightsIsFoundByAnOrdinaryReceiver) {
  int found = 0, alarms = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    found += OrdinaryBlock(31, 0, seed).find().has_value();
    for (const double bias : {-1.0, 0.0, 1.0}) alarms += OrdinaryBlock(0, bias, seed).find().has_value();
  }
  EXPECT_GE(found, 180);
  EXPECT_EQ(alarms, 0);
}

TEST(PositionOffset, NeedsThreePointsAndPositionsThatMayMove) {
  OffsetBlock few({0, 0, 46.9});
  few.block.control_points.resize(2);
  EXPECT_FALSE(few.find());
  OffsetBlock held({0, 0, 46.9});
  for (Frame& frame : held.block.frames) frame.position_prior->sigma.setConstant(1e-8);
  EXPECT_FALSE(held.find());
}

// The block moves, the positions stay, and their difference is the start of a shift.
TEST(PositionOffset, BecomesTheShiftOfAllPositions) {
  OffsetBlock block({0, 0, 46.9});
  const FrameIndex seventh(7);
  const PositionPrior before = *block.block.frames[seventh].position_prior;
  const auto found = block.find();
  ASSERT_TRUE(found);
  shift_positions(*found, block.frames, block.block, block.state);
  EXPECT_LT((block.state.frames[seventh].centre - block.truth.frames[seventh].centre).norm(), 0.1);
  const PositionPrior& after = *block.block.frames[seventh].position_prior;
  EXPECT_EQ(after.position, before.position);
  EXPECT_EQ(after.sigma, before.sigma);
  ASSERT_TRUE(block.block.rigs.contains(after.group));
  const Rig& group = block.block.rigs[after.group];
  EXPECT_TRUE(group.is_group());
  EXPECT_EQ(group.mounts.front().pose.centre, found->offset);
  EXPECT_GT(group.mounts.front().position_sigma_m, 100);
  EXPECT_EQ(block.state.mounts[after.group].front().centre, found->offset);
  EXPECT_EQ(after.shifted, (ShiftAxes(0, 0, 1)));
  EXPECT_LT(
      (corrected(after, block.block, RigIndex(0), block.state.mounts).position - (before.position - found->offset))
          .norm(),
      1e-12);
  EXPECT_FALSE(block.find());
  EXPECT_NO_THROW(check(block.block));
}

// Half of the positions have a shift against the others already.
TEST(PositionOffset, AddsToTheShiftOfAGroup) {
  OffsetBlock block({0, 0, 46.9});
  const std::vector<FrameIndex> half(block.frames.begin() + 20, block.frames.end());
  for (const FrameIndex f : half) block.block.frames[f].position_prior->position.z() += 2;
  add_position_group(half, {0, 0, 2}, {0, 0, 1}, block.block, block.state);
  const auto found = block.find();
  ASSERT_TRUE(found);
  shift_positions(*found, block.frames, block.block, block.state);
  for (const FrameIndex f : block.frames) {
    const PositionPrior prior = *block.block.frames[f].position_prior;
    const double expected = f.value < 20 ? 46.9 : 48.9;
    EXPECT_NEAR(block.state.mounts[prior.group].front().centre.z(), expected, 0.1);
  }
}

// The other positions of the group lie in another part of the block, which has not moved.
TEST(PositionOffset, LeavesTheShiftOfAnotherPart) {
  OffsetBlock block({0, 0, 46.9});
  add_position_group(block.frames, {0, 0, 2}, {0, 0, 1}, block.block, block.state);
  const RigIndex before = block.block.frames[FrameIndex(0)].position_prior->group;
  PositionOffset offset;
  offset.offset = {5, 0, 40};
  shift_positions(offset, {block.frames.begin() + 20, block.frames.end()}, block.block, block.state);
  for (const FrameIndex f : block.frames) {
    const PositionPrior& prior = *block.block.frames[f].position_prior;
    const Eigen::Vector3d expected = f.value < 20 ? Eigen::Vector3d(0, 0, 2) : Eigen::Vector3d(5, 0, 42);
    EXPECT_EQ(prior.group == before, f.value < 20);
    EXPECT_EQ(block.state.mounts[prior.group].front().centre, expected);
    EXPECT_EQ(block.block.rigs[prior.group].mounts.front().pose.centre, expected);
    EXPECT_EQ(prior.shifted.x(), f.value < 20 ? 0 : 1);
  }
  EXPECT_GT(block.block.rigs[block.block.frames[FrameIndex(39)].position_prior->group].mounts.front().position_sigma_m,
            400);
  EXPECT_NO_THROW(check(block.block));
}

TEST(PositionOffset, IsSaidInWords) {
  PositionOffset found;
  found.offset = {0, 0, 46.9};
  found.sigma = {0, 0, 0.014};
  found.points = 6;
  EXPECT_THAT(offset_text(found),
              testing::StartsWith("the positions lie 46.90 m above the control points (sigma 0.01 m, "
                                  "6 points): ellipsoidal and orthometric heights, or "
                                  "local control about another origin?"));
  found.offset = {-2, 1.5, -3};
  EXPECT_THAT(offset_text(found),
              testing::StartsWith("the positions lie 2.00 m west of, 1.50 m north of and 3.00 m below the control"));
}

}  // namespace
}  // namespace megablock
