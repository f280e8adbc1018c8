#include "adjust/registration/rig_estimate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "adjust/registration/four_frames.h"
#include "adjust/registration/trajectory.h"
#include "geometry/numbers/angles.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

SimulatedBlock make_block(bool calibrate) {
  SimulationOptions options = SimulationOptions::of(SimulationOptions::Scene::kStereopolis);
  options.frames = 96;
  options.street_spacing_m = 60;
  options.points_per_frame = 150;
  options.rig_cameras = 4;
  options.drift_per_frame_m = 0.05;
  options.calibrate = calibrate;
  return simulate_block(options);
}

RigEstimateOptions few_windows() {
  RigEstimateOptions options;
  options.windows = 4;
  return options;
}

// rms over the mounts but the first, about each axis.
double mount_error_deg(const IndexedVector<RigIndex, std::vector<Pose>>& mounts, const SimulatedBlock& s) {
  double sum = 0;
  const std::vector<Pose>& truth = s.truth.mounts.front();
  for (std::size_t m = 1; m < truth.size(); ++m)
    sum += std::pow(rotation_angle(mounts[RigIndex(0)][m].rotation, truth[m].rotation), 2) / 3;
  return std::sqrt(sum / static_cast<double>(truth.size() - 1)) / kDegree;
}

// Mounts off by 5 mm and 0.5 degrees, a laboratory's calibration, 3 % wrong matches: what 2x2 registration wants is a
// hundredth of a degree.
TEST(RigEstimate, FindsTheMountsFromTheChain) {
  const SimulatedBlock s = make_block(true);
  ASSERT_TRUE(has_free_rig(s.block));
  const Trajectory trajectory = trajectory_of(s.block, {});
  const RigEstimate estimate = estimate_rig(s.block, trajectory.input, s.tracks, few_windows());
  const double before = mount_error_deg(initial_state(s.block).mounts, s), after = mount_error_deg(estimate.mounts, s);
  std::printf(
      "%ld observations in %ld frames, median residual %.2f px before, %.2f px after; mounts off by %.3f degrees "
      "before, %.4f after\n",
      estimate.observations, estimate.frames, estimate.median_before_px, estimate.median_after_px, before, after);
  EXPECT_EQ(estimate.kept_as_given, "");
  EXPECT_EQ(estimate.frames, 96);
  EXPECT_GT(before, 0.25);
  EXPECT_LT(after, 0.03);
  // The length of two normal residuals of 0.5 px has the median 0.59 px, less what the points take up.
  EXPECT_LT(estimate.median_after_px, 0.6);
  EXPECT_GT(estimate.median_before_px, 1);
}

TEST(RigEstimate, IsTheSameEveryTime) {
  const SimulatedBlock s = make_block(true);
  const Trajectory trajectory = trajectory_of(s.block, {});
  RigEstimateOptions options = few_windows();
  options.windows = 1;
  const RigEstimate a = estimate_rig(s.block, trajectory.input, s.tracks, options),
                    b = estimate_rig(s.block, trajectory.input, s.tracks, options);
  EXPECT_EQ(a.mounts[RigIndex(0)][2].rotation.coeffs(), b.mounts[RigIndex(0)][2].rotation.coeffs());
  EXPECT_EQ(a.median_after_px, b.median_after_px);
}

TEST(RigEstimate, StaysAsGivenWithoutEnoughToEstimateFrom) {
  const SimulatedBlock s = make_block(true);
  Trajectory trajectory = trajectory_of(s.block, {});
  trajectory.input.chain.clear();
  const RigEstimate estimate = estimate_rig(s.block, trajectory.input, s.tracks, few_windows());
  EXPECT_THAT(estimate.kept_as_given, testing::HasSubstr("no 24 successive frames of a pass share tracks"));
  EXPECT_EQ(estimate.mounts[RigIndex(0)][1].rotation.coeffs(), s.block.rigs.front().mounts[1].pose.rotation.coeffs());
}

TEST(RigEstimate, AHeldRigIsNotAskedFor) { EXPECT_FALSE(has_free_rig(make_block(false).block)); }

// The passes of a trajectory that is listed backwards are linked as those of the same listed forwards.
TEST(Trajectory, LinksAPassListedBackwards) {
  SimulatedBlock s = make_block(false);
  const Trajectory forwards = trajectory_of(s.block, {});
  for (RelativePose& r : s.block.relative_poses) std::swap(r.from, r.to), r.pose = relative_to(r.pose, Pose{});
  const Trajectory backwards = trajectory_of(s.block, {});
  ASSERT_EQ(backwards.input.chain.size(), forwards.input.chain.size());
  for (std::size_t i = 0; i < backwards.input.chain.size(); ++i) {
    const ChainLink &link = backwards.input.chain[i], &known = forwards.input.chain[i];
    EXPECT_LT((link.pose.centre - known.pose.centre).norm(), 1e-12);
    EXPECT_LT(rotation_angle(link.pose.rotation, known.pose.rotation), 1e-7);
  }
}

TEST(Trajectory, LinksNothingOverGapsOfTimeOrPlace) {
  SimulatedBlock s = make_block(false);
  s.block.relative_poses.clear();
  const std::size_t links = trajectory_of(s.block, {}).input.chain.size();
  for (std::int64_t f = 20; f < 48; ++f) s.block.frames[FrameIndex(f)].time_s += 600;
  for (std::int64_t f = 60; f < 96; ++f) s.block.frames[FrameIndex(f)].given_pose->centre.x() += 500;
  const Trajectory broken = trajectory_of(s.block, {});
  EXPECT_EQ(broken.input.chain.size(), links - 2);
  ASSERT_EQ(broken.notes.size(), 2u);
  EXPECT_THAT(broken.notes[0], testing::HasSubstr("s between frames 'f000019' and 'f000020': not linked"));
  EXPECT_THAT(broken.notes[1], testing::HasSubstr("between frames 'f000059' and 'f000060': not linked"));
}

}  // namespace
}  // namespace megablock
