// The tile adjustment on simulated blocks, against their truth.
#include "adjust/tile/tile_adjustment.h"

#include <ceres/covariance.h>
#include <gtest/gtest.h>

#include <numbers>

#include "adjust/lanes/tile_cost.h"
#include "adjust/tile/ceres_problem.h"
#include "adjust/tile/datum.h"
#include "geometry/similarity/similarity.h"
#include "io/base/error.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

struct Verdicts {
  double outliers_found = 0;  // share
  double good_lost = 0;       // share of the good observations of points that keep two good ones
};
Verdicts verdicts(const SingleTile& tile) {
  std::int64_t wrong = 0, found = 0, good = 0, lost = 0;
  for (std::int64_t t = 0; t < tile.simulated.tracks.track_count(); ++t) {
    std::int64_t good_here = 0, lost_here = 0;
    for (std::int64_t row = tile.problem.begin[t]; row < tile.problem.begin[t + 1]; ++row) {
      if (tile.simulated.outlier[static_cast<std::size_t>(row)])
        ++wrong, found += !tile.problem.kept[row];
      else
        ++good_here, lost_here += !tile.problem.kept[row];
    }
    if (good_here < 2) continue;
    good += good_here;
    lost += lost_here;
  }
  return {wrong ? static_cast<double>(found) / static_cast<double>(wrong) : 1,
          static_cast<double>(lost) / static_cast<double>(good)};
}

// sqrt of the mean of e' C^-1 e / 3 over the frames' positions: 1 when the posterior sigmas are true.
double normalised_position_error(const SingleTile& tile) {
  CeresTile ceres(tile.problem, tile.state);
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance covariance(options);
  std::vector<const double*> blocks;
  for (std::size_t f = 0; f < tile.problem.frames.size(); ++f)
    blocks.push_back(ceres.frame(static_cast<std::int64_t>(f)));
  EXPECT_TRUE(covariance.Compute(blocks, &ceres.problem()));
  double sum = 0;
  for (std::size_t f = 0; f < blocks.size(); ++f) {
    Eigen::Matrix<double, 6, 6, Eigen::RowMajor> c;
    covariance.GetCovarianceBlockInTangentSpace(blocks[f], blocks[f], c.data());
    const Eigen::Vector3d e = tile.state.frames[f].centre - tile.simulated.truth.frames[tile.problem.frames[f]].centre;
    sum += e.dot(c.bottomRightCorner<3, 3>().ldlt().solve(e)) / 3;
  }
  return std::sqrt(sum / static_cast<double>(blocks.size()));
}

// Posterior covariance of one block in tangent space.
Eigen::MatrixXd posterior(CeresTile& ceres, const double* block) {
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::SPARSE_QR;
  ceres::Covariance covariance(options);
  EXPECT_TRUE(covariance.Compute(std::vector<const double*>{block}, &ceres.problem()));
  const int size = ceres.problem().ParameterBlockTangentSize(block);
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> result(size, size);
  covariance.GetCovarianceBlockInTangentSpace(block, block, result.data());
  return result;
}

SimulationOptions aerial(std::int64_t frames, std::uint64_t seed = 1) {
  SimulationOptions options;
  options.frames = frames;
  options.points_per_frame = 150;
  options.seed = seed;
  return options;
}
SimulationOptions street(std::int64_t frames, std::uint64_t seed = 1) {
  SimulationOptions options = aerial(frames, seed);
  options.scene = SimulationOptions::Scene::kStreet;
  return options;
}

class Blocks : public testing::TestWithParam<SimulationOptions::Scene> {
 protected:
  static SimulationOptions options(std::uint64_t seed) {
    return GetParam() == SimulationOptions::Scene::kAerial ? aerial(40, seed) : street(40, seed);
  }
};

TEST_P(Blocks, RecoversTheTruthWithinItsSigmas) {
  SingleTile tile(options(3));
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_TRUE(summary.usable);
  EXPECT_NEAR(summary.sigma0, 1, 0.05);
  EXPECT_LT(verdicts(tile).good_lost, 0.005);
  const double normalised = normalised_position_error(tile);
  EXPECT_GT(normalised, 0.6);
  EXPECT_LT(normalised, 1.5);
}

TEST_P(Blocks, ScreensOutliers) {
  SimulationOptions simulation = options(4);
  simulation.outlier_share = 0.03;
  SingleTile tile(simulation);
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_NEAR(summary.sigma0, 1, 0.05);
  const Verdicts v = verdicts(tile);
  EXPECT_GE(v.outliers_found, 0.99);
  EXPECT_LE(v.good_lost, 0.005);
}

TEST_P(Blocks, SurvivesManyOutliers) {
  SimulationOptions simulation = options(5);
  simulation.outlier_share = 0.2;
  SingleTile tile(simulation);
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_NEAR(summary.sigma0, 1, 0.1);
  EXPECT_GE(verdicts(tile).outliers_found, 0.97);
  EXPECT_LT(tile.position_rms(), 0.2);
}

// Headings that are far off, as those of images that were turned and saved again, tell nothing by the default loss of
// attitudes, and turn the block without one.
TEST(TileAdjustment, ForgetsWrongAttitudes) {
  SimulationOptions simulation = aerial(18, 9);
  simulation.gps_sigma_m = 500;  // tells little of directions
  simulation.attitude_sigma_deg = 3;
  constexpr double kTurn = 2.8;  // rad; of half a turn the sign is chance
  const auto turn_of_block = [&](bool with_wrong, RobustLoss::Kind kind) {
    SimulatedBlock block = simulate_block(simulation);
    if (with_wrong)
      for (std::size_t f = 0; f < block.block.frames.size(); f += 3) {
        Eigen::Quaterniond& rotation = block.block.frames[FrameIndex(f)].attitude_prior->rotation_cw;
        rotation = Eigen::AngleAxisd(kTurn, Eigen::Vector3d::UnitZ()) * rotation;
      }
    AdjustOptions options;
    options.observations.attitude_loss.kind = kind;
    SingleTile tile(std::move(block), options);
    EXPECT_TRUE(adjust_tile(tile.problem, tile.state, tile.options).usable);
    return tile.rotation_rms() * 180 / std::numbers::pi;
  };
  const RobustLoss::Kind usual = ObservationOptions().attitude_loss.kind;
  constexpr double kTwoSigmas = 2 * 1.5;  // of the mean of twelve, three axes, degrees
  EXPECT_LT(turn_of_block(false, usual), kTwoSigmas);
  EXPECT_LT(turn_of_block(true, usual), kTwoSigmas);
  EXPECT_GT(turn_of_block(true, RobustLoss::Kind::kNone), 5);
}

TEST_P(Blocks, IsDeterministic) {
  SingleTile a(options(6)), b(options(6));
  adjust_tile(a.problem, a.state, a.options);
  adjust_tile(b.problem, b.state, b.options);
  EXPECT_EQ(a.problem.kept, b.problem.kept);
  for (std::size_t f = 0; f < a.state.frames.size(); ++f) {
    EXPECT_EQ(a.state.frames[f].centre, b.state.frames[f].centre);
    EXPECT_EQ(a.state.frames[f].rotation.coeffs(), b.state.frames[f].rotation.coeffs());
  }
}

TEST_P(Blocks, FreeBlockKeepsItsShape) {
  SimulationOptions simulation = options(7);
  simulation.gps_sigma_m = 0;
  SingleTile tile(simulation);
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_NEAR(summary.sigma0, 1, 0.05);
  std::vector<Eigen::Vector3d> from, to;
  for (std::size_t f = 0; f < tile.problem.frames.size(); ++f) {
    from.push_back(tile.state.frames[f].centre);
    to.push_back(tile.simulated.truth.frames[tile.problem.frames[f]].centre);
  }
  const auto fitted = fit_similarity(from, to);
  ASSERT_TRUE(fitted.has_value());
  double sum = 0;
  for (std::size_t f = 0; f < from.size(); ++f) sum += ((*fitted)(from[f]) - to[f]).squaredNorm();
  EXPECT_LT(std::sqrt(sum / static_cast<double>(from.size())), 0.5);
}

INSTANTIATE_TEST_SUITE_P(Scenes, Blocks,
                         testing::Values(SimulationOptions::Scene::kAerial, SimulationOptions::Scene::kStreet),
                         [](const auto& scene) {
                           return scene.param == SimulationOptions::Scene::kAerial ? "aerial" : "street";
                         });

TEST(SelfCalibration, FindsTheTrueCamera) {
  SingleTile tile(aerial(60, 8));
  const Intrinsics start = tile.state.cameras[0];
  adjust_tile(tile.problem, tile.state, tile.options);
  const Intrinsics &found = tile.state.cameras[0], &truth = tile.simulated.truth.cameras[CameraIndex(0)];
  // In pixels at a radius of 1000 px, beyond the corner's neighbourhood.
  const Eigen::Vector3d ray(0.6, 0.4, 1);
  EXPECT_GT((project(start, ray) - project(truth, ray)).norm(), 5);
  // Within four posterior sigmas, and these are small.
  CeresTile ceres(tile.problem, tile.state);
  const Eigen::MatrixXd covariance = posterior(ceres, ceres.camera(0));
  const ParameterMask freed = tile.problem.camera_free[0];
  EXPECT_EQ(freed, usual_parameters(found.model()) & ~mask_of(kRadial3));
  ASSERT_EQ(covariance.rows(), count_of(freed));
  const Intrinsics largest_sigma = {3, 1, 1, 2e-3, 3e-3, 0, 1e-4, 1e-4};
  for (int k = 0, row = 0; k < found.size(); ++k) {
    if (!contains(freed, k)) {
      EXPECT_EQ(found[k], 0) << parameter_name(found.model(), k);  // held
      continue;
    }
    const double sigma = std::sqrt(covariance(row, row));
    ++row;
    EXPECT_LT(std::abs(found[k] - truth[k]), 4 * sigma) << parameter_name(found.model(), k);
    EXPECT_LT(sigma, largest_sigma[k]) << parameter_name(found.model(), k);
  }
}

TEST(SelfCalibration, FewImagesReleaseFewParameters) {
  SingleTile tile(aerial(6, 9));
  const Intrinsics start = tile.state.cameras[0];
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_TRUE(summary.usable);
  const Intrinsics& found = tile.state.cameras[0];
  EXPECT_NE(found[kFocal], start[kFocal]);
  EXPECT_NE(found[kRadial1], start[kRadial1]);
  for (int k : {kPrincipalX, kPrincipalY, kRadial2, kRadial3, kDecentring1, kDecentring2})
    EXPECT_EQ(found[k], start[k]);
  EXPECT_EQ(tile.problem.camera_free[0],
            usual_parameters(found.model()) & ~mask_of(kRadial3));  // the block's unknowns are not touched
  // Two images release nothing.
  SingleTile two(aerial(2, 9));
  adjust_tile(two.problem, two.state, two.options);
  EXPECT_EQ(two.state.cameras[0], start);
}

TEST(SelfCalibration, PriorsReleaseParametersOfFewImages) {
  SimulatedBlock simulated = simulate_block(aerial(6, 9));
  simulated.block.cameras[CameraIndex(0)].prior_sigma[kPrincipalX] = 3;
  SingleTile tile(std::move(simulated));
  const double start = tile.state.cameras[0][kPrincipalX];
  adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_NE(tile.state.cameras[0][kPrincipalX], start);
  EXPECT_LT(std::abs(tile.state.cameras[0][kPrincipalX] - start), 10);
}

TEST(Priors, LeverArmsAreHeeded) {
  SimulationOptions simulation = street(30, 10);
  simulation.gps_sigma_m = 0.02;
  SingleTile with(simulation), without(simulation);
  ASSERT_GT(with.problem.positions.front().prior.lever_arm.norm(), 0.1);
  for (auto& term : without.problem.positions) term.prior.lever_arm.setZero();
  adjust_tile(with.problem, with.state, with.options);
  adjust_tile(without.problem, without.state, without.options);
  EXPECT_LT(with.position_rms(), 0.03);
  EXPECT_GT(without.position_rms(), 0.2);
}

TEST(Priors, ControlPointsReduceTheError) {
  double squares_without = 0, squares_with = 0;
  constexpr int kBlocks = 12;
  for (int block = 0; block < kBlocks; ++block) {
    SimulationOptions simulation = aerial(40, static_cast<std::uint64_t>(11 + block));
    simulation.gps_sigma_m = 2;
    simulation.calibrate = false;  // the focal length and the height would bear each other
    SingleTile without(simulation);
    simulation.control_points = 12;
    SingleTile with(simulation);
    adjust_tile(without.problem, without.state, without.options);
    adjust_tile(with.problem, with.state, with.options);
    squares_without += std::pow(without.position_rms(), 2);
    squares_with += std::pow(with.position_rms(), 2);
  }
  EXPECT_LT(std::sqrt(squares_with / kBlocks), 0.1);
  EXPECT_LT(squares_with, 0.3 * 0.3 * squares_without);
}

TEST(Priors, CheckPointsAreNotPulledByTheirCoordinates) {
  SimulationOptions simulation = aerial(30, 12);
  simulation.check_points = 5;
  SimulatedBlock shifted = simulate_block(simulation);
  for (ControlPoint& point : shifted.block.control_points) point.position += Eigen::Vector3d(5, 5, 5);
  SingleTile a(simulation), b(std::move(shifted));
  adjust_tile(a.problem, a.state, a.options);
  adjust_tile(b.problem, b.state, b.options);
  ASSERT_EQ(a.problem.points.back().role, PointRole::kCheck);
  for (std::size_t p = a.simulated.points.size(); p < a.state.points.size(); ++p) {
    EXPECT_EQ(a.state.points[p], b.state.points[p]);
    EXPECT_LT((a.state.points[p] - a.truth().points[p]).norm(), 0.3);
  }
}

TEST(Priors, AWrongPositionDoesNotBendTheBlock) {
  SimulatedBlock simulated = simulate_block(aerial(40, 13));
  simulated.block.frames[FrameIndex(17)].position_prior->position.z() += 20;
  SingleTile tile(std::move(simulated));
  adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_LT(tile.position_rms(), 0.1);
}

// A few start poses that are plainly wrong are found again from the points of the others.
TEST_P(Blocks, FindsLostFrames) {
  SimulatedBlock simulated = simulate_block(options(18));
  for (std::int64_t f : {5, 17, 18, 31}) {
    Pose& given = *simulated.block.frames[FrameIndex(f)].given_pose;
    given.rotation = rotation_update(given.rotation, Eigen::Vector3d(0.1, 0.3, f == 17 ? 3.0 : 1.5));
    if (f == 31) given.centre += Eigen::Vector3d(30, -20, 5);
  }
  SingleTile tile(std::move(simulated));
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_NEAR(summary.sigma0, 1, 0.05);
  EXPECT_LT(verdicts(tile).good_lost, 0.005);
  EXPECT_LT(tile.position_rms(), 0.1);
}

// The sigma of tie point observations follows from the images, whatever is stated; that of control points stays.
TEST(Sigmas, AreEstimatedFromTheResiduals) {
  for (const double noise : {0.12, 1.5}) {
    SimulationOptions simulation = aerial(40, 19);
    simulation.image_noise_px = noise;
    simulation.outlier_share = 0.03;
    simulation.control_points = 4;
    SimulatedBlock simulated = simulate_block(simulation);
    for (ControlPoint& point : simulated.block.control_points)
      for (ImageMeasurement& m : point.measurements) m.sigma_px = 0.8;
    SingleTile tile(std::move(simulated));
    const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
    EXPECT_NEAR(tile.problem.image_sigma_px, noise, 0.02 * noise);
    EXPECT_NEAR(summary.sigma0, 1, 0.03);
    EXPECT_LT(verdicts(tile).good_lost, 0.01);
    EXPECT_GE(verdicts(tile).outliers_found, 0.98);
    EXPECT_EQ(tile.problem.inverse_sigma.front(), 1 / tile.problem.image_sigma_px);
    EXPECT_EQ(tile.problem.inverse_sigma.back(), 1 / 0.8);
  }
}

// Images noisier than their a-priori sigma says: the threshold follows, good observations stay.
TEST(Sigmas, TooSmallOnesDoNotCostGoodObservations) {
  SimulationOptions simulation = aerial(40, 19);
  simulation.image_noise_px = 1.5;
  simulation.outlier_share = 0.03;
  AdjustOptions stated;
  stated.estimate_image_sigma = false;
  SingleTile tile(simulation, stated);
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_NEAR(summary.sigma0, 3, 0.15);
  // Three times the four sigmas; the median of a robust solution is a little short.
  const double threshold = screening_threshold(tile.problem, tile.state, tile.options);
  EXPECT_GT(threshold, 9.5);
  EXPECT_LT(threshold, 13);
  EXPECT_LT(verdicts(tile).good_lost, 0.01);
  EXPECT_GE(verdicts(tile).outliers_found, 0.98);
  // And the threshold never falls below what was asked for.
  simulation.image_noise_px = 0.1;
  SingleTile sharp(simulation, stated);
  adjust_tile(sharp.problem, sharp.state, sharp.options);
  EXPECT_EQ(screening_threshold(sharp.problem, sharp.state, sharp.options), tile.options.max_residual_sigmas);
}

TEST(Rigs, FreeMountsAreFound) {
  SimulatedBlock simulated = simulate_block(street(30, 14));
  Rig& rig = simulated.block.rigs[RigIndex(0)];
  ASSERT_EQ(rig.mounts.size(), 4u);
  for (std::size_t m = 1; m < 4; ++m) {
    rig.mounts[m].rotation_sigma_rad = 0.02;
    rig.mounts[m].position_sigma_m = 0.02;
    rig.mounts[m].pose.rotation =
        rotation_update(rig.mounts[m].pose.rotation, Eigen::Vector3d(0.01, -0.008, 0.005 * static_cast<double>(m)));
  }
  SingleTile tile(std::move(simulated));
  const AdjustSummary summary = adjust_tile(tile.problem, tile.state, tile.options);
  EXPECT_NEAR(summary.sigma0, 1, 0.05);
  CeresTile ceres(tile.problem, tile.state);
  for (std::size_t m = 1; m < 4; ++m) {
    const Pose &found = tile.state.mounts[m], &truth = tile.simulated.truth.mounts[RigIndex(0)][m];
    const Eigen::MatrixXd covariance = posterior(ceres, ceres.mount(static_cast<std::int64_t>(m)));
    PoseIncrement error;
    error << rotation_log<double>(found.rotation.conjugate() * truth.rotation), truth.centre - found.centre;
    for (int i = 0; i < 6; ++i) EXPECT_LT(std::abs(error[i]), 4 * std::sqrt(covariance(i, i))) << "mount " << m;
    EXPECT_LT(error.head<3>().norm(), 0.4 * rotation_angle(rig.mounts[m].pose.rotation, truth.rotation));
  }
  EXPECT_EQ(tile.state.mounts[0].centre, rig.mounts[0].pose.centre);
}

TEST(Rigs, RelativePosesHelpWhereSatellitesAreHidden) {
  SimulationOptions simulation = street(40, 15);
  simulation.gps_sigma_m = 0.5;
  simulation.gps_share = 0.2;
  SingleTile without(simulation);
  simulation.relative_position_sigma_m = 0.003;
  SingleTile with(simulation);
  ASSERT_FALSE(with.problem.relatives.empty());
  adjust_tile(without.problem, without.state, without.options);
  const AdjustSummary summary = adjust_tile(with.problem, with.state, with.options);
  EXPECT_NEAR(summary.sigma0, 1, 0.05);
  EXPECT_LE(with.position_rms(), without.position_rms() * 1.1);
}

// Any minimal constraint gives the same adjusted observations.
TEST(Solve, FreeDatumShiftsNothing) {
  SimulationOptions simulation = aerial(20, 16);
  simulation.gps_sigma_m = 0;
  simulation.start_position_error_m = 0.2;
  simulation.start_rotation_error_deg = 0.1;
  SingleTile tile(simulation);
  tile.problem.image_loss = {};
  triangulate_points(tile.problem, tile.state, tile.options);
  TileState moved = tile.state;
  const AdjustSummary first = solve_with_ceres(tile.problem, tile.state, 100, 1e-14);
  // The same block under a similarity of the ground: other numbers in the same constraints.
  Similarity change;
  change.scale = 3;
  change.rotation = rotation_exp<double>(Eigen::Vector3d(0.3, -0.2, 1)).normalized();
  change.translation = {100, -50, 20};
  for (Pose& frame : moved.frames) frame = change(frame);
  for (Eigen::Vector3d& point : moved.points) point = change(point);
  const AdjustSummary second = solve_with_ceres(tile.problem, moved, 100, 1e-14);
  EXPECT_NEAR(first.final_cost, second.final_cost, 1e-8 * first.final_cost);
  EXPECT_NEAR(first.sigma0, 1, 0.05);
  EXPECT_NEAR(first.final_cost, evaluate_cost(tile.problem, tile.state), 1e-9 * first.final_cost);
  // The datum is that of the start values: the adjusted blocks differ by the similarity between them.
  for (std::size_t f = 0; f < moved.frames.size(); ++f)
    EXPECT_LT((moved.frames[f].centre - change(tile.state.frames[f].centre)).norm(), 0.05) << f;
}

TEST(Solve, RefusesWhatCannotBeAdjusted) {
  SingleTile tile(aerial(6, 17));
  tile.problem.kept.assign(tile.problem.kept.size(), 0);
  EXPECT_THROW(adjust_tile(tile.problem, tile.state, tile.options), ComputeError);
  AdjustOptions options;
  options.screening_rounds = 0;
  EXPECT_THROW(options.check(), InputError);
  options = {};
  options.min_intersection_deg = 90;
  EXPECT_THROW(options.check(), InputError);
  options = {};
  options.max_residual_sigmas = 0;
  EXPECT_THROW(options.check(), InputError);
}

TEST(Solve, NamesTheAngleThatNoPointReaches) {
  SingleTile tile(aerial(6, 17));
  tile.options.min_intersection_deg = 89.5;
  try {
    adjust_tile(tile.problem, tile.state, tile.options);
    ADD_FAILURE() << "nothing is said";
  } catch (const ComputeError& error) {
    EXPECT_NE(std::string(error.what()).find("adjustment.min_intersection_deg = 89.5 or more; lower it"),
              std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace megablock
