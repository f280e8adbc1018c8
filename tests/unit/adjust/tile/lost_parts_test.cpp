#include "adjust/tile/lost_parts.h"

#include <gtest/gtest.h>

#include "geometry/numbers/angles.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

constexpr double kFrameLimit = 32, kPartLimit = 3 * kFrameLimit;  // sigmas, as the adjustment asks for

// Vehicles with four cameras on streets that are driven twice. The second passes stand metres beside and above the
// first, turned a little, each in agreement with itself.
struct PassesApart : SingleTile {
  explicit PassesApart(std::uint64_t seed) : SingleTile(driven_twice(seed)), model(truth()) {
    std::fill(problem.kept.begin(), problem.kept.end(), 1);
    state = model;
    for (const std::size_t f : second_passes()) state.frames[f] = shifted(model.frames[f]);
    triangulate_points(problem, state, options);
    screen_observations(problem, state, kFrameLimit, options);
  }
  // As if nothing had ever stood apart.
  void stand_right() {
    state = model;
    std::fill(problem.kept.begin(), problem.kept.end(), 1);
    screen_observations(problem, state, kFrameLimit, options);
  }
  static SimulationOptions driven_twice(std::uint64_t seed) {
    SimulationOptions simulation;
    simulation.scene = SimulationOptions::Scene::kStreet;
    simulation.frames = 200;
    simulation.distortion = simulation.calibrate = false;
    simulation.outlier_share = 0.02;
    simulation.seed = seed;
    return simulation;
  }
  std::vector<std::size_t> second_passes() const {
    std::vector<std::size_t> frames;
    for (std::size_t f = 0; f < problem.frames.size(); ++f)
      if (simulated.block.frames[problem.frames[f]].pass == 1) frames.push_back(f);
    return frames;
  }
  // As a whole, about the middle of the block.
  Pose shifted(const Pose& frame) const {
    const Eigen::Quaterniond turn = rotation_exp<double>({0.002, -0.001, 0.004});
    const Eigen::Vector3d middle = model.frames.front().centre;
    return {(frame.rotation * turn.conjugate()).normalized(),
            middle + turn * (frame.centre - middle) + Eigen::Vector3d(-2, 0.3, 3)};
  }
  // Farthest that a frame stands from where it should, in the axes of the first one.
  std::pair<double, double> errors(const std::vector<LocalFrame>& frames) const {
    double place = 0, turn = 0;
    for (const LocalFrame f : frames) {
      const Pose &pose = state.frames[static_cast<std::size_t>(f.value)],
                 &right = model.frames[static_cast<std::size_t>(f.value)];
      place = std::max(place, (pose.centre - right.centre).norm());
      turn = std::max(turn, rotation_angle(pose.rotation, right.rotation) / kDegree);
    }
    return {place, turn};
  }
  TileState model;
};

TEST(LostParts, PassesAreBroughtTogether) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    PassesApart tile(seed);
    const std::vector<std::size_t> second = tile.second_passes();
    ASSERT_GT(second.size(), 50u);
    const std::vector<LocalFrame> found = recover_lost_parts(tile.problem, tile.state, kPartLimit);
    EXPECT_EQ(found.size(), second.size()) << seed;
    const auto [place, turn] = tile.errors(found);
    EXPECT_LT(place, 0.05) << seed;
    EXPECT_LT(turn, 0.05) << seed;
    const std::int64_t back = screen_observations(tile.problem, tile.state, kFrameLimit, tile.options);
    EXPECT_GT(back, tile.problem.observation_count() / 50) << "what one pass sees of the other's points";
    EXPECT_TRUE(recover_lost_parts(tile.problem, tile.state, kPartLimit).empty()) << "they are one now";
  }
}

TEST(LostParts, NothingIsMovedWhereAllAgree) {
  PassesApart tile(4);
  tile.stand_right();
  EXPECT_TRUE(recover_lost_parts(tile.problem, tile.state, kPartLimit).empty());
}

// Wrong matches that agree with one another, of a facade seen one period off, say, do not move what stands well.
TEST(LostParts, APartStaysWhereItsOwnObservationsAgree) {
  PassesApart tile(7);
  const std::vector<std::size_t> second = tile.second_passes();
  TileState elsewhere = tile.model;
  for (const std::size_t f : second) elsewhere.frames[f] = tile.shifted(tile.model.frames[f]);
  std::int64_t count = 0;
  for (std::int64_t p = 0; p < tile.problem.point_count(); ++p)
    for (std::int64_t row = tile.problem.begin[p]; row < tile.problem.begin[p + 1]; ++row) {
      const TileImage& image = tile.problem.images[tile.problem.image[row].value];
      const auto frame = static_cast<std::size_t>(image.frame.value);
      if (!std::binary_search(second.begin(), second.end(), frame) || ++count % 5 < 2) continue;
      // Three of five observations are those of a pass that stands elsewhere.
      const Eigen::Vector3d inside =
          to_camera(elsewhere.frames[frame], elsewhere.mounts[image.mount], tile.model.points[p]);
      if (inside.z() < 1) continue;
      const Eigen::Vector2d pixel = project(elsewhere.cameras[image.camera.value], inside);
      tile.problem.x[row] = pixel.x();
      tile.problem.y[row] = pixel.y();
    }
  tile.stand_right();
  EXPECT_TRUE(recover_lost_parts(tile.problem, tile.state, kPartLimit).empty());
}

// Without common tracks nothing says where a part belongs.
TEST(LostParts, PartsWithoutCommonTracksStay) {
  PassesApart tile(5);
  const std::vector<std::size_t> second = tile.second_passes();
  for (std::int64_t p = 0; p < tile.problem.point_count(); ++p) {
    bool of_second = false, of_first = false;
    for (std::int64_t row = tile.problem.begin[p]; row < tile.problem.begin[p + 1]; ++row) {
      const auto frame = static_cast<std::size_t>(tile.problem.images[tile.problem.image[row].value].frame.value);
      (std::binary_search(second.begin(), second.end(), frame) ? of_second : of_first) = true;
    }
    if (of_second && of_first)
      for (std::int64_t row = tile.problem.begin[p]; row < tile.problem.begin[p + 1]; ++row) {
        tile.problem.image[row] = LocalImage();
        tile.problem.kept[row] = 0;
      }
  }
  EXPECT_TRUE(recover_lost_parts(tile.problem, tile.state, kPartLimit).empty());
}

// The whole adjustment from there: as good as from the truth.
TEST(LostParts, ATileOfPassesApartIsAdjusted) {
  PassesApart tile(6);
  std::fill(tile.problem.kept.begin(), tile.problem.kept.end(), 1);
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_NEAR(summary.sigma0, 1, 0.03);
  PassesApart right(6);
  right.state = right.model;
  std::fill(right.problem.kept.begin(), right.problem.kept.end(), 1);
  const AdjustSummary best = adjust_tile(right.problem, right.state, right.options);
  EXPECT_NEAR(tile.position_rms(), right.position_rms(), 0.05 * right.position_rms());
  EXPECT_NEAR(tile.rotation_rms(), right.rotation_rms(), 0.05 * right.rotation_rms());
  EXPECT_NEAR(static_cast<double>(summary.rejected), static_cast<double>(best.rejected),
              0.02 * static_cast<double>(best.rejected));
}

}  // namespace
}  // namespace megablock
