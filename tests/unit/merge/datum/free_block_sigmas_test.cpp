// The sigmas of free blocks are those of the errors after a best-fit similarity: over many simulated blocks of few
// images the ratio of errors and sigmas is 1.
#include <gtest/gtest.h>

#include <cmath>

#include "io/block/track_rows.h"
#include "io/evaluation/evaluate.h"
#include "io/evaluation/free_datum.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

struct Ratios {
  double position = 0, rotation = 0;  // sums of squares
  int blocks = 0;
  void add(double of_position, double of_rotation) {
    position += of_position * of_position;
    rotation += of_rotation * of_rotation;
    ++blocks;
  }
  void add(const Evaluation& e) { add(e.normalised_error_position, e.normalised_error_rotation); }
  void add_empirical(const Evaluation& e) { add(e.empirical_error_position, e.empirical_error_rotation); }
  double of_positions() const { return std::sqrt(position / blocks); }
  double of_rotations() const { return std::sqrt(rotation / blocks); }
};

SimulationOptions scene(std::uint64_t seed) {
  SimulationOptions options;
  options.frames = 12;
  options.points_per_frame = 60;
  options.gps_sigma_m = 0;
  options.calibrate = false;
  options.seed = seed;
  return options;
}

// Every track so many times, with the same errors.
void repeat_tracks(int copies, SimulatedBlock& block) {
  const TrackSet once = block.tracks;
  const std::vector<Eigen::Vector3d> points = block.points;
  block.tracks = {};
  block.tracks.begin.push_back(0);
  block.points.clear();
  for (std::int64_t t = 0; t < once.track_count(); ++t)
    for (int copy = 0; copy < copies; ++copy) {
      append_tracks(once, t, t + 1, block.tracks);
      block.tracks.id.back() = TrackIndex(std::ssize(block.points));
      block.points.push_back(points[static_cast<std::size_t>(t)]);
    }
}

BlockResult::JointCovariance joint_of(const CovarianceMatrix& frames) {
  BlockResult::JointCovariance joint;
  for (const Unknown& u : frames.unknowns) joint.frames.emplace_back(u.id.index);
  const auto n = static_cast<Eigen::Index>(6 * frames.unknowns.size());
  joint.matrix = Eigen::Map<const Eigen::MatrixXd>(frames.matrix.data(), n, n);
  return joint;
}

BlockResult adjusted(std::uint64_t seed, std::int64_t tile_max_frames, int copies = 1) {
  SimulatedBlock simulated = simulate_block(scene(seed));
  if (copies > 1) repeat_tracks(copies, simulated);
  const TiledBlock block(std::move(simulated), tile_max_frames, {}, 0);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalState state = start_global({});
  adjust_globally(runner, {}, state);
  EXPECT_EQ(state.outcome, GlobalOutcome::kConverged);
  runner.final_up();
  runner.final_scores();
  BlockResult result;
  result.block = block.simulated.block;
  result.state = block.simulated.truth;
  result.gauge = runner.gauge().text;
  const std::size_t frames = result.block.frames.size();
  result.frame_covariance.assign(frames, BlockResult::Matrix6::Zero());
  result.aligned_covariance = result.frame_covariance;
  result.empirical.frame_covariance = result.empirical.aligned_covariance = result.frame_covariance;
  for (std::size_t t = 0; t < runner.problems().size(); ++t)
    for (std::size_t f = 0; f < runner.problems()[t].frames.size(); ++f) {
      const FrameIndex frame = runner.problems()[t].frames[f];
      result.state.frames[frame] = runner.states()[t].frames[f];
      result.frame_covariance[frame] = runner.covariances()[t].frames[f];
      result.aligned_covariance[frame] = runner.covariances()[t].aligned_frames[f];
      result.empirical.frame_covariance[frame] = runner.empirical_covariances()[t].frames[f];
      result.empirical.aligned_covariance[frame] = runner.empirical_covariances()[t].aligned_frames[f];
    }
  result.joint_covariance = joint_of(runner.frame_covariance());
  result.empirical.joint_covariance = joint_of(runner.empirical_frame_covariance());
  return result;
}

BlockState truth_of(std::uint64_t seed) { return simulate_block(scene(seed)).truth; }

constexpr int kSeeds = 60;

TEST(FreeBlockSigmas, AreThoseOfErrorsAfterAFit) {
  Ratios all, without_joint, some, poses;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    BlockResult result = adjusted(static_cast<std::uint64_t>(seed), seed % 2 == 0 ? 12 : 5);
    const BlockState truth = truth_of(static_cast<std::uint64_t>(seed));
    const Evaluation e = evaluate(result, truth);
    EXPECT_TRUE(e.aligned);
    EXPECT_EQ(e.frames, 12);
    EXPECT_TRUE(e.sigma_note.empty()) << e.sigma_note;
    all.add(e);
    // A truth of five images.
    PoseTable five = pose_table(result.block, truth);
    for (std::size_t i = 0; i < 5; ++i) {
      five.names[i] = five.names[2 * i];
      five.poses[i] = five.poses[2 * i];
    }
    five.names.resize(5);
    five.poses.resize(5);
    const Evaluation part = evaluate(result, five);
    EXPECT_EQ(part.frames, 5);
    EXPECT_TRUE(part.sigma_note.empty()) << part.sigma_note;
    some.add(part);
    // Large blocks have no joint covariance.
    result.joint_covariance = {};
    const Evaluation large = evaluate(result, truth);
    EXPECT_TRUE(large.sigma_note.empty()) << large.sigma_note;
    EXPECT_NEAR(large.normalised_error_position, e.normalised_error_position, 1e-4 * e.normalised_error_position);
    EXPECT_NEAR(large.normalised_error_rotation, e.normalised_error_rotation, 1e-4 * e.normalised_error_rotation);
    EXPECT_FALSE(evaluate(result, five).sigma_note.empty());
  }
  for (const Ratios* ratios : {&all, &some}) {
    // Over 60 blocks of 12 or 5 correlated poses the mean scatters by 2 to 3 %.
    EXPECT_NEAR(ratios->of_positions(), 1, 0.08);
    EXPECT_NEAR(ratios->of_rotations(), 1, 0.08);
    std::printf("error / sigma over %d blocks: position %.3f, rotation %.3f\n", ratios->blocks, ratios->of_positions(),
                ratios->of_rotations());
  }
}

// Errors that are independent, and errors that four tracks each have in common: the formal sigmas are then half of what
// they should be.
TEST(EmpiricalSigmas, AreTrueWhereNeighboursShareTheirErrors) {
  for (const int copies : {1, 4}) {
    Ratios formal, empirical, without_joint;
    for (int seed = 1; seed <= kSeeds; ++seed) {
      BlockResult result = adjusted(static_cast<std::uint64_t>(seed), seed % 2 == 0 ? 12 : 5, copies);
      const BlockState truth = truth_of(static_cast<std::uint64_t>(seed));
      const Evaluation e = evaluate(result, truth);
      formal.add(e);
      empirical.add_empirical(e);
      result.joint_covariance = result.empirical.joint_covariance = {};
      without_joint.add_empirical(evaluate(result, truth));
    }
    std::printf("%d copies: error / formal sigma %.3f, %.3f; / empirical sigma %.3f, %.3f\n", copies,
                formal.of_positions(), formal.of_rotations(), empirical.of_positions(), empirical.of_rotations());
    EXPECT_NEAR(formal.of_positions(), std::sqrt(copies), 0.08 * std::sqrt(copies));
    EXPECT_NEAR(formal.of_rotations(), std::sqrt(copies), 0.08 * std::sqrt(copies));
    EXPECT_NEAR(empirical.of_positions(), 1, 0.12);
    EXPECT_NEAR(empirical.of_rotations(), 1, 0.12);
    EXPECT_NEAR(without_joint.of_positions(), empirical.of_positions(), 1e-3);
  }
}

// Two adjustments of the same images, compared in the datum of all poses.
TEST(FreeBlockSigmas, AreThoseOfDifferencesAfterAFitOfPoses) {
  double position = 0, rotation = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const BlockResult result = adjusted(static_cast<std::uint64_t>(seed), 12);
    const BlockState truth = truth_of(static_cast<std::uint64_t>(seed));
    std::vector<Pose> from(result.state.frames.begin(), result.state.frames.end()),
        to(truth.frames.begin(), truth.frames.end());
    const auto similarity = fit_datum(from, to, DatumFit::kPoses);
    ASSERT_TRUE(similarity);
    const DatumCovariances covariances =
        covariances_after_fit(result, result.joint_covariance.frames, DatumFit::kPoses);
    ASSERT_EQ(covariances.frames.size(), from.size());
    for (std::size_t f = 0; f < from.size(); ++f) {
      const Pose moved = (*similarity)(from[f]);
      const Eigen::Vector3d w = similarity->rotation.conjugate() *
                                rotation_log<double>(moved.rotation.conjugate() * to[f].rotation),
                            d = similarity->rotation.conjugate() * (to[f].centre - moved.centre) / similarity->scale;
      const BlockResult::Matrix6& c = covariances.frames[f];
      rotation += w.dot(c.topLeftCorner<3, 3>().inverse() * w) / 3 / 12 / kSeeds;
      position += d.dot(c.bottomRightCorner<3, 3>().inverse() * d) / 3 / 12 / kSeeds;
    }
  }
  EXPECT_NEAR(std::sqrt(position), 1, 0.08);
  EXPECT_NEAR(std::sqrt(rotation), 1, 0.08);
}

// Positions on one line: the attitudes take part in the fit, and the ratios stay true.
TEST(DatumFit, OfPositionsOnOneLineTakesAttitudes) {
  std::vector<Pose> from, to;
  Similarity turn;
  turn.scale = 2;
  turn.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  turn.translation = {10, 20, 30};
  for (int i = 0; i < 6; ++i) {
    const Eigen::Quaterniond attitude(Eigen::AngleAxisd(0.1 * i, Eigen::Vector3d::UnitY()));
    from.push_back({attitude, Eigen::Vector3d(i, 2.0 * i, 0)});
    to.push_back(turn(from.back()));
  }
  EXPECT_FALSE(determine_similarity(from));
  const auto fitted = fit_datum(from, to, DatumFit::kPoses);
  ASSERT_TRUE(fitted);
  EXPECT_NEAR(fitted->scale, 2, 1e-12);
  EXPECT_LT(fitted->rotation.angularDistance(turn.rotation), 1e-12);
  EXPECT_LT((fitted->translation - turn.translation).norm(), 1e-10);
  from[0].centre.z() = 1;
  EXPECT_TRUE(determine_similarity(from));
}

}  // namespace
}  // namespace megablock
