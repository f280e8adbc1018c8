// Redundancy numbers equal the diagonal of I - J (J'J)^-1 J' of the whole system, kind by kind and observation by
// observation; and the sigmas that residuals show are those of the noise, not those that were stated.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <utility>

#include "geometry/numbers/decompositions.h"
#include "io/block/observation_statistics.h"
#include "merge/checks/monolithic.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

using enum ObservationKind;

SimulationOptions small_controlled(SimulationOptions::Scene kind, std::int64_t frames, int points) {
  SimulationOptions o;
  o.scene = kind;
  o.frames = frames;
  o.points_per_frame = points;
  o.rig_cameras = kind == SimulationOptions::Scene::kStreet ? 10 : 2;  // of ten, neighbours see the same points
  o.control_points = 4;
  return o;
}

ObservationTable table_of(const std::vector<TileCovariance>& tiles) {
  ObservationTable sum;
  for (const TileCovariance& tile : tiles) sum.add(tile.observations);
  return sum;
}

Eigen::VectorXd redundancy_numbers(const MonolithicSystem& system, Eigen::Index defect) {
  const Eigen::VectorXd scale = system.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = Eigen::MatrixXd(system.jacobian) * scale.asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(scaled.transpose() * scaled);
  Eigen::VectorXd inverse = eigen.values.cwiseInverse();
  inverse.head(defect).setZero();
  return Eigen::VectorXd::Ones(scaled.rows()) - (scaled * eigen.vectors).cwiseAbs2() * inverse;
}

// Of rows that see points and frames, points alone, one frame alone, others: from the columns alone.
struct Expected {
  double image = 0, control = 0, frame = 0, other = 0;
  Expected(const MonolithicSystem& system, Eigen::Index defect) {
    const Eigen::MatrixXd j = system.jacobian;
    const Eigen::VectorXd numbers = redundancy_numbers(system, defect);
    for (Eigen::Index row = 0; row < j.rows(); ++row) {
      const double redundancy = numbers[row];
      const bool point = (j.row(row).tail(j.cols() - system.reduced_dimension).array() != 0).any();
      const bool pose = (j.row(row).head(system.reduced_dimension).array() != 0).any();
      bool frames = false;
      for (const std::int64_t column : system.frame_column)
        frames = frames || (column >= 0 && (j.row(row).segment<6>(column).array() != 0).any());
      (point && pose ? image : point ? control : frames ? frame : other) += redundancy;
    }
  }
};

class Redundancy : public testing::TestWithParam<SimulationOptions::Scene> {};

TEST_P(Redundancy, EqualsTheDenseSystem) {
  const TiledBlock block(simulate_block(small_controlled(GetParam(), 24, 24)), 8, {}, 0.02);
  ASSERT_GE(block.tiles.tile_count, 3);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  const UpReport up = runner.final_up();
  const ObservationTable table = table_of(runner.covariances());
  const Expected expected(monolithic_system(block.whole, block.whole_state), 0);
  const auto sum = [&](std::initializer_list<ObservationKind> kinds) {
    double redundancy = 0;
    for (const ObservationKind kind : kinds) redundancy += table[kind].redundancy;
    return redundancy;
  };
  EXPECT_NEAR(sum({kTieImage, kControlImage, kCheckImage}), expected.image, 1e-6);
  EXPECT_NEAR(sum({kControlHorizontal, kControlHeight}), expected.control, 1e-6);
  EXPECT_NEAR(sum({kPositionHorizontal, kPositionHeight, kAttitude, kRelativeRotation, kRelativePosition}),
              expected.frame, 1e-6);
  EXPECT_NEAR(sum({kIntrinsics, kMount}), expected.other, 1e-6);
  EXPECT_GT(table[kControlImage].count, 0);

  std::int64_t count = 0;
  double redundancy = 0, squares = 0;
  for (const ObservationStatistics& kind : table.kinds) {
    count += kind.count;
    redundancy += kind.redundancy;
    squares += kind.weighted_squares;
  }
  EXPECT_EQ(count, up.sums.residuals);
  EXPECT_NEAR(redundancy, static_cast<double>(up.sums.residuals - up.sums.unknowns), 1e-6);
  EXPECT_NEAR(squares, up.sums.weighted_squares, 1e-9 * squares);
}

TEST_P(Redundancy, DoesNotDependOnTheDatum) {
  SimulationOptions options = small_controlled(GetParam(), 16, 20);
  options.gps_sigma_m = 0;
  options.control_points = 0;
  options.calibrate = false;
  const TiledBlock block(simulate_block(options), 6, {}, 0);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  runner.final_up();
  ASSERT_GT(runner.gauge().defect, 0);
  const ObservationTable table = table_of(runner.covariances());
  const Expected expected(monolithic_system(block.whole, block.whole_state), runner.gauge().defect);
  EXPECT_NEAR(table[kTieImage].redundancy, expected.image, 1e-5);
}

// Calibration held or shared by all tiles, datum fixed or free, some observations rejected.
TEST_P(Redundancy, OfEveryImageObservationEqualsTheDenseSystem) {
  for (const bool calibrate : {false, true}) {
    for (const bool free : {false, true}) {
      SimulationOptions options = small_controlled(GetParam(), 16, 20);
      options.calibrate = calibrate;
      if (free) options.gps_sigma_m = options.control_points = 0;
      TiledBlock block(simulate_block(options), 6, {}, free ? 0 : 0.02);
      ASSERT_GE(block.tiles.tile_count, 2);
      for (std::size_t t = 0; t < block.problems.size(); ++t) {
        TileProblem& problem = block.problems[t];
        for (std::size_t p = 0; p < problem.points.size(); p += 5) {
          problem.kept[static_cast<std::size_t>(problem.begin[p])] = 0;
          block.whole.kept[static_cast<std::size_t>(block.whole.begin[block.point_row(problem.points[p])])] = 0;
        }
      }
      MergeInMemory runner(block.tiles.tree, block.problems, block.states);
      runner.final_up();
      ASSERT_EQ(runner.gauge().defect > 0, free);
      const std::vector<TileCovariance> tiles = runner.covariances();

      // The system's first rows are those of kept image observations of active points, as they come.
      const Eigen::VectorXd numbers =
          redundancy_numbers(monolithic_system(block.whole, block.whole_state), runner.gauge().defect);
      std::vector<Eigen::Index> row_of(block.whole.kept.size(), -1);
      Eigen::Index next = 0;
      for (std::int64_t p = 0; p < block.whole.point_count(); ++p)
        for (std::int64_t o = block.whole.begin[static_cast<std::size_t>(p)];
             block.whole.active(p) && o < block.whole.begin[static_cast<std::size_t>(p + 1)]; ++o)
          if (block.whole.kept[static_cast<std::size_t>(o)])
            row_of[static_cast<std::size_t>(o)] = std::exchange(next, next + 2);

      std::int64_t compared = 0;
      for (std::size_t t = 0; t < tiles.size(); ++t) {
        const TileProblem& problem = block.problems[t];
        ASSERT_EQ(tiles[t].redundancy_x.size(), problem.kept.size());
        ASSERT_EQ(tiles[t].redundancy_y.size(), problem.kept.size());
        for (std::size_t p = 0; p < problem.points.size(); ++p) {
          const auto first = static_cast<std::size_t>(problem.begin[p]);
          const auto whole = static_cast<std::size_t>(block.whole.begin[block.point_row(problem.points[p])]);
          for (std::size_t o = first; o < static_cast<std::size_t>(problem.begin[p + 1]); ++o) {
            const Eigen::Index row = row_of[whole + o - first];
            if (row < 0) {
              EXPECT_TRUE(std::isnan(tiles[t].redundancy_x[o]) && std::isnan(tiles[t].redundancy_y[o]));
              continue;
            }
            EXPECT_NEAR(tiles[t].redundancy_x[o], numbers[row], 1e-6);
            EXPECT_NEAR(tiles[t].redundancy_y[o], numbers[row + 1], 1e-6);
            ++compared;
          }
        }
      }
      EXPECT_EQ(2 * compared, next);
      EXPECT_GT(compared, 200);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, Redundancy,
                         testing::Values(SimulationOptions::Scene::kAerial, SimulationOptions::Scene::kStreet),
                         [](const auto& p) {
                           return p.param == SimulationOptions::Scene::kAerial ? "Aerial" : "Street";
                         });

// Everything is twice as noisy as stated. (Where only some is, the weights are wrong and estimates at these weights
// biased: merge.estimate_sigmas repeats them.)
TEST(SigmaFactor, ShowsTheTrueNoise) {
  SimulationOptions simulation = small_controlled(SimulationOptions::Scene::kAerial, 150, 60);
  simulation.image_noise_px = 1;
  simulation.gps_sigma_m = 0.3;
  SimulatedBlock simulated = simulate_block(simulation);
  for (Frame& frame : simulated.block.frames) frame.position_prior->sigma /= 2;
  ObservationOptions options;
  options.image_loss.kind = options.position_loss.kind = RobustLoss::Kind::kNone;
  const TiledBlock block(std::move(simulated), 40, options, 0.01);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  const GlobalOptions global;
  GlobalState state = start_global(global);
  adjust_globally(runner, global, state);
  ASSERT_EQ(state.outcome, GlobalOutcome::kConverged);
  runner.final_up();
  const ObservationTable table = table_of(runner.covariances());
  // Three standard deviations of the estimates.
  const auto tolerance = [&](ObservationKind kind) { return 3 / std::sqrt(2 * table[kind].redundancy); };
  EXPECT_NEAR(table[kTieImage].sigma_factor() / 2, 1, tolerance(kTieImage));
  EXPECT_NEAR(table[kPositionHorizontal].sigma_factor() / 2, 1, tolerance(kPositionHorizontal));
  EXPECT_NEAR(table[kPositionHeight].sigma_factor() / 2, 1, tolerance(kPositionHeight));
}

}  // namespace
}  // namespace megablock
