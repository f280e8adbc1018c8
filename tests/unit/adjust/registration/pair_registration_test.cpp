#include "adjust/registration/pair_registration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>

#include "tests/support/adjust/crossing.h"

namespace megablock {
namespace {

using testing::HasSubstr;

// CN-25: 2 m of drift, 30 % wrong matches; 93.3 % of the feasible places converge in the source.
TEST(PairRegistration, FeasiblePlacesConverge) {
  int feasible = 0, converged = 0, published = 0;
  double normalised = 0, accepted = 0;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    CrossingOptions options;
    options.points = 30 + 7 * static_cast<int>(seed % 10);
    const Crossing crossing = make_crossing(seed, options);
    const PairRegistration r = register_pair(crossing.trajectory, crossing.tracks, {}, seed);
    if (r.accepted) {
      const Pose truth = crossing.true_relative();
      Eigen::Matrix<double, 6, 1> error;
      error << rotation_log<double>(truth.rotation * r.relative.rotation.conjugate()), truth.centre - r.relative.centre;
      normalised += error.dot(r.covariance.inverse() * error) / 6;
      ++accepted;
    }
    if (!is_feasible(crossing)) continue;
    PairRegistrationOptions as_published;
    as_published.robust_start = false;
    const PairRegistration p = register_pair(crossing.trajectory, crossing.tracks, as_published, seed);
    ++feasible;
    converged += r.accepted && errors_of(r.relative, crossing).good();
    published += p.accepted && errors_of(p.relative, crossing).good();
  }
  std::printf("%d of 100 feasible, %d of them within 2 cm and 0.02 degrees; with the published start %d\n", feasible,
              converged, published);
  EXPECT_GE(feasible, 40);
  EXPECT_GE(converged, 0.98 * feasible);
  EXPECT_GE(converged, published);
  EXPECT_GT(normalised / accepted, 0.7) << "chi-square / 6: the covariance is true";
  EXPECT_LT(normalised / accepted, 1.3);
}

PairRegistration registration_of(const CrossingOptions& options, std::uint64_t seed) {
  const Crossing crossing = make_crossing(seed, options);
  return register_pair(crossing.trajectory, crossing.tracks, {}, seed);
}

TEST(PairRegistration, RefusesAndNamesWhatIsMissing) {
  CrossingOptions few;
  few.points = 5;
  EXPECT_EQ(registration_of(few, 1).reason, "5 points are seen in 4 of the four frames, 6 are needed");
  CrossingOptions wrong;
  wrong.wrong_share = 1;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const PairRegistration r = registration_of(wrong, seed);
    EXPECT_FALSE(r.accepted) << seed;
    EXPECT_FALSE(r.reason.empty());
  }
  PairRegistrationOptions strict;
  strict.max_position_sigma_m = 1e-4;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const Crossing crossing = make_crossing(seed, {});
    const PairRegistration r = register_pair(crossing.trajectory, crossing.tracks, strict, seed);
    EXPECT_THAT(r.reason, testing::HasSubstr("the points give the pose to")) << seed;
    EXPECT_FALSE(r.accepted);
  }
}

TEST(PairRegistration, RefusesAPlaceFarFromTheTrajectory) {
  CrossingOptions far;
  far.trajectory_error_m = 25;
  EXPECT_THAT(registration_of(far, 3).reason, HasSubstr("off the trajectory"));
}

// A chimney row matched one step further is a consistent, wrong place: what is right must outvote it.
TEST(PairRegistration, OutvotesARepeatedFacade) {
  CrossingOptions options;
  options.wrong_share = 0;
  const Crossing crossing = make_crossing(8, options);
  CrossingOptions shifted = options;
  shifted.points = 25;
  Crossing repeated = make_crossing(8, shifted);  // the same frames
  // Observations of the second pass as if it stood 3 m further on.
  const Pose moved = {repeated.truth[2].rotation, repeated.truth[2].centre + Eigen::Vector3d(3, 0, 0)};
  const Pose between = relative_to(repeated.truth[2], moved);
  std::vector<FourFrameTrack> tracks = crossing.tracks;
  for (FourFrameTrack track : repeated.tracks) {
    for (FourFrameTrack::View& view : track.views)
      if (view.frame >= 2) view.ray.origin -= between.centre;
    tracks.push_back(track);
  }
  const PairRegistration r = register_pair(crossing.trajectory, tracks, {}, 1);
  ASSERT_TRUE(r.accepted) << r.reason;
  EXPECT_LT(errors_of(r.relative, crossing).position_m, 0.03);
}

// CN-24: what intersecting twice and fitting gives.
TEST(PairRegistration, PointsToPointsAreWorse) {
  double two_by_two = 0, three_d = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Crossing crossing = make_crossing(seed, {});
    const auto baseline = register_3d_3d(crossing.trajectory, crossing.tracks, seed);
    ASSERT_TRUE(baseline);
    three_d += errors_of(*baseline, crossing).position_m / 20;
    two_by_two +=
        errors_of(register_pair(crossing.trajectory, crossing.tracks, {}, seed).relative, crossing).position_m / 20;
  }
  std::printf("mean error 2x2 %.4f m, 3-D/3-D %.3f m\n", two_by_two, three_d);
  EXPECT_LT(5 * two_by_two, three_d);
}

}  // namespace
}  // namespace megablock
