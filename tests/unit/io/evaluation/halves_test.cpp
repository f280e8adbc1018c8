// Two results whose errors are drawn from the covariances they state differ by their sigmas, fixed and free.
#include "io/evaluation/halves.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "geometry/similarity/similarity.h"
#include "io/base/error.h"
#include "io/simulate/blocks/simulate.h"
#include "io/simulate/scene/random.h"

namespace megablock {
namespace {

constexpr std::size_t kFrames = 600;

class HalvesTest : public testing::Test {
 protected:
  HalvesTest() {
    SimulationOptions options;
    options.frames = kFrames;
    options.points_per_frame = 10;
    options.check_points = 4;
    simulated_ = simulate_block(options);
  }

  // `share`: of the true sigmas that the result states.
  BlockResult result(std::uint64_t seed, double share) const {
    BlockResult result;
    result.block = simulated_.block;
    result.state = simulated_.truth;
    result.gauge = "fixed by priors";
    Random random(seed, Random::Purpose::kNoise);
    for (Pose& pose : result.state.frames) {
      BlockResult::Matrix6 root = BlockResult::Matrix6::Zero();
      for (int i = 0; i < 6; ++i)
        for (int j = 0; j <= i; ++j) root(i, j) = random.uniform(-0.5, 0.5) + (i == j ? 2 : 0);
      root.topRows<3>() *= 1e-4;
      root.bottomRows<3>() *= 0.01;
      PoseIncrement draw;
      draw << random.normal3(), random.normal3();
      pose = pose_update(pose, root * draw);
      result.frame_covariance.push_back(share * share * root * root.transpose());
      result.empirical.frame_covariance.push_back(root * root.transpose());
    }
    const int parameters = result.state.cameras[CameraIndex(0)].size();
    result.camera_covariance.push_back(Eigen::MatrixXd::Zero(parameters, parameters));
    result.camera_covariance.back()(0, 0) = 4;
    result.state.cameras[CameraIndex(0)][0] += seed == 1 ? 0 : 3 * std::sqrt(8);
    return result;
  }

  SimulatedBlock simulated_;
};

TEST_F(HalvesTest, FourOrientedImagesCanBeDivided) {
  BlockResult divided = result(1, 1);
  for (std::size_t f = 4; f < kFrames; ++f) divided.state.oriented[FrameIndex(static_cast<std::int64_t>(f))] = 0;
  EXPECT_NO_THROW(require_halves(divided));
  divided.state.oriented[FrameIndex(2)] = 0;
  try {
    require_halves(divided);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              "halves need 4 oriented images, and more if few tie points connect them; the block has 3; compare it "
              "with known poses ('megablock evaluate JOB POSES') or check points");
  }
}

TEST_F(HalvesTest, TrueSigmasGiveOne) {
  const HalvesComparison halves = compare_halves(result(1, 1), result(2, 1));
  EXPECT_FALSE(halves.aligned);
  EXPECT_EQ(halves.positions.count, static_cast<std::int64_t>(kFrames));
  // 1 800 numbers each: three sigmas are 0.05.
  EXPECT_NEAR(halves.positions.formal, 1, 0.05);
  EXPECT_NEAR(halves.rotations.formal, 1, 0.05);
  EXPECT_NEAR(halves.positions.empirical, 1, 0.05);
  ASSERT_EQ(halves.cameras.size(), 1u);
  ASSERT_EQ(halves.cameras[0].each.size(), 1u);
  EXPECT_EQ(halves.cameras[0].each[0].name, "f");
  EXPECT_NEAR(halves.cameras[0].each[0].formal, 3, 1e-9);
  EXPECT_NEAR(halves.cameras[0].parameters.formal, 3, 1e-9);
  EXPECT_EQ(halves.points.count, 0);
}

TEST_F(HalvesTest, DivisionsAreTakenTogether) {
  HalvesComparison one = compare_halves(result(1, 1), result(2, 1)), other = one;
  one.positions.formal = 1;
  other.positions.formal = 7;
  other.missing = 2;
  other.cameras[0].each[0].formal = -4;
  const HalvesComparison mean = mean_of({one, other});
  EXPECT_EQ(mean.divisions, 2);
  EXPECT_EQ(mean.missing, 2);
  EXPECT_NEAR(mean.positions.formal, 5, 1e-12);
  EXPECT_NEAR(mean.rotations.rms, one.rotations.rms, 1e-12);
  EXPECT_NEAR(mean.cameras[0].each[0].formal, std::sqrt(12.5), 1e-9);
  EXPECT_TRUE(std::isnan(mean.points.formal));
  EXPECT_NE(to_text(mean).find("2 divisions"), std::string::npos);
}

TEST_F(HalvesTest, SigmasTooSmallShow) {
  const HalvesComparison halves = compare_halves(result(1, 0.5), result(2, 0.5));
  EXPECT_NEAR(halves.positions.formal, 2, 0.1);
  EXPECT_NEAR(halves.rotations.formal, 2, 0.1);
  EXPECT_NEAR(halves.rotations.empirical, 1, 0.05);
}

// The second half in a datum of its own.
TEST_F(HalvesTest, AFreeDatumIsRemoved) {
  BlockResult first = result(1, 1), second = result(2, 1);
  const HalvesComparison fixed = compare_halves(first, second);
  Similarity moved;
  moved.scale = 3;
  moved.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d(1, 1, 2).normalized()));
  moved.translation = {100, 200, 300};
  BlockResult::Matrix6 turn = BlockResult::Matrix6::Zero();
  turn.topLeftCorner<3, 3>() = moved.rotation.toRotationMatrix();
  turn.bottomRightCorner<3, 3>() = 3 * turn.topLeftCorner<3, 3>();
  for (FrameIndex f(0); second.state.frames.contains(f); ++f.value) {
    second.state.frames[f] = moved(second.state.frames[f]);
    second.frame_covariance[f] = turn * second.frame_covariance[f] * turn.transpose();
  }
  first.gauge = second.gauge = "free, inner constraints";
  const HalvesComparison free = compare_halves(first, second);
  EXPECT_TRUE(free.aligned);
  EXPECT_NEAR(free.positions.formal, fixed.positions.formal, 0.02);
  EXPECT_NEAR(free.rotations.formal, fixed.rotations.formal, 0.02);
  EXPECT_NEAR(free.positions.rms, fixed.positions.rms, 0.02 * fixed.positions.rms);
}

TEST_F(HalvesTest, LostImagesAreCounted) {
  BlockResult first = result(1, 1), second = result(2, 1);
  first.state.oriented[FrameIndex(3)] = second.state.oriented[FrameIndex(5)] = 0;
  const HalvesComparison halves = compare_halves(first, second);
  EXPECT_EQ(halves.missing, 2);
  EXPECT_EQ(halves.positions.count, static_cast<std::int64_t>(kFrames) - 2);
  EXPECT_NE(to_text(halves).find("2 images are oriented in one half alone"), std::string::npos);
  const auto json = nlohmann::json::parse(to_json(halves));
  EXPECT_TRUE(json["points"]["rms_m"].is_null());
  EXPECT_TRUE(json["inner_positions"]["over_formal_sigma"].is_null());
  for (auto& oriented : first.state.oriented) oriented = 0;
  EXPECT_THROW(compare_halves(first, second), InputError);
}

}  // namespace
}  // namespace megablock
