#include "adjust/terms/line_terms.h"

#include <gtest/gtest.h>

#include "adjust/terms/build_problem.h"
#include "io/block/crs.h"
#include "tests/support/adjust/known_lines.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

SimulationOptions scene(SimulationOptions::Scene kind) {
  SimulationOptions options;
  options.scene = kind;
  options.frames = 30;
  options.points_per_frame = 100;
  options.calibrate = false;  // lines take the given cameras
  return options;
}

class Lines : public testing::TestWithParam<SimulationOptions::Scene> {};

TEST_P(Lines, FitTheTruth) {
  SimulatedBlock simulated = simulate_block(scene(GetParam()));
  simulated.block.ground.georeferenced = false;  // lines and frames have the same vertical
  add_known_lines(simulated, 10, 0);
  const SingleTile tile(std::move(simulated));
  const TileState truth = tile.truth();
  ASSERT_GT(tile.problem.lines.size(), 50u);
  std::int64_t horizontal = 0;
  for (const auto& term : tile.problem.lines) {
    horizontal += term.other.valid();
    const LineResidual r = linearise_line(truth.frames[term.frame.value], truth.frames[term.seen_by().value], term);
    EXPECT_LT(std::abs(r.residual), 1e-6);
    EXPECT_GT(r.by_frame.norm(), 0);
    EXPECT_EQ(r.by_other.isZero(0), !term.other.valid());
  }
  EXPECT_GT(horizontal, 10);
}

// The block stands 10 km from the origin, level there: its lines are along its own vertical, 0.09 degrees from z.
TEST_P(Lines, FollowThePlumbLineFarFromTheOrigin) {
  SimulatedBlock simulated = simulate_block(scene(GetParam()));
  GroundFrame& origin = simulated.block.ground;
  origin.georeferenced = true;
  const Georeference georeference(origin);
  const Geodetic place = georeference.to_geodetic({8000, -6000, 0});
  const Pose moved{georeference.own_from_block(place), georeference.to_local(place)};
  for (Pose& frame : simulated.truth.frames) {
    frame.centre = moved.rotation.conjugate() * frame.centre + moved.centre;
    frame.rotation = frame.rotation * moved.rotation;
  }
  for (Eigen::Vector3d& point : simulated.points) point = moved.rotation.conjugate() * point + moved.centre;
  add_known_lines(simulated, 10, 0);
  const TileProblem problem = make_tile_problem(simulated.block, simulated.truth, single_tile(simulated.block),
                                                TileIndex(0), simulated.tracks, {});
  ASSERT_GT(problem.lines.size(), 50u);
  double squares = 0, along_axis = 0;
  for (TileProblem::LineTerm term : problem.lines) {
    const auto residual = [&] {
      return linearise_line(simulated.truth.frames[problem.frames[static_cast<std::size_t>(term.frame.value)]],
                            simulated.truth.frames[problem.frames[static_cast<std::size_t>(term.seen_by().value)]],
                            term)
          .residual;
    };
    EXPECT_NEAR(term.up.dot(moved.rotation.conjugate() * Eigen::Vector3d::UnitZ()), 1, 1e-8);
    squares += std::pow(residual(), 2);
    term.up = Eigen::Vector3d::UnitZ();
    along_axis += std::pow(residual(), 2);
  }
  std::printf("[ reached  ] rms residual %.2g sigma, by the ground's axis %.2g\n",
              std::sqrt(squares / static_cast<double>(problem.lines.size())),
              std::sqrt(along_axis / static_cast<double>(problem.lines.size())));
  EXPECT_LT(squares, 0.03 * 0.03 * along_axis);
}

// Root mean square of the angles between our vertical and the true one in the frames' systems, degrees.
double tilt_deg(const SingleTile& tile) {
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  double sum = 0;
  for (std::size_t f = 0; f < tile.problem.frames.size(); ++f) {
    const Eigen::Vector3d ours = tile.state.frames[f].rotation * up,
                          truth = tile.simulated.truth.frames[tile.problem.frames[f]].rotation * up;
    sum += (ours - truth).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(tile.problem.frames.size())) * 180 / std::acos(-1.0);
}

// Positions of metres leave a small block tilted; lines do not.
TEST_P(Lines, LevelTheBlock) {
  double squares_without = 0, squares_with = 0;
  constexpr unsigned kBlocks = 6;
  for (unsigned seed = 1; seed <= kBlocks; ++seed) {
    SimulationOptions options = scene(GetParam());
    options.seed = seed;
    options.gps_sigma_m = 3;
    options.start_position_error_m = 2;
    SimulatedBlock with = simulate_block(options);
    SingleTile without(with);
    add_known_lines(with, 5, 0.1);
    SingleTile lines(std::move(with));
    for (SingleTile* tile : {&without, &lines})
      EXPECT_TRUE(adjust_tile(tile->problem, tile->state, tile->options).usable);
    squares_without += std::pow(tilt_deg(without), 2);
    squares_with += std::pow(tilt_deg(lines), 2);
  }
  EXPECT_GT(std::sqrt(squares_without / kBlocks), 0.1);
  EXPECT_LT(squares_with, 0.1 * 0.1 * squares_without);
}

TEST_P(Lines, LeaveResidualsOfTheirNoise) {
  double squares = 0;
  std::ptrdiff_t vertical = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SimulationOptions options = scene(GetParam());
    options.seed = seed;
    SimulatedBlock simulated = simulate_block(options);
    add_known_lines(simulated, 10, 0.1);
    SingleTile tile(std::move(simulated));
    tile.state = tile.truth();
    EXPECT_TRUE(adjust_tile(tile.problem, tile.state, tile.options).usable);
    for (const auto& term : tile.problem.lines) {
      if (term.other.valid()) continue;
      const double r =
          linearise_line(tile.state.frames[term.frame.value], tile.state.frames[term.seen_by().value], term).residual;
      squares += r * r;
      ++vertical;
    }
  }
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(vertical)), 1,
              4 / std::sqrt(2.0 * static_cast<double>(vertical)));
}

TEST_P(Lines, OneWrongLineDoesNotTilt) {
  SimulatedBlock simulated = simulate_block(scene(GetParam()));
  add_known_lines(simulated, 10, 1.0);
  simulated.block.lines.front().measurements.front().second +=
      simulated.block.lines.front().direction == KnownLine::Direction::kVertical ? Eigen::Vector2d(300, 200)
                                                                                 : Eigen::Vector2d(0, 300);
  SingleTile tile(std::move(simulated));
  EXPECT_TRUE(adjust_tile(tile.problem, tile.state, tile.options).usable);
  EXPECT_LT(tile.position_rms(), 0.1);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Lines,
                         testing::Values(SimulationOptions::Scene::kAerial, SimulationOptions::Scene::kStreet),
                         [](const auto& p) {
                           return p.param == SimulationOptions::Scene::kAerial ? "Aerial" : "Street";
                         });

}  // namespace
}  // namespace megablock
