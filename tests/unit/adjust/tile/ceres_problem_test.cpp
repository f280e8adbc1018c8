// The Ceres problem of a tile against our own cost and linearisation, with every kind of residual in it.
#include "adjust/tile/ceres_problem.h"

#include <gtest/gtest.h>

#include <bit>
#include <optional>

#include "adjust/lanes/tile_cost.h"
#include "adjust/tile/datum.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

SimulationOptions everything() {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 12;
  options.points_per_frame = 40;
  options.attitude_sigma_deg = 0.5;
  options.relative_position_sigma_m = 0.02;
  options.control_points = 4;
  options.check_points = 2;
  options.start_position_error_m = 0.1;
  options.start_rotation_error_deg = 0.1;
  return options;
}

class CeresTileTest : public testing::Test {
 protected:
  CeresTileTest() {
    SimulatedBlock simulated = simulate_block(everything());
    for (Rig& rig : simulated.block.rigs)
      for (std::size_t m = 1; m < rig.mounts.size(); ++m)
        rig.mounts[m].rotation_sigma_rad = 0.01, rig.mounts[m].position_sigma_m = 0.02;
    for (Camera& camera : simulated.block.cameras) camera.prior_sigma[kFocal] = 20;
    tile_.emplace(std::move(simulated));
    tile_->state = tile_->truth();
    tile_->state.frames =
        make_tile_state(tile_->problem, initial_state(tile_->simulated.block), tile_->state.points).frames;
  }
  double ceres_cost(CeresTile& ceres) {
    double cost = 0;
    EXPECT_TRUE(ceres.problem().Evaluate({}, &cost, nullptr, nullptr, nullptr));
    return cost;
  }
  std::optional<SingleTile> tile_;
};

TEST_F(CeresTileTest, HasOurCost) {
  for (const auto kind :
       {RobustLoss::Kind::kNone, RobustLoss::Kind::kHuber, RobustLoss::Kind::kCauchy, RobustLoss::Kind::kCauchyTail}) {
    tile_->problem.image_loss = tile_->problem.position_loss = tile_->problem.relative_loss = {kind, 2};
    tile_->problem.control_loss = {kind, 0.5};
    const double ours = evaluate_cost(tile_->problem, tile_->state);
    ASSERT_FALSE(tile_->problem.relatives.empty());
    ASSERT_FALSE(tile_->problem.mount_priors.empty());
    ASSERT_FALSE(tile_->problem.intrinsic_priors.empty());
    for (auto derivatives : {CeresOptions::Derivatives::kAutomatic, CeresOptions::Derivatives::kAnalytic}) {
      CeresTile ceres(tile_->problem, tile_->state, {derivatives, {}});
      EXPECT_NEAR(ceres_cost(ceres), ours, 1e-11 * ours);
    }
  }
}

TEST_F(CeresTileTest, AnalyticAndAutomaticGradientsAgree) {
  std::vector<double> gradients[2];
  int index = 0;
  for (auto derivatives : {CeresOptions::Derivatives::kAutomatic, CeresOptions::Derivatives::kAnalytic}) {
    CeresTile ceres(tile_->problem, tile_->state, {derivatives, {}});
    ceres::Problem::EvaluateOptions options;
    options.parameter_blocks = ceres.unknown_blocks();
    ASSERT_TRUE(ceres.problem().Evaluate(options, nullptr, nullptr, &gradients[index++], nullptr));
  }
  const TileProblem& problem = tile_->problem;
  std::size_t unknowns = 6 * problem.frames.size() + 3 * problem.points.size();
  for (ParameterMask mask : problem.camera_free) unknowns += static_cast<std::size_t>(std::popcount(mask));
  for (std::uint8_t free : problem.mount_free) unknowns += 6u * free;
  ASSERT_EQ(gradients[0].size(), unknowns);
  double largest = 0;
  for (double g : gradients[0]) largest = std::max(largest, std::abs(g));
  for (std::size_t i = 0; i < unknowns; ++i) EXPECT_NEAR(gradients[0][i], gradients[1][i], 1e-9 * largest) << i;
}

TEST_F(CeresTileTest, GradientIsThatOfOurIncrements) {
  CeresTile ceres(tile_->problem, tile_->state);
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = ceres.unknown_blocks();
  std::vector<double> gradient;
  ASSERT_TRUE(ceres.problem().Evaluate(options, nullptr, nullptr, &gradient, nullptr));
  for (int component = 0; component < 6; ++component) {
    constexpr double kStep = 1e-6;
    double cost[2];
    for (int side : {0, 1}) {
      TileState moved = tile_->state;
      PoseIncrement d = PoseIncrement::Zero();
      d[component] = side ? kStep : -kStep;
      moved.frames[3] = pose_update(moved.frames[3], d);
      cost[side] = evaluate_cost(tile_->problem, moved);
    }
    const double difference = (cost[1] - cost[0]) / (2 * kStep);
    EXPECT_NEAR(gradient[static_cast<std::size_t>(18 + component)], difference, 1e-3 * (1 + std::abs(difference)));
  }
}

TEST_F(CeresTileTest, LeavesOutWhatTakesNoPart) {
  TileProblem& problem = tile_->problem;
  const std::int64_t p = 5;
  std::fill(problem.kept.begin() + problem.begin[p], problem.kept.begin() + problem.begin[p + 1], 0);
  tile_->state.points[5] = {7, 7, 7};
  CeresTile ceres(problem, tile_->state);
  EXPECT_FALSE(ceres.problem().HasParameterBlock(ceres.point(5)));
  EXPECT_TRUE(ceres.problem().HasParameterBlock(ceres.point(6)));
  TileState stored = tile_->state;
  ceres.store(stored);
  EXPECT_EQ(stored.points[5], Eigen::Vector3d(7, 7, 7));
  EXPECT_EQ(stored.frames[2].rotation.coeffs(), tile_->state.frames[2].rotation.coeffs());
  EXPECT_TRUE(ceres.problem().IsParameterBlockConstant(ceres.mount(0)));
  EXPECT_FALSE(ceres.problem().IsParameterBlockConstant(ceres.mount(1)));
  EXPECT_EQ(ceres.problem().ParameterBlockTangentSize(ceres.camera(0)), 7);  // k3 is held
}

struct DatumCase {
  const char* name;
  bool positions, attitudes, relatives, control, collinear, rig;
  int expected;
};

class Datum : public testing::TestWithParam<DatumCase> {};

TEST_P(Datum, DefectIsWhatTheObservationsLeaveFree) {
  const DatumCase& c = GetParam();
  SimulationOptions options;
  options.frames = 12;
  options.points_per_frame = 40;
  if (c.rig) options.scene = SimulationOptions::Scene::kStreet, options.rig_cameras = 2;
  options.gps_sigma_m = c.positions ? 0.1 : 0;
  options.attitude_sigma_deg = c.attitudes ? 1 : 0;
  options.relative_position_sigma_m = c.relatives ? 0.1 : 0;
  options.control_points = c.control ? 5 : 0;
  SingleTile tile(options);
  tile.state = tile.truth();
  if (c.collinear)
    for (std::size_t f = 0; f < tile.state.frames.size(); ++f)
      tile.state.frames[f].centre =
          Eigen::Vector3d(100, 50, 30) + 7.0 * static_cast<double>(f) * Eigen::Vector3d(1, 2, 2);
  const auto defects = datum_defects(tile.problem, tile.state);
  int dimension = 0;
  for (const DatumDefect& defect : defects) dimension += defect.dimension;
  EXPECT_EQ(dimension, c.expected);
}

INSTANTIATE_TEST_SUITE_P(Kinds, Datum,
                         testing::Values(DatumCase{"free", false, false, false, false, false, false, 7},
                                         DatumCase{"free_rig", false, false, false, false, false, true, 6},
                                         DatumCase{"attitudes", false, true, false, false, false, false, 4},
                                         DatumCase{"relatives", false, false, true, false, false, false, 6},
                                         DatumCase{"positions", true, false, false, false, false, false, 0},
                                         DatumCase{"line", true, false, false, false, true, false, 1},
                                         DatumCase{"line_and_attitudes", true, true, false, false, true, false, 0},
                                         DatumCase{"control", false, false, false, true, false, false, 0}),
                         [](const auto& test) { return test.param.name; });

TEST(DatumComponents, EachOneHasItsOwn) {
  SimulationOptions options;
  options.frames = 24;
  options.points_per_frame = 40;
  options.gps_sigma_m = 0;
  SingleTile tile(options);
  tile.state = tile.truth();
  for (std::int64_t p = 0; p < tile.problem.point_count(); ++p) {
    int sides = 0;
    for (std::int64_t row = tile.problem.begin[p]; row < tile.problem.begin[p + 1]; ++row)
      sides |= tile.problem.images[tile.problem.image[row].value].frame.value < 12 ? 1 : 2;
    if (sides == 3)
      std::fill(tile.problem.kept.begin() + tile.problem.begin[p],
                tile.problem.kept.begin() + tile.problem.begin[p + 1], 0);
  }
  const auto defects = datum_defects(tile.problem, tile.state);
  int dimension = 0;
  for (const DatumDefect& defect : defects) dimension += defect.dimension;
  EXPECT_EQ(dimension, 7 * static_cast<int>(defects.size()));
  EXPECT_GE(defects.size(), 2u);
}

}  // namespace
}  // namespace megablock
