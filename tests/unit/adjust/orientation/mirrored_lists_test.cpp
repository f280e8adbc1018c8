// A simulated aerial block with right lists, and with lists in which east and north are exchanged.
#include "adjust/orientation/mirrored_lists.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "adjust/orientation/control_alignment.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

void exchange(Eigen::Vector3d& position) { std::swap(position.x(), position.y()); }

// `state` lies in the ground frame, `free` in the model of the images.
struct ListedBlock {
  Block block;
  BlockState state, free;
  std::vector<FrameIndex> frames;

  explicit ListedBlock(std::uint64_t seed) {
    SimulationOptions options;
    options.frames = 40;
    options.points_per_frame = 20;
    options.control_points = 8;
    options.image_noise_px = 0.5;
    options.gps_sigma_m = 0.05;
    options.seed = seed;
    SimulatedBlock simulated = simulate_block(options);
    block = std::move(simulated.block);
    state = free = simulated.truth;
    for (FrameIndex f(0); block.frames.contains(f); ++f.value) frames.push_back(f);
    Similarity to_model;
    to_model.scale = 0.03;
    to_model.rotation = rotation_exp<double>({0.4, -1.1, 2.0});
    to_model.translation = {100, -2000, 300};
    move_frames(to_model, frames, free);
    // The heights of a flight differ by metres, and tell a list from its mirror image.
    for (const FrameIndex f : frames) {
      if (!block.frames[f].position_prior) continue;
      const double bump = 3 * std::sin(1.7 * static_cast<double>(f.value));
      block.frames[f].position_prior->position = state.frames[f].centre + Eigen::Vector3d(0, 0, bump);
      free.frames[f].centre = to_model(block.frames[f].position_prior->position);
    }
  }
  void exchange_control() {
    for (ControlPoint& point : block.control_points) exchange(point.position);
  }
  void exchange_positions() {
    for (Frame& frame : block.frames)
      if (frame.position_prior) exchange(frame.position_prior->position);
  }
};

TEST(MirroredLists, RightListsStay) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const ListedBlock block(seed);
    EXPECT_FALSE(find_mirrored_control(block.block, block.state, block.frames, true)) << seed;
    EXPECT_FALSE(find_mirrored_control(block.block, block.free, block.frames, false)) << seed;
    EXPECT_FALSE(find_mirrored_positions(block.block, block.free, block.frames)) << seed;
  }
}

TEST(MirroredLists, ExchangedControlIsFoundBesidePositions) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    ListedBlock block(seed);
    block.exchange_control();
    const auto found = find_mirrored_control(block.block, block.state, block.frames, true);
    ASSERT_TRUE(found) << seed;
    EXPECT_EQ(found->reflection, Reflection::kExchanged);
    EXPECT_LT(found->mirrored_m, 1) << seed;
    EXPECT_THAT(mirrored_control_text(*found, true),
                testing::AllOf(testing::StartsWith("the control points fit with x and y exchanged (to 0."),
                               testing::HasSubstr(" m): are east and north exchanged in the list? They do not place "
                                                  "the block, and count as check points;")));
    leave_out_control(block.block);
    for (const ControlPoint& point : block.block.control_points) EXPECT_EQ(point.role, PointRole::kCheck);
  }
}

TEST(MirroredLists, ExchangedPositionsAreFound) {
  ListedBlock block(3);
  block.exchange_positions();
  const auto found = find_mirrored_positions(block.block, block.free, block.frames);
  ASSERT_TRUE(found);
  EXPECT_THAT(mirrored_positions_text(*found),
              testing::AllOf(testing::StartsWith("the positions fit with x and y exchanged (to 0."),
                             testing::HasSubstr("or has one of them the wrong sign? They are left out")));
  leave_out_positions(block.frames, block.block);
  for (const Frame& frame : block.block.frames) EXPECT_FALSE(frame.position_prior);
  EXPECT_FALSE(find_mirrored_positions(block.block, block.free, block.frames));
}

// Held positions and those of a group with a shift give the block its place in any case.
TEST(MirroredLists, HeldPositionsStay) {
  ListedBlock block(3);
  block.exchange_positions();
  block.block.frames[FrameIndex(1)].position_prior->sigma.setConstant(1e-8);
  EXPECT_FALSE(find_mirrored_positions(block.block, block.free, block.frames));
}

}  // namespace
}  // namespace megablock
