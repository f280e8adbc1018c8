// The halves of a split test: tracks are divided, priors are drawn so that both halves are independent.
#include "adjust/problem/half.h"

#include <gtest/gtest.h>

#include <cmath>

#include "adjust/terms/build_problem.h"
#include "geometry/transform/rotation.h"
#include "io/block/held_priors.h"
#include "io/simulate/blocks/simulate.h"

namespace megablock {
namespace {

TEST(Half, EveryTrackIsInOneHalfTogetherWithThoseOfItsImage) {
  int first = 0, again = 0;
  for (ImageIndex image(0); image.value < 10000; ++image.value) {
    const bool one = takes_track({Half::kTiePoints1}, image);
    EXPECT_NE(one, takes_track({Half::kTiePoints2}, image));
    const ImageIndex before(image.value - 1), after(image.value + 1);
    if (image.value % 2 == 1) {
      EXPECT_NE(one, takes_track({Half::kTiePoints1}, before));
      EXPECT_NE(takes_track({Half::kTiePoints1, 1}, image), takes_track({Half::kTiePoints1, 1}, after));
    }
    EXPECT_TRUE(takes_track({Half::kNone}, image) && takes_track({Half::kImages1}, image));
    first += one && image.value % 2 == 0;
    again += one == takes_track({Half::kTiePoints1, 1}, image) && image.value % 2 == 0;
  }
  EXPECT_NEAR(first, 2500, 142);  // of 5 000 pairs: four sigmas of a fair coin
  EXPECT_NEAR(again, 2500, 142);  // a further division is independent of it
}

TEST(Half, ImagesAreDividedByRigInTheirOrder) {
  Block block;
  for (int rig = 0; rig < 2; ++rig) block.rigs.push_back({});
  for (const int rig : {0, 0, 1, 0, 1, 0, 0}) {
    Frame frame;
    frame.rig = RigIndex(rig);
    block.frames.push_back(frame);
  }
  EXPECT_TRUE(frames_of_half(block, Half::kTiePoints1).empty());
  EXPECT_EQ(frames_of_half(block, Half::kImages1), (std::vector<std::uint8_t>{1, 1, 1, 1, 0, 0, 0}));
  EXPECT_EQ(frames_of_half(block, Half::kImages2), (std::vector<std::uint8_t>{0, 0, 0, 0, 1, 1, 1}));
}

class HalfOfABlock : public testing::Test {
 protected:
  static SimulationOptions scene() {
    SimulationOptions options;
    options.frames = 400;
    options.points_per_frame = 20;
    options.control_points = 30;
    options.attitude_sigma_deg = 0.1;
    return options;
  }
  HalfOfABlock() : simulated_(simulate_block(scene())) {}
  TileProblem problem(Half half) const {
    ObservationOptions options;
    options.half.half = half;
    return make_tile_problem(simulated_.block, simulated_.truth, single_tile(simulated_.block), TileIndex(0),
                             simulated_.tracks, options);
  }
  SimulatedBlock simulated_;
};

TEST_F(HalfOfABlock, ObservationsAreDivided) {
  const TileProblem all = problem(Half::kNone), one = problem(Half::kTiePoints1), other = problem(Half::kTiePoints2);
  ASSERT_EQ(one.kept.size(), all.kept.size());
  for (std::size_t p = 0; p < all.points.size(); ++p)
    for (std::int64_t row = all.begin[p]; row < all.begin[p + 1]; ++row) {
      const auto o = static_cast<std::size_t>(row);
      if (all.points[p].role == PointRole::kTie) {
        EXPECT_EQ(one.kept[o] + other.kept[o], 1);
        EXPECT_EQ(one.image[o].valid(), one.kept[o] != 0);  // screening cannot bring it back
        EXPECT_EQ(one.x[o], all.x[o]);
      } else {
        EXPECT_EQ(one.kept[o] + other.kept[o], 2);
        EXPECT_NEAR(one.x[o] + other.x[o], 2 * all.x[o], 1e-9);
        EXPECT_NEAR(one.inverse_sigma[o], all.inverse_sigma[o] / std::sqrt(2), 1e-12);
      }
    }
}

// The true values are known: the errors of both halves have the stated sigmas, and do not depend on each other.
TEST_F(HalfOfABlock, PriorsAreIndependent) {
  const TileProblem one = problem(Half::kTiePoints1), other = problem(Half::kTiePoints2);
  double squares = 0, products = 0, turns = 0;
  int count = 0;
  ASSERT_EQ(one.positions.size(), 400u);
  for (std::size_t i = 0; i < one.positions.size(); ++i) {
    const auto& a = one.positions[i].prior;
    const auto& b = other.positions[i].prior;
    const FrameIndex frame = one.frames[static_cast<std::size_t>(one.positions[i].frame.value)];
    const Eigen::Vector3d truth =
        simulated_.truth.frames[frame].centre + simulated_.truth.frames[frame].rotation.conjugate() * a.lever_arm;
    EXPECT_NEAR(a.sigma.x(), std::sqrt(2) * simulated_.block.frames[frame].position_prior->sigma.x(), 1e-12);
    for (int k = 0; k < 3; ++k) {
      const double x = (a.position[k] - truth[k]) / a.sigma[k], y = (b.position[k] - truth[k]) / b.sigma[k];
      squares += x * x + y * y;
      products += x * y;
      ++count;
    }
    const auto& t = one.attitudes[i].prior;
    const Eigen::Vector3d w = rotation_log<double>(t.rotation_cw * simulated_.truth.frames[frame].rotation.conjugate());
    turns += w.cwiseQuotient(t.sigma_rad).squaredNorm();
  }
  // 1 200 numbers each: four sigmas are 0.12.
  EXPECT_NEAR(squares / (2 * count), 1, 0.12);
  EXPECT_NEAR(products / count, 0, 0.12);
  EXPECT_NEAR(turns / count, 1, 0.17);
}

TEST_F(HalfOfABlock, HeldValuesStay) {
  for (Frame& frame : simulated_.block.frames) {
    frame.position_prior->sigma.setConstant(kHeldPositionSigma);
    frame.attitude_prior->sigma_rad.setConstant(kHeldAttitudeSigma);
  }
  const TileProblem one = problem(Half::kTiePoints1);
  for (const auto& term : one.positions) {
    const FrameIndex frame = one.frames[static_cast<std::size_t>(term.frame.value)];
    EXPECT_EQ(term.prior.position, simulated_.block.frames[frame].position_prior->position);
    EXPECT_EQ(term.prior.sigma.x(), kHeldPositionSigma);
  }
}

}  // namespace
}  // namespace megablock
