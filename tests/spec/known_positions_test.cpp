// Acceptance tests of "Bundle adjustment with known positions" (A. Barrier, S. Martin) that run through the adjustment:
// held positions, priors of the attitudes. Scenes and measures: known_positions_scene.h.
#include <gtest/gtest.h>

#include "adjust/checks/common_motion.h"
#include "cluster/stages/stages.h"
#include "geometry/numbers/angles.h"
#include "geometry/numbers/median.h"
#include "known_positions_scene.h"
#include "merge/tree/tile_solver.h"
#include "reached.h"
#include "tests/support/adjust/single_tile.h"
#include "tests/support/geometry/pair_scene.h"

namespace megablock {
namespace {

std::vector<XyzAngles> angles_of(const TileState& state) {
  std::vector<XyzAngles> result;
  for (const Pose& pose : state.frames) result.push_back(xyz_angles(pose.rotation));
  return result;
}
KnownPositionsScene::Images images_of(const KnownPositionsScene& scene, const TileState& state) {
  KnownPositionsScene::Images result;
  for (std::size_t j = 0; j < scene.points.size(); ++j) {
    result.emplace_back();
    for (const Pose& pose : state.frames)
      result.back().push_back(scene.focal * to_inside(pose, state.points[j]).hnormalized());
  }
  return result;
}
MotionVerdict verdict_of(const SingleTile& tile) {
  const MotionReference reference = motion_references(tile.simulated.block, single_tile(tile.simulated.block)).at(0);
  return judge(common_motion(tile.problem, tile.state, reference), reference);
}

// Mean errors of several runs before and after, as the report averages.
struct Runs {
  int runs = 0, most_iterations = 0, collinear = 0, weak_common = 0;
  double angles_before = 0, angles_after = 0, worst_angles = 0, images_before = 0, images_after = 0;
  double chi2_per_freedom = 0, point_rms = 0;
  std::vector<double> point_rms_of_runs;

  void add(const KnownPositionsScene& scene, const SingleTile& tile, const AdjustSummary& summary) {
    ++runs;
    most_iterations = std::max(most_iterations, summary.iterations);
    const double after = scene.angle_error(angles_of(tile.state));
    angles_before += scene.angle_error(scene.angles);
    angles_after += after;
    keep_largest(worst_angles, after);
    images_before += scene.image_error(scene.images);
    images_after += scene.image_error(images_of(scene, tile.state));
    chi2_per_freedom += summary.sigma0 * summary.sigma0;
    point_rms_of_runs.push_back(scene.point_rms(tile.state.points));
    point_rms += point_rms_of_runs.back();
    const MotionVerdict verdict = verdict_of(tile);
    collinear += verdict.collinear;
    weak_common += verdict.weak_common_rotation();
  }
  double angle_gain() const { return angles_before / angles_after; }
  double image_gain() const { return images_before / images_after; }
  double mean(double sum) const { return sum / runs; }
};

// By the tile's adjustment, from the measured attitudes.
template <typename Options>
Runs adjusted(int runs, Options options) {
  Runs result;
  for (int seed = 1; seed <= runs; ++seed) {
    const KnownPositionsScene scene(options(static_cast<std::uint64_t>(seed)));
    SingleTile tile(scene.block(), adjustment_of(scene));
    const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options, solve_by_condensation);
    result.add(scene, tile, summary);
  }
  return result;
}

double redundancy_ratio(double cameras, double points) {
  return std::sqrt(2 * cameras * points / (3 * points + 3 * cameras));
}

TEST(KnownPositions, TKP06bPriorsHelpAnglesAndImagesAtOnce) {
  const Runs runs = adjusted(15, [](std::uint64_t seed) { return KnownPositionsOptions::satellite(100, 0.1, seed); });
  expect_at_least(runs.angle_gain(), 2, "satellite, angle error divided by");
  const double expected = redundancy_ratio(6, 100);
  expect_at_least(runs.image_gain(), 0.95 * expected, "satellite, image error divided by");
  expect_at_most(runs.image_gain(), 1.05 * expected, "satellite, image error divided by");
  expect_at_most(std::abs(runs.mean(runs.chi2_per_freedom) - 1), 0.05, "satellite, chi2/dof off 1 by");
}

TEST(KnownPositions, TKP16DroneConvergesInFewIterations) {
  for (const int points : {100, 500}) {
    Runs runs;
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const KnownPositionsScene scene(KnownPositionsOptions::drone(points, seed));
      SingleTile tile(scene.block(), adjustment_of(scene));
      triangulate_points(tile.problem, tile.state, tile.options);
      const AdjustSummary summary = solve_by_condensation(tile.problem, tile.state, {});
      runs.add(scene, tile, summary);
    }
    const std::string what = "drone, " + std::to_string(points) + " points, ";
    expect_at_most(runs.mean(runs.angles_after), 1e-6, what + "mean angle error, rad");
    expect_at_most(runs.worst_angles, 2e-6, what + "worst angle error, rad");
    expect_at_least(runs.angle_gain(), 1e4, what + "angle error divided by");
    expect_at_most(std::abs(runs.image_gain() / 2 - 1), 0.05, what + "image error divided by, off 2 by");
    expect_at_most(runs.most_iterations, 10, what + "iterations");
    expect_at_most(std::abs(runs.mean(runs.chi2_per_freedom) - 1), 0.05, what + "chi2/dof off 1 by");
  }
}

TEST(KnownPositions, TKP16WholeTileAdjustmentFindsTheDrone) {
  const Runs runs = adjusted(20, [](std::uint64_t seed) { return KnownPositionsOptions::drone(100, seed); });
  expect_at_least(runs.angle_gain(), 1e4, "drone, angle error divided by");
  expect_at_most(runs.worst_angles, 2e-6, "drone, worst angle error, rad");
}

// From attitudes far off, where those measured only weigh: every frame turned by its own, and all of them about the
// line of their positions, which their images do not see. There the mean of six measured attitudes remains.
TEST(KnownPositions, TKP16FarStartsAreRecovered) {
  struct Case {
    const char* name;
    bool collinear, about_line;
    double turn_deg;
  };
  for (const Case& c : {Case{"spread, each frame turned by 20 deg", false, false, 20},
                        Case{"collinear, each frame turned by 5 deg", true, false, 5},
                        Case{"collinear, turned about the line by 20 deg", true, true, 20}}) {
    Runs runs;
    double kept = 1;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      KnownPositionsOptions options = KnownPositionsOptions::drone(100, seed);
      options.collinear = c.collinear;
      const KnownPositionsScene scene(options);
      const Eigen::Vector3d line = (scene.centres[1] - scene.centres[0]).normalized();
      std::mt19937_64 random(seed);
      SimulatedBlock block = scene.block();
      for (Frame& frame : block.block.frames) {
        const Eigen::Vector3d axis = c.about_line ? line : random_direction(random);
        frame.given_pose->rotation = rotation_update(frame.given_pose->rotation, c.turn_deg * kDegree * axis);
      }
      SingleTile tile(std::move(block), adjustment_of(scene));
      const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options, solve_by_condensation);
      runs.add(scene, tile, summary);
      keep_smallest(kept, static_cast<double>(summary.observations) / tile.problem.observation_count());
    }
    const std::string what = std::string(c.name) + ": ";
    const double mean_of_six = KnownPositionsOptions::drone(1, 1).angle_sigma_rad / std::sqrt(6.0);
    expect_at_most(runs.worst_angles, c.collinear ? 4 * mean_of_six : 2e-6, what + "worst angle error, rad");
    expect_at_least(kept, 0.95, what + "least share of the observations kept");
    expect_at_most(std::abs(runs.mean(runs.chi2_per_freedom) - 1), 0.05, what + "chi2/dof off 1 by");
  }
}

// Six cameras and 64 points: a common rotation is known from the attitude priors alone to satellites, not to a drone.
TEST(KnownPositions, TKP10WeakCommonRotationOfSatellitesOnly) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed)
    for (const bool drone : {false, true}) {
      const KnownPositionsScene scene(drone ? KnownPositionsOptions::drone(64, seed)
                                            : KnownPositionsOptions::satellite(64, 0.1, seed));
      SingleTile tile(scene.block(), adjustment_of(scene));
      adjust_tile(tile.problem, tile.state, tile.options, solve_by_condensation);
      const MotionVerdict verdict = verdict_of(tile);
      EXPECT_EQ(verdict.weak_common_rotation(), !drone) << seed;
      EXPECT_EQ(verdict.sound(), drone) << seed;
      EXPECT_FALSE(verdict.collinear) << seed;
      if (drone) continue;
      const double mean_of_six = scene.options.angle_sigma_rad / std::sqrt(6.0);
      expect_within(verdict.common_sigma_rad / mean_of_six, 1, 0.3,
                    "satellite, sigma of the common rotation over that of a mean of six priors");
    }
}

// Mean over the points of the expected squared error of their positions: the best that an unbiased estimate can do with
// these images, attitudes and control points, from the normal equations at the truth by central differences.
double expected_squared_error(const KnownPositionsScene& scene) {
  const auto cameras = static_cast<Eigen::Index>(scene.centres.size());
  const double image_weight = std::pow(scene.options.image_sigma_px, -2);
  Eigen::MatrixXd angles =
      std::pow(scene.options.angle_sigma_rad, -2) * Eigen::MatrixXd::Identity(3 * cameras, 3 * cameras);
  std::vector<Eigen::Matrix3d> point_inverse;
  std::vector<Eigen::MatrixXd> coupling;  // (angles x point) times that
  const auto add = [&](const Eigen::Vector3d& point, double prior_weight) {
    Eigen::Matrix3d normal = prior_weight * Eigen::Matrix3d::Identity();
    Eigen::MatrixXd both(3 * cameras, 3);
    for (Eigen::Index i = 0; i < cameras; ++i) {
      const auto camera = static_cast<std::size_t>(i);
      const auto seen = [&](const Eigen::Vector3d& turn, const Eigen::Vector3d& shift) -> Eigen::Vector2d {
        XyzAngles a = scene.true_angles[camera];
        a = {a.alpha + turn.x(), a.beta + turn.y(), a.gamma + turn.z()};
        return scene.focal * (rotation_from(a) * (point + shift - scene.centres[camera])).hnormalized();
      };
      constexpr double kTurn = 1e-6, kShift = 1e-2;  // rad, m
      Eigen::Matrix<double, 2, 3> by_angles, by_point;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d zero = Eigen::Vector3d::Zero(), unit = Eigen::Vector3d::Unit(k);
        by_angles.col(k) = (seen(kTurn * unit, zero) - seen(-kTurn * unit, zero)) / (2 * kTurn);
        by_point.col(k) = (seen(zero, kShift * unit) - seen(zero, -kShift * unit)) / (2 * kShift);
      }
      angles.block<3, 3>(3 * i, 3 * i) += image_weight * by_angles.transpose() * by_angles;
      normal += image_weight * by_point.transpose() * by_point;
      both.middleRows(3 * i, 3) = image_weight * by_angles.transpose() * by_point;
    }
    point_inverse.push_back(normal.inverse());
    coupling.emplace_back(both * point_inverse.back());
    angles -= coupling.back() * both.transpose();
  };
  for (const Eigen::Vector3d& point : scene.points) add(point, 0);
  for (const Eigen::Vector3d& point : scene.control_points) add(point, std::pow(scene.options.control_sigma_m, -2));
  const Eigen::MatrixXd covariance = angles.inverse();
  double sum = 0;
  for (std::size_t j = 0; j < scene.points.size(); ++j)
    sum += point_inverse[j].trace() + (coupling[j].transpose() * covariance * coupling[j]).trace();
  return sum / static_cast<double>(scene.points.size());
}

// Published: means of twenty scenes, which do not say how their cameras lie on a line; ours lie from corner to corner
// of the space of the cameras. Limits are these means, and what is asked for where that is less (spread satellites;
// their angles, and those of collinear ones with two control points, reach 2.4 and 4.6 for 2.5 and 4.8). Three means of
// points are held to their limit with what a mean of twenty scenes scatters by: those of ours exceed it, as do those
// that the covariances expect. The errors of points must be these, scene by scene. The verdict is of what the attitude
// priors alone tell: the rotation about the line, a common rotation.
TEST(KnownPositions, TKP20ControlRepairsCollinearCentres) {
  struct Case {
    bool drone, collinear;
    int control;
    double least_gain, largest_rms;
    bool line_flagged, common_flagged;
    bool within_scatter = false;  // of the largest rms
  };
  const Case cases[] = {{true, true, 0, 3.8, 0.34, true, false},      {true, true, 1, 121, 0.011, false, false},
                        {true, true, 2, 175, 0.008, false, false},    {true, true, 4, 228, 0.006, false, false},
                        {true, false, 0, 3000, 0.001, false, false},  {false, false, 0, 2, 7, false, true, true},
                        {false, false, 1, 3.8, 2.5, false, true},     {false, true, 0, 2.1, 160, true, true},
                        {false, true, 1, 3.8, 2.5, false, true},      {false, true, 2, 4.5, 2, false, true, true},
                        {false, true, 4, 4.8, 1.9, false, true, true}};
  for (const Case& c : cases) {
    const auto scene_of = [&](std::uint64_t seed) {
      KnownPositionsOptions options =
          c.drone ? KnownPositionsOptions::drone(200, seed) : KnownPositionsOptions::satellite(200, 0.1, seed);
      options.image_sigma_px = 0.1;
      options.collinear = c.collinear;
      options.control_points = c.control;
      return options;
    };
    constexpr int kRuns = 200, kPublishedRuns = 20;
    const Runs runs = adjusted(kRuns, scene_of);
    const std::string what = std::string(c.drone ? "drone" : "satellite") +
                             (c.collinear ? ", collinear, " : ", spread, ") + std::to_string(c.control) +
                             " control points: ";
    const double mean = runs.mean(runs.point_rms), middle = median(runs.point_rms_of_runs);
    expect_at_least(runs.angle_gain(), c.least_gain, what + "angle error divided by");
    double squares = 0, ratio = 0, best_mean = 0;
    for (std::uint64_t seed = 1; seed <= kRuns; ++seed) {
      const double expected = expected_squared_error(KnownPositionsScene(scene_of(seed)));
      const double reached = runs.point_rms_of_runs[seed - 1];
      squares += std::pow(reached - mean, 2) / (kRuns - 1);
      ratio += reached * reached / expected / kRuns;
      best_mean += std::sqrt(expected) / kRuns;
    }
    const double scatter = std::sqrt(squares / kPublishedRuns);  // of a mean of so many scenes
    std::printf("[ reached  ] %smean %.4g m, median %.4g; mean of the expected %.4g; scatter of a mean of %d %.3g\n",
                what.c_str(), mean, middle, best_mean, kPublishedRuns, scatter);
    expect_at_most(mean, c.largest_rms + (c.within_scatter ? scatter : 0), what + "mean rms of the points, m");
    if (!c.drone && !c.collinear) expect_at_most(middle, c.largest_rms, what + "median rms of the points, m");
    expect_at_most(std::abs(std::sqrt(ratio) - 1), 0.1, what + "off the expected rms by");
    const std::string of = " flagged, scenes of " + std::to_string(kRuns);
    expect_within(runs.collinear, c.line_flagged ? kRuns : 0, 0, what + "collinear positions" + of);
    expect_within(runs.weak_common, c.common_flagged ? kRuns : 0, 0, what + "weak common rotation" + of);
  }
}

}  // namespace
}  // namespace megablock
