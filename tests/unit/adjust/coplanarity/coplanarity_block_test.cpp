#include "adjust/coplanarity/coplanarity_block.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "io/base/error.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

constexpr double kAttitudeSigma = 1e-3;  // rad

// An aerial block without noise but for the grid of 2^-10 px, its positions and attitudes observed at the truth.
SimulatedBlock exactly_known() {
  SimulationOptions options;
  options.frames = 12;
  options.points_per_frame = 60;
  options.image_noise_px = 0;
  options.calibrate = false;
  SimulatedBlock simulated = simulate_block(options);
  const Eigen::Vector3d lever_arm(0.1, -0.2, 0.3);
  for (FrameIndex f(0); simulated.block.frames.contains(f); ++f.value) {
    Frame& frame = simulated.block.frames[f];
    const Pose& pose = simulated.truth.frames[f];
    frame.position_prior =
        PositionPrior{pose.centre + pose.rotation.conjugate() * lever_arm, Eigen::Vector3d::Constant(0.01), lever_arm};
    frame.attitude_prior = AttitudePrior{pose.rotation, Eigen::Vector3d::Constant(kAttitudeSigma)};
    frame.given_pose.reset();
  }
  simulated.block.rigs[RigIndex(0)].mounts.front().pose = {
      Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized())), {0.2, 0.1, -0.4}};
  // The frames so that the cameras stand where the mount was none.
  const Pose mount = simulated.block.rigs[RigIndex(0)].mounts.front().pose;
  for (FrameIndex f(0); simulated.block.frames.contains(f); ++f.value) {
    Frame& frame = simulated.block.frames[f];
    Pose& pose = simulated.truth.frames[f];
    pose.rotation = (mount.rotation.conjugate() * pose.rotation).normalized();
    pose.centre -= pose.rotation.conjugate() * mount.centre;
    frame.attitude_prior->rotation_cw = pose.rotation;
    frame.position_prior->position = pose.centre + pose.rotation.conjugate() * lever_arm;
  }
  return simulated;
}

double mean_determinant_of(const CoplanarityBlock& block) {
  double sum = 0;
  std::int64_t pairs = 0;
  const CoplanarityNetwork& n = block.network;
  for (std::size_t j = 0; j + 1 < n.begin.size(); ++j)
    for (auto a = static_cast<std::size_t>(n.begin[j]); a < static_cast<std::size_t>(n.begin[j + 1]); ++a)
      for (std::size_t b = a + 1; b < static_cast<std::size_t>(n.begin[j + 1]); ++b, ++pairs) {
        const auto one = static_cast<std::size_t>(n.camera[a]), other = static_cast<std::size_t>(n.camera[b]);
        sum += std::abs(coplanarity_determinant(n.centres[other] - n.centres[one], n.focal_px, n.angles[one],
                                                n.image[a], n.angles[other], n.image[b])
                            .value);
      }
  return sum / static_cast<double>(pairs);
}

TEST(CoplanarityBlock, RaysMeetThroughDistortionMountsAndLeverArms) {
  const SimulatedBlock simulated = exactly_known();
  const CoplanarityBlock block = coplanarity_block(simulated.block, initial_state(simulated.block), {simulated.tracks});
  ASSERT_EQ(block.frames.size(), 12u);
  EXPECT_EQ(block.frames_left_out, 0);
  EXPECT_NEAR(block.angle_sigma_rad, kAttitudeSigma, 1e-15);
  EXPECT_LT(mean_determinant_of(block), 2e-5);  // 2^-11 px at a base of 20 m: 1e-5 m
  for (std::size_t i = 0; i < block.frames.size(); ++i) {
    const Pose pose = block.frame_pose(i, block.network.angles[i]), &truth = simulated.truth.frames[block.frames[i]];
    EXPECT_LT(rotation_angle(pose.rotation, truth.rotation), 1e-12);
    EXPECT_LT((pose.centre - truth.centre).norm(), 1e-10);
  }
}

TEST(CoplanarityBlock, LeavesOutWhatIsNotKnown) {
  SimulatedBlock simulated = exactly_known();
  simulated.block.frames[FrameIndex(0)].attitude_prior.reset();
  simulated.block.frames[FrameIndex(5)].position_prior.reset();
  BlockState start = initial_state(simulated.block);
  const CoplanarityBlock block = coplanarity_block(simulated.block, start, {simulated.tracks});
  EXPECT_EQ(block.frames.size(), 10u);
  EXPECT_EQ(block.frames_left_out, 2);
  EXPECT_EQ(std::count(block.frames.begin(), block.frames.end(), FrameIndex(5)), 0);
  EXPECT_EQ(block.network.point_count() + block.points_left_out, simulated.tracks.track_count());
  EXPECT_NO_THROW(block.network.check());

  // A start gives what was not observed, and does not overrule what was.
  start.frames = simulated.truth.frames;
  for (Pose& pose : start.frames) pose.centre.x() += 1;
  std::fill(start.oriented.begin(), start.oriented.end(), std::uint8_t{1});
  const CoplanarityBlock all = coplanarity_block(simulated.block, start, {simulated.tracks});
  ASSERT_EQ(all.frames.size(), 12u);
  const auto shift = [&](std::size_t i) {
    return (all.frame_pose(i, all.network.angles[i]).centre - simulated.truth.frames[all.frames[i]].centre).norm();
  };
  EXPECT_NEAR(shift(0), 0, 1e-9);
  EXPECT_NEAR(shift(5), 1, 1e-9);
}

TEST(CoplanarityBlock, RefusesWhatItCannotUse) {
  SimulatedBlock simulated = exactly_known();
  for (Frame& frame : simulated.block.frames) frame.attitude_prior.reset();
  EXPECT_THROW(coplanarity_block(simulated.block, initial_state(simulated.block), {simulated.tracks}), InputError);
  SimulationOptions street = SimulationOptions::of(SimulationOptions::Scene::kStreet, SimulationOptions::Path::kS);
  street.frames = 6;
  street.attitude_sigma_deg = 0.1;
  const SimulatedBlock rig = simulate_block(street);
  EXPECT_THROW(coplanarity_block(rig.block, initial_state(rig.block), {rig.tracks}), InputError);
}

}  // namespace
}  // namespace megablock
