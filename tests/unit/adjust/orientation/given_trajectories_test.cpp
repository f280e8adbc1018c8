#include "adjust/orientation/given_trajectories.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "adjust/tile/tile_adjustment.h"
#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/simulate/streets/drive.h"

namespace megablock {
namespace {

constexpr double kTieSigma = 0.01, kTurnSigma = 0.05 * kDegree, kPositionSigma = 0.5;

// A drive of `frames` frames, 4 m each, round and round a bend of 500 m; relative poses and every second position with
// errors. Its given poses are the relative ones, integrated from a pose 2 m off.
struct Drive {
  Block block;
  BlockState truth, given;

  explicit Drive(int frames, unsigned seed = 7) {
    std::mt19937 random(seed);
    std::normal_distribution<double> gauss;
    const auto normal3 = [&] { return Eigen::Vector3d(gauss(random), gauss(random), gauss(random)); };
    block.rigs.push_back({"rig", {Mount()}});
    for (int f = 0; f < frames; ++f) {
      const double turn = 4.0 * f / 500;
      const Pose pose{rotation_exp<double>({0, 0, turn}) * rotation_exp<double>({0.02 * std::sin(0.1 * f), 0, 0}),
                      {500 * std::sin(turn), 500 * std::cos(turn), 2 * std::sin(0.02 * f)}};
      Frame frame;
      frame.rig = RigIndex(0);
      if (f % 2 == 0) {
        PositionPrior prior;
        prior.lever_arm = {0.1, -0.6, -0.2};
        prior.sigma.setConstant(kPositionSigma);
        prior.position = pose.centre + pose.rotation.conjugate() * prior.lever_arm + kPositionSigma * normal3();
        frame.position_prior = prior;
      }
      block.frames.push_back(frame);
      truth.frames.push_back(pose);
      truth.oriented.push_back(1);
    }
    given = truth;
    Pose here = truth.frames.front();
    here.centre += Eigen::Vector3d(1, 1, -1.4);
    given.frames.front() = here;
    for (int f = 0; f + 1 < frames; ++f) {
      const Pose &a = truth.frames[FrameIndex(f)], &b = truth.frames[FrameIndex(f + 1)];
      const Pose tie{rotation_exp<double>(kTurnSigma * normal3()) * b.rotation * a.rotation.conjugate(),
                     a.rotation * (b.centre - a.centre) + kTieSigma * normal3()};
      block.relative_poses.push_back({FrameIndex(f), FrameIndex(f + 1), tie, kTurnSigma, kTieSigma});
      here.centre += here.rotation.conjugate() * tie.centre;
      here.rotation = (tie.rotation * here.rotation).normalized();
      given.frames[FrameIndex(f + 1)] = here;
    }
  }

  double largest_error(const BlockState& state) const {
    double largest = 0;
    for (FrameIndex f(0); truth.frames.contains(f); ++f.value)
      largest = std::max(largest, (state.frames[f].centre - truth.frames[f].centre).norm());
    return largest;
  }
};

bool same(const BlockState& a, const BlockState& b) {
  return std::equal(a.frames.begin(), a.frames.end(), b.frames.begin(), [](const Pose& p, const Pose& q) {
    return p.centre == q.centre && p.rotation.coeffs() == q.rotation.coeffs();
  });
}

// The same observations without any tie point, by Ceres.
BlockState by_ceres(const Drive& drive, const BlockState& start) {
  TileProblem problem;
  problem.begin.push_back(0);
  TileState state;
  for (FrameIndex f(0); drive.block.frames.contains(f); ++f.value) {
    const LocalFrame local(static_cast<std::int32_t>(f.value));
    problem.frames.push_back(f);
    problem.reference_of_frame.emplace_back(Eigen::Vector3d::Zero());
    state.frames.push_back(start.frames[f]);
    if (drive.block.frames[f].position_prior)
      problem.positions.push_back({local, *drive.block.frames[f].position_prior});
  }
  for (const RelativePose& tie : drive.block.relative_poses)
    problem.relatives.push_back({LocalFrame(static_cast<std::int32_t>(tie.from.value)),
                                 LocalFrame(static_cast<std::int32_t>(tie.to.value)), tie.pose, tie.rotation_sigma_rad,
                                 tie.position_sigma_m});
  problem.position_loss = problem.relative_loss = {RobustLoss::Kind::kCauchy, 3};
  EXPECT_TRUE(solve_with_ceres(problem, state, 100, 1e-14).usable);
  BlockState result = start;
  for (FrameIndex f(0); result.frames.contains(f); ++f.value)
    result.frames[f] = state.frames[static_cast<std::size_t>(f.value)];
  return result;
}

TEST(GivenTrajectories, AnIntegratedDriveComesToItsPositions) {
  const Drive drive(20000);
  BlockState state = drive.given;
  EXPECT_GT(drive.largest_error(state), 100);  // what the test is about
  const GivenTrajectoryChange change = adjust_trajectories(drive.block, {}, state);
  EXPECT_EQ(change.trajectories, 1);
  EXPECT_EQ(change.frames, 20000);
  EXPECT_GT(change.largest_m, 100);
  EXPECT_LT(drive.largest_error(state), 1);  // 0.5 m of single positions
}

TEST(GivenTrajectories, AgreesWithCeres) {
  const Drive drive(600);  // of three pieces
  BlockState state = drive.given;
  adjust_trajectories(drive.block, {}, state);
  const BlockState reference = by_ceres(drive, state);
  for (FrameIndex f(0); state.frames.contains(f); ++f.value) {
    EXPECT_LT((state.frames[f].centre - reference.frames[f].centre).norm(), 0.01) << f.value;
    EXPECT_LT(rotation_angle(state.frames[f].rotation, reference.frames[f].rotation), 0.02 * kDegree) << f.value;
  }
}

TEST(GivenTrajectories, PosesThatAgreeStayToTheBit) {
  const Drive drive(1000);
  BlockState state = drive.truth;
  EXPECT_EQ(adjust_trajectories(drive.block, {}, state).frames, 0);
  EXPECT_TRUE(same(state, drive.truth));
}

TEST(GivenTrajectories, WithoutPositionsNothingMoves) {
  Drive drive(1000);
  ObservationOptions without;
  without.use_position_priors = false;
  BlockState state = drive.given;
  EXPECT_EQ(adjust_trajectories(drive.block, without, state).frames, 0);
  for (Frame& frame : drive.block.frames) frame.position_prior.reset();
  EXPECT_EQ(adjust_trajectories(drive.block, {}, state).frames, 0);
  EXPECT_TRUE(same(state, drive.given));
}

TEST(GivenTrajectories, GrossErrorsOfPositionsAreForgotten) {
  Drive drive(4000);
  for (int f = 100; f < 4000; f += 100) drive.block.frames[FrameIndex(f)].position_prior->position.x() += 100;
  BlockState state = drive.given;
  EXPECT_EQ(adjust_trajectories(drive.block, {}, state).frames, 4000);
  EXPECT_LT(drive.largest_error(state), 1);
}

TEST(GivenTrajectories, OrderAndDirectionOfRelativePosesDoNotMatter) {
  Drive drive(1000);
  BlockState forward = drive.given, mixed = drive.given;
  adjust_trajectories(drive.block, {}, forward);
  std::vector<RelativePose>& ties = drive.block.relative_poses;
  // Also a few ties over two frames, which chains do without.
  ties.push_back(ties[10]);
  ties.back().to = FrameIndex(12);
  ties.back().pose = {ties[11].pose.rotation * ties[10].pose.rotation,
                      ties[10].pose.centre + ties[10].pose.rotation.conjugate() * ties[11].pose.centre};
  std::mt19937 random(3);
  std::shuffle(ties.begin(), ties.end(), random);
  EXPECT_EQ(adjust_trajectories(drive.block, {}, mixed).frames, 1000);
  EXPECT_TRUE(same(forward, mixed));
  for (RelativePose& tie : ties) {
    if (tie.from.value % 3 != 0) continue;
    std::swap(tie.from, tie.to);
    tie.pose = {tie.pose.rotation.conjugate(), -(tie.pose.rotation * tie.pose.centre)};
  }
  BlockState turned = drive.given;
  EXPECT_EQ(adjust_trajectories(drive.block, {}, turned).frames, 1000);
  for (FrameIndex f(0); turned.frames.contains(f); ++f.value)
    EXPECT_LT((turned.frames[f].centre - forward.frames[f].centre).norm(), 1e-3) << f.value;
}

TEST(GivenTrajectories, ARingIsATrajectoryToo) {
  Drive drive(200);
  drive.block.relative_poses.push_back(
      {FrameIndex(199), FrameIndex(0),
       Pose{drive.truth.frames[FrameIndex(0)].rotation * drive.truth.frames[FrameIndex(199)].rotation.conjugate(),
            drive.truth.frames[FrameIndex(199)].rotation *
                (drive.truth.frames[FrameIndex(0)].centre - drive.truth.frames[FrameIndex(199)].centre)},
       kTurnSigma, kTieSigma});
  for (Pose& pose : drive.given.frames) pose.centre.x() += 50;
  BlockState state = drive.given;
  EXPECT_EQ(adjust_trajectories(drive.block, {}, state).frames, 200);
  EXPECT_LT(drive.largest_error(state), 1);
}

TEST(GivenTrajectories, FramesWithoutPoseDivideATrajectory) {
  Drive drive(300);
  drive.given.oriented[FrameIndex(150)] = 0;
  BlockState state = drive.given;
  for (Pose& pose : state.frames) pose.centre.y() += 30;
  const Pose left = state.frames[FrameIndex(150)];
  const GivenTrajectoryChange change = adjust_trajectories(drive.block, {}, state);
  EXPECT_EQ(change.trajectories, 2);
  EXPECT_EQ(change.frames, 299);
  EXPECT_EQ(state.frames[FrameIndex(150)].centre, left.centre);
}

}  // namespace
}  // namespace megablock
