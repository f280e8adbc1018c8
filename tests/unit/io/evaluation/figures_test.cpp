#include "io/evaluation/figures.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "tests/support/io/image_names.h"
#include "tests/support/io/made_up_result.h"

namespace megablock {
namespace {

TEST(Figures, GnssResidualsApplyTheLeverArm) {
  BlockResult result = made_up_result(small_block());
  const Eigen::Vector3d lever(0.3, -0.2, 1.1), error(0.01, -0.02, 0.05);
  for (FrameIndex f(0); result.block.frames.contains(f); ++f.value) {
    const Pose& pose = result.state.frames[f];
    result.block.frames[f].position_prior =
        PositionPrior{pose.centre + pose.rotation.toRotationMatrix().transpose() * lever - error,
                      Eigen::Vector3d::Constant(0.05), lever};
  }
  const report::Figures figures = report::figures_of(result);
  ASSERT_EQ(figures.positions.size(), 59u);  // one frame is not oriented
  for (const auto& residual : figures.positions) EXPECT_LT((residual.difference - error).norm(), 1e-9);
}

TEST(Figures, IntersectionAnglesAndTrackLengths) {
  BlockResult result;  // two images 2 m apart, a point 1 m in front: rays cross at a right angle
  Camera camera;
  camera.name = "camera";
  camera.width = camera.height = 100;
  camera.intrinsics = {100, 50, 50, 0, 0, 0, 0, 0};
  result.block.cameras.push_back(camera);
  result.block.rigs.push_back({"rig", {Mount{CameraIndex(0), Pose{}, 0, 0}}});
  for (int i = 0; i < 2; ++i) {
    result.block.frames.push_back({});
    result.block.frames.back().rig = RigIndex(0);
    result.block.add_image(std::to_string(i), {FrameIndex(i), 0, 0});
    result.state.frames.push_back({Eigen::Quaterniond::Identity(), Eigen::Vector3d(2.0 * i, 0, 0)});
    result.state.oriented.push_back(1);
  }
  result.state.cameras.push_back(result.block.cameras[CameraIndex(0)].intrinsics);
  result.state.mounts.push_back({Pose{}});
  result.tracks = {{TrackIndex(0)}, {0, 2}, {ImageIndex(0), ImageIndex(1)}, {102400, 0}, {51200, 51200}, {-1, -1}};
  result.points = {Eigen::Vector3d(1, 0, 1)};
  result.kept = {1, 1};
  result.residual_x = {3, 0};
  result.residual_y = {4, 0};
  const report::Figures figures = report::figures_of(result);
  EXPECT_EQ(figures.track_length.bins[0], 1);
  EXPECT_EQ(figures.intersection_deg.total(), 1);
  EXPECT_EQ(figures.intersection_deg.bins[17] + figures.intersection_deg.bins[18], 1);  // 90 degrees, to rounding
  EXPECT_NEAR(figures.ground_resolution_m, std::sqrt(2.0) / 100, 1e-12);
  EXPECT_DOUBLE_EQ(figures.reprojection.mean_px, 2.5);
  const report::ResidualField& field = figures.fields[CameraIndex(0)];
  EXPECT_EQ(field.observations, 2);
  EXPECT_EQ(field.mean(field.rows / 2, field.columns - 1), Eigen::Vector2d(3, 4));
}

TEST(Figures, AttitudeResidualsAboutTheAxesOfTheCamera) {
  BlockResult result = made_up_result(small_block());
  for (Frame& frame : result.block.frames) frame.attitude_prior.reset();
  const Eigen::Vector3d turn(0.01, -0.02, 0.03);  // radians, about the camera's axes
  AttitudePrior prior;
  prior.rotation_cw = rotation_exp<double>(-turn) * result.state.frames[FrameIndex(7)].rotation;
  result.block.frames[FrameIndex(7)].attitude_prior = prior;
  const report::Figures figures = report::figures_of(result);
  ASSERT_EQ(figures.attitudes.size(), 1u);
  EXPECT_EQ(figures.attitudes[0].frame, FrameIndex(7));
  EXPECT_LT((figures.attitudes[0].difference - turn).norm(), 1e-12);
}

TEST(Figures, ResidualsOfImagesAndMeasurements) {
  BlockResult result = made_up_result(small_block());
  result.control[0].residual_px[0] = {1.0, -2.0};
  result.block.control_points[0].measurements[0].sigma_px = 0.4;
  const report::Figures figures = report::figures_of(result);
  EXPECT_EQ(figures.measurements[0].point, 0u);
  EXPECT_DOUBLE_EQ(figures.measurements[0].ratio, 5);
  double squares = 0;
  std::int64_t n = 0, all = 0;
  for (std::size_t o = 0; o < result.tracks.image.size(); ++o) {
    if (result.tracks.image[o] != ImageIndex(11)) continue;
    ++all;
    if (!result.kept[o]) continue;
    ++n;
    squares += std::pow(result.residual_x[o], 2) + std::pow(result.residual_y[o], 2);
  }
  EXPECT_EQ(figures.measured[ImageIndex(11)], all);
  EXPECT_EQ(figures.observations[ImageIndex(11)], n);
  EXPECT_NEAR(report::image_rms(figures, ImageIndex(11)), std::sqrt(squares / static_cast<double>(n)), 1e-9);
}

TEST(Figures, HistogramsAndSpreads) {
  report::Histogram histogram{0, 2, {0, 0, 0}};
  for (double v : {-1.0, 0.0, 1.9, 2.0, 5.0, 99.0, std::nan("")}) histogram.add(v);
  EXPECT_THAT(histogram.bins, testing::ElementsAre(3, 1, 2));
  std::vector<double> values;
  for (int i = 100; i >= 0; --i) values.push_back(i);
  const report::Spread spread = report::spread(values);
  EXPECT_EQ(spread.median, 50);
  EXPECT_EQ(spread.p95, 95);
  EXPECT_EQ(spread.largest, 100);
  EXPECT_TRUE(std::isnan(report::spread({}).median));
}

}  // namespace
}  // namespace megablock
