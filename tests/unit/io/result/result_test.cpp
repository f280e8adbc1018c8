#include "io/result/result.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "io/base/error.h"
#include "io/result/result_digest.h"
#include "tests/support/io/example_block.h"
#include "tests/support/io/same_bits.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

template <typename Matrix>
Matrix symmetric(double seed) {
  Matrix m;
  for (Eigen::Index r = 0; r < m.rows(); ++r)
    for (Eigen::Index c = 0; c < m.cols(); ++c) m(r, c) = seed / static_cast<double>(1 + r + c);
  return m;
}

BlockResult example_result() {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  BlockResult result;
  result.block = example_block();
  result.state = initial_state(result.block);
  result.state.frames[FrameIndex(0)] = {Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), {1.25, -2.5, 1e-9}};
  result.state.oriented[FrameIndex(0)] = 1;
  result.boundary.assign(4, 0);
  result.boundary[FrameIndex(2)] = 1;
  result.tiles.tile_count = 1;
  result.tiles.tile_of_frame.assign(4, TileIndex(0));
  result.tiles.component.assign(4, 0);
  result.tiles.tree.nodes = {{-1, -1, -1, TileIndex(0), 0}};
  for (int f = 0; f < 4; ++f) result.frame_covariance.push_back(symmetric<BlockResult::Matrix6>(f + 1));
  for (const Intrinsics& camera : result.state.cameras)
    result.camera_covariance.push_back(
        symmetric<Eigen::Matrix<double, 16, 16>>(0.5).topLeftCorner(camera.size(), camera.size()));
  result.mount_covariance.push_back({BlockResult::Matrix6::Zero(), symmetric<BlockResult::Matrix6>(0.1)});
  result.mount_covariance.push_back({BlockResult::Matrix6::Zero()});
  for (int f = 0; f < 4; ++f) result.aligned_covariance.push_back(symmetric<BlockResult::Matrix6>(f + 3));
  result.joint_covariance = {{FrameIndex(1), FrameIndex(3)}, symmetric<Eigen::Matrix<double, 12, 12>>(2)};
  for (int f = 0; f < 4; ++f) result.empirical.frame_covariance.push_back(symmetric<BlockResult::Matrix6>(f + 7));
  result.empirical.mount_covariance = result.mount_covariance;
  result.empirical.camera_covariance = result.camera_covariance;
  result.tracks = example_tracks();
  result.points = {{1, 2, 3}, {nan, nan, nan}, {4, 5, 6}};
  result.point_covariance = {symmetric<Eigen::Matrix3d>(1), symmetric<Eigen::Matrix3d>(nan),
                             symmetric<Eigen::Matrix3d>(2)};
  result.kept = {1, 1, 1, 0, 1, 1, 0};
  result.residual_x = {3, 0, 100, 100, 100, 1, 100};
  result.residual_y = {4, 1, 100, 100, 100, 0, 100};
  result.control.resize(2);
  result.control[0] = {{10.5, 20.25, 30}, symmetric<Eigen::Matrix3d>(3), {{0.1, 0.2}, {nan, nan}}, {1, 0}};
  result.control[1] = {{nan, nan, nan}, symmetric<Eigen::Matrix3d>(0), {}};
  result.variance_factor = 1.0625;
  result.chi2 = 12345.678;
  result.degrees_of_freedom = 5000000000;
  result.image_sigma_px = 0.31;
  result.sigma_scaled = true;
  result.global_iterations = 4;
  result.newton_decrement = 1e-8;
  result.decrement_limit = 0.01;
  result.free_parts = {{FrameIndex(0), 7}, {FrameIndex(1), 4}};
  result.positions_aside = {FrameIndex(1)};
  result.control_aside = {0};
  result.position_scales = {{RigIndex(0), 3.5, 1}};
  for (std::size_t i = 0; i < result.block.images.size(); ++i)
    result.image_records.push_back({640, 480 + static_cast<int>(i), 100, 3, 70});
  result.provenance = {
      "p.yaml", "megablock 0.1.0", "avx2", {{"merge.decrement", "0.1", "0.01"}, {"tiles.min_tiles", "4", "4"}}};
  result.gauge = "fixed by priors";
  result.seams = {{2, 10.5, 12, 40.25, ""}, {3, 99, 12, 40.25, "tile 1 is suspected"}};
  result.failures = {{"features", "3.jpg", "truncated JPEG"}};
  result.stages = {{"features", 1.5, 300.25, 4, 1}, {"merge", 0.25, 100, 1, 0}};
  result.notes = {"one image has its GPS position at 0, 0"};
  result.digest = result_digest(result);
  return result;
}

TEST(ResultFile, EverythingComesBack) {
  const ScratchDirectory scratch;
  const BlockResult result = example_result();
  write_result(scratch.path("block.h5"), result);
  const BlockResult back = read_result(scratch.path("block.h5"));
  EXPECT_EQ(back.block.images.size(), result.block.images.size());
  EXPECT_EQ(back.block.frames[FrameIndex(3)].name, "frame 3");
  EXPECT_EQ(back.state.oriented, result.state.oriented);
  for (FrameIndex f(0); result.state.frames.contains(f); ++f.value) {
    EXPECT_TRUE(same_bits(back.state.frames[f], result.state.frames[f]));
    EXPECT_EQ(back.frame_covariance[f], result.frame_covariance[f]);
  }
  for (CameraIndex c(0); result.state.cameras.contains(c); ++c.value) {
    EXPECT_EQ(back.state.cameras[c], result.state.cameras[c]);
    EXPECT_EQ(back.camera_covariance[c], result.camera_covariance[c]);
  }
  EXPECT_EQ(back.mount_covariance, result.mount_covariance);
  EXPECT_TRUE(back.aligned_covariance == result.aligned_covariance);
  EXPECT_EQ(back.joint_covariance.frames, result.joint_covariance.frames);
  EXPECT_EQ(back.joint_covariance.matrix, result.joint_covariance.matrix);
  EXPECT_TRUE(back.empirical.frame_covariance == result.empirical.frame_covariance);
  EXPECT_TRUE(back.empirical.aligned_covariance.empty());
  EXPECT_TRUE(back.empirical.camera_covariance == result.empirical.camera_covariance);
  EXPECT_EQ(back.empirical.mount_covariance, result.empirical.mount_covariance);
  EXPECT_EQ(back.boundary, result.boundary);
  EXPECT_EQ(back.tiles.tile_of_frame, result.tiles.tile_of_frame);
  ASSERT_EQ(back.position_scales.size(), 1u);
  EXPECT_EQ(back.position_scales[0].group, RigIndex(0));
  EXPECT_EQ(back.position_scales[0].horizontal, 3.5);
  EXPECT_EQ(back.position_scales[0].height, 1);
  EXPECT_EQ(back.tracks.id, result.tracks.id);
  EXPECT_EQ(back.tracks.begin, result.tracks.begin);
  EXPECT_EQ(back.tracks.image, result.tracks.image);
  EXPECT_EQ(back.tracks.x, result.tracks.x);
  EXPECT_EQ(back.tracks.y, result.tracks.y);
  EXPECT_EQ(back.tracks.feature, result.tracks.feature);
  EXPECT_EQ(back.kept, result.kept);
  EXPECT_EQ(back.residual_x, result.residual_x);
  EXPECT_EQ(back.residual_y, result.residual_y);
  ASSERT_EQ(back.points.size(), 3u);
  for (std::size_t p = 0; p < 3; ++p) EXPECT_TRUE(same_bits(back.points[p], result.points[p]));
  EXPECT_LT((back.point_covariance[2] - result.point_covariance[2]).norm(), 1e-6);  // stored in single precision
  ASSERT_EQ(back.control.size(), 2u);
  EXPECT_EQ(back.control[0].adjusted, result.control[0].adjusted);
  EXPECT_EQ(back.control[0].covariance, result.control[0].covariance);
  EXPECT_EQ(back.control[0].residual_px[0], result.control[0].residual_px[0]);
  EXPECT_TRUE(back.control[0].residual_px[1].hasNaN());
  EXPECT_EQ(back.control[0].kept, result.control[0].kept);
  EXPECT_TRUE(back.control[1].residual_px.empty());
  EXPECT_EQ(back.variance_factor, result.variance_factor);
  EXPECT_EQ(back.chi2, result.chi2);
  EXPECT_EQ(back.degrees_of_freedom, result.degrees_of_freedom);
  EXPECT_EQ(back.image_sigma_px, 0.31);
  EXPECT_TRUE(back.sigma_scaled);
  EXPECT_EQ(back.global_iterations, 4);
  EXPECT_EQ(back.newton_decrement, result.newton_decrement);
  EXPECT_EQ(back.decrement_limit, result.decrement_limit);
  EXPECT_EQ(back.positions_aside, result.positions_aside);
  EXPECT_EQ(back.control_aside, result.control_aside);
  ASSERT_EQ(back.free_parts.size(), 2u);
  EXPECT_EQ(back.free_parts[1].frame, FrameIndex(1));
  EXPECT_EQ(back.free_parts[1].defect, 4);
  ASSERT_EQ(back.image_records.size(), result.image_records.size());
  EXPECT_EQ(back.image_records[ImageIndex(1)].height, 481);
  EXPECT_EQ(back.image_records[ImageIndex(1)].features, 100);
  EXPECT_EQ(back.image_records[ImageIndex(1)].matched_images, 3);
  EXPECT_EQ(back.image_records[ImageIndex(1)].matches, 70);
  EXPECT_EQ(back.provenance.project, "p.yaml");
  EXPECT_EQ(back.provenance.program, "megablock 0.1.0");
  EXPECT_EQ(back.provenance.arithmetic, "avx2");
  ASSERT_EQ(back.provenance.options.size(), 2u);
  EXPECT_EQ(back.provenance.options[0].name, "merge.decrement");
  EXPECT_EQ(back.provenance.options[0].value, "0.1");
  EXPECT_EQ(back.provenance.options[0].default_value, "0.01");
  EXPECT_EQ(back.gauge, result.gauge);
  ASSERT_EQ(back.seams.size(), 2u);
  EXPECT_EQ(back.seams[1].statistic, 99);
  EXPECT_EQ(back.seams[1].note, "tile 1 is suspected");
  ASSERT_EQ(back.failures.size(), 1u);
  EXPECT_EQ(back.failures[0].reason, "truncated JPEG");
  ASSERT_EQ(back.stages.size(), 2u);
  EXPECT_EQ(back.stages[0].peak_rss_mib, 300.25);
  EXPECT_EQ(back.stages[0].failed, 1);
  EXPECT_EQ(back.notes, result.notes);
  EXPECT_EQ(back.digest, result.digest);
  EXPECT_EQ(result_digest(back), result.digest);
}

TEST(ResultFile, EmptyResultComesBack) {
  const ScratchDirectory scratch;
  BlockResult empty;
  empty.tracks.begin = {0};
  write_result(scratch.path("block.h5"), empty);
  const BlockResult back = read_result(scratch.path("block.h5"));
  EXPECT_TRUE(back.points.empty());
  EXPECT_TRUE(back.frame_covariance.empty());
  EXPECT_TRUE(back.mount_covariance.empty());
  EXPECT_EQ(result_digest(back), result_digest(empty));
}

TEST(ResultFile, ContradictingLengthsAreRefused) {
  const ScratchDirectory scratch;
  BlockResult result = example_result();
  result.kept.pop_back();
  EXPECT_THROW(write_result(scratch.path("block.h5"), result), ComputeError);
  result = example_result();
  result.mount_covariance[RigIndex(0)].pop_back();
  EXPECT_THROW(write_result(scratch.path("block.h5"), result), ComputeError);
  result.mount_covariance.clear();
  EXPECT_NO_THROW(write_result(scratch.path("block.h5"), result));
  EXPECT_TRUE(read_result(scratch.path("block.h5")).mount_covariance.empty());
}

void flip_last_bit(double& value) {
  std::uint64_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  bits ^= 1;
  std::memcpy(&value, &bits, sizeof bits);
}

TEST(ResultDigest, ChangesWithOneBitOfAnything) {
  const std::string digest = result_digest(example_result());
  const auto digest_after = [](auto change) {
    BlockResult result = example_result();
    change(result);
    return result_digest(result);
  };
  EXPECT_EQ(digest_after([](BlockResult&) {}), digest);
  EXPECT_NE(digest_after([](BlockResult& r) { flip_last_bit(r.state.frames[FrameIndex(0)].rotation.z()); }), digest);
  EXPECT_NE(digest_after([](BlockResult& r) { flip_last_bit(r.state.frames[FrameIndex(2)].centre.y()); }), digest);
  EXPECT_NE(digest_after([](BlockResult& r) { flip_last_bit(r.state.cameras[CameraIndex(1)][kRadial3]); }), digest);
  EXPECT_NE(digest_after([](BlockResult& r) { flip_last_bit(r.state.mounts[RigIndex(0)][1].centre.x()); }), digest);
  EXPECT_NE(digest_after([](BlockResult& r) { flip_last_bit(r.points[2].x()); }), digest);
  EXPECT_NE(digest_after([](BlockResult& r) { r.tracks.x[0] ^= 1; }), digest);
  EXPECT_NE(digest_after([](BlockResult& r) { r.kept[3] = 1; }), digest);
  EXPECT_NE(digest_after([](BlockResult& r) { r.state.oriented[FrameIndex(1)] = 1; }), digest);
}

TEST(ResultDigest, IgnoresWhatIsNoResult) {
  BlockResult result = example_result();
  result.stages[0].seconds = 77;
  result.tracks.x[3] ^= 1;                            // of a rejected observation
  result.state.frames[FrameIndex(3)].centre.x() = 5;  // not oriented
  result.frame_covariance.clear();
  EXPECT_EQ(result_digest(result), example_result().digest);
}

TEST(ResultDigest, IgnoresTheOrderInWhichTilesDeliverTracks) {
  BlockResult result = example_result(), other = result;
  // The last track (two observations) first.
  other.tracks.id = {result.tracks.id[2], result.tracks.id[0], result.tracks.id[1]};
  other.points = {result.points[2], result.points[0], result.points[1]};
  other.tracks.begin = {0, 2, 4, 7};
  const auto rotate = [](auto& values) { std::rotate(values.begin(), values.end() - 2, values.end()); };
  rotate(other.tracks.image);
  rotate(other.tracks.x);
  rotate(other.tracks.y);
  rotate(other.kept);
  EXPECT_EQ(result_digest(other), result_digest(result));
}

TEST(Reprojection, MeansOverKeptObservationsOfTriangulatedPoints) {
  // Residual lengths of kept observations: 5, 1 (first point) and 1 (third); the second point has no position.
  const ReprojectionStatistics statistics = reprojection_statistics(example_result());
  EXPECT_EQ(statistics.observations, 3);
  EXPECT_EQ(statistics.points, 2);
  EXPECT_EQ(statistics.oriented_images, 3);  // frames 0 (two images) and 2
  EXPECT_DOUBLE_EQ(statistics.mean_px, 7.0 / 3);
  EXPECT_DOUBLE_EQ(statistics.rms_px, 3.0);
  EXPECT_DOUBLE_EQ(statistics.mean_track_length, 1.5);
}

TEST(Reprojection, NothingOrientedGivesZeros) {
  const ReprojectionStatistics statistics = reprojection_statistics(BlockResult{});
  EXPECT_EQ(statistics.observations, 0);
  EXPECT_EQ(statistics.mean_px, 0);
}

TEST(ControlResult, TakesPartWithOneMeasurement) {
  const Eigen::Vector2d seen(0.1, -0.2), unseen = Eigen::Vector2d::Constant(std::nan(""));
  const auto takes_part = [](std::vector<Eigen::Vector2d> residuals, std::vector<std::uint8_t> kept) {
    return BlockResult::ControlResult{{1, 2, 3}, Eigen::Matrix3d::Identity(), residuals, kept}.takes_part();
  };
  EXPECT_TRUE(takes_part({unseen, seen}, {}));
  EXPECT_TRUE(takes_part({seen, seen}, {0, 1}));
  EXPECT_FALSE(takes_part({seen, unseen}, {0, 1}));
  EXPECT_FALSE(takes_part({unseen}, {}));
  EXPECT_FALSE(takes_part({}, {}));
}

}  // namespace
}  // namespace megablock
