#include "adjust/registration/joint_adjustment.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "io/base/error.h"
#include "tests/support/adjust/town.h"

namespace megablock {
namespace {

TEST(JointAdjustment, RegistrationsTakeTheDriftAway) {
  const Town town = make_town({});
  const JointResult result = adjust_jointly(town.input, {});
  std::printf(
      "%zu frames, %zu registrations: %.3f m before, %.3f m after; where passes meet %.3f m before, %.4f m after\n",
      town.truth.size(), town.wrong.size(), rms_error(town, town.input.start), rms_error(town, result.frames),
      relative_error(town, town.input.start), relative_error(town, result.frames));
  EXPECT_GT(rms_error(town, town.input.start), 1);
  EXPECT_LT(rms_error(town, result.frames), 0.1);
  EXPECT_LT(relative_error(town, result.frames), 0.01);
  // Masked positions have lost their say, those under a clear sky have kept it.
  double masked = 0, clear = 0, masked_count = 0, clear_count = 0;
  for (std::size_t f = 0; f < town.masked.size(); ++f)
    (town.masked[f] ? masked : clear) += result.position_weight[f], (town.masked[f] ? masked_count : clear_count) += 1;
  EXPECT_LT(masked / masked_count, 0.3);
  EXPECT_GT(clear / clear_count, 0.6);
}

// CN-28: 5 % wrong registrations do not move the result by more than its sigma.
TEST(JointAdjustment, WrongRegistrationsDoNotMatter) {
  TownOptions options;
  options.wrong_share = 0.05;
  const Town town = make_town(options);
  JointInput right = town.input;
  for (std::size_t i = town.wrong.size(); i-- > 0;)
    if (town.wrong[i]) right.registrations.erase(right.registrations.begin() + static_cast<std::ptrdiff_t>(i));
  ASSERT_LT(right.registrations.size(), town.input.registrations.size());
  JointOptions joint;
  for (std::int64_t f = 0; f < static_cast<std::int64_t>(town.truth.size()); f += 37)
    joint.covariance_of.emplace_back(f);
  const JointResult with = adjust_jointly(town.input, joint), without = adjust_jointly(right, joint);
  double largest = 0;
  for (std::size_t i = 0; i < joint.covariance_of.size(); ++i) {
    const auto f = static_cast<std::size_t>(joint.covariance_of[i].value);
    const double sigma = std::sqrt(without.covariances[i].bottomRightCorner<3, 3>().trace());
    largest = std::max(largest, (with.frames[f].centre - without.frames[f].centre).norm() / sigma);
  }
  std::printf("moved by %.3f of its sigma at most\n", largest);
  EXPECT_LT(largest, 1);
  for (std::size_t i = 0; i < town.wrong.size(); ++i) {
    if (town.wrong[i]) {
      EXPECT_LT(with.registration_weight[i], 0.05) << i;
    }
  }
  JointOptions trusting = joint;
  trusting.covariance_of.clear();
  trusting.robust_registrations = false;
  EXPECT_GT(relative_error(town, adjust_jointly(town.input, trusting).frames), 0.1) << "they do without robust weights";
}

// CN-23, CN-29, CN-30: sparse resections or control measured along the path fix the chain.
TEST(JointAdjustment, ControlAlongThePath) {
  Town town = make_town({});
  town.input.registrations.clear();
  JointOptions options;
  options.use_positions = false;
  JointInput with_resections = town.input;
  for (std::size_t f = 10; f < town.truth.size(); f += 100) {
    Matrix6 covariance = Matrix6::Identity() * 1e-4 * 1e-4;
    covariance.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() * 0.01 * 0.01;
    with_resections.resections.push_back({FrameIndex(static_cast<std::int64_t>(f)), town.truth[f], covariance});
  }
  const double resected = rms_error(town, adjust_jointly(with_resections, options).frames);
  Noise noise(3);
  JointInput with_points = town.input;
  for (std::size_t f = 10; f + 1 < town.truth.size(); f += 100)
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d place =
          town.truth[f].centre + Eigen::Vector3d(noise.uniform(-12, 12), noise.uniform(-12, 12), noise.uniform(-2, 3));
      PathPoint point{true, place + 0.01 * noise.triple(), Eigen::Vector3d::Constant(0.01), {}};
      for (const std::size_t g : {f, f + 1})
        if (const auto seen = street_rig().see(to_inside(town.truth[g], place)))
          point.views.push_back(
              {FrameIndex(static_cast<std::int64_t>(g)), street_rig().ray(*seen, 0.5 * noise.pair()), 0.5});
      with_points.points.push_back(point);
    }
  const double measured = rms_error(town, adjust_jointly(with_points, options).frames);
  std::printf("chain with resections %.3f m, with measured control %.3f m\n", resected, measured);
  EXPECT_LT(resected, 0.5 * rms_error(town, town.input.start)) << "published: half";
  EXPECT_LT(measured, 0.5 * rms_error(town, town.input.start));
}

// An exact chain in ground axes and one known frame reproduce the truth.
TEST(JointAdjustment, ChainInGroundAxesFromOneFrame) {
  TownOptions options;
  options.passes = 1;
  const Town town = make_town(options);
  JointInput input = town.input;
  for (ChainLink& link : input.chain) {
    const auto a = static_cast<std::size_t>(link.from.value), b = static_cast<std::size_t>(link.to.value);
    link.in_ground = true;
    link.pose = {(town.truth[b].rotation * town.truth[a].rotation.conjugate()).normalized(),
                 town.truth[b].centre - town.truth[a].centre};
  }
  input.registrations.clear();
  input.resections = {{FrameIndex(0), town.truth[0], Matrix6::Identity() * 1e-10}};
  JointOptions joint;
  joint.use_positions = joint.use_attitudes = false;
  EXPECT_LT(rms_error(town, adjust_jointly(input, joint).frames), 1e-4);
}

TEST(JointAdjustment, RefusesAnInputThatContradictsItself) {
  Town town = make_town({.streets = 2, .passes = 1});
  town.input.chain[0].to = FrameIndex(100000);
  EXPECT_THROW(adjust_jointly(town.input, {}), InputError);
}

}  // namespace
}  // namespace megablock
