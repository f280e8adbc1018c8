#include "io/simulate/blocks/simulate.h"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "geometry/numbers/angles.h"
#include "geometry/transform/rotation.h"
#include "io/base/error.h"
#include "io/simulate/images/texture.h"

namespace megablock {
namespace {

SimulationOptions aerial_options() {
  SimulationOptions options;
  options.frames = 120;
  options.points_per_frame = 200;
  return options;
}

SimulationOptions street_options() {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 300;
  options.points_per_frame = 200;
  options.image_height = 1080;
  options.relative_position_sigma_m = 0.01;
  return options;
}

class SimulateTest : public testing::TestWithParam<SimulationOptions> {};

Eigen::Vector3d in_camera(const SimulatedBlock& s, ImageIndex image, const Eigen::Vector3d& point) {
  const Image& entry = s.block.images[image];
  const Pose& mount = s.truth.mounts[s.block.frames[entry.frame].rig][static_cast<std::size_t>(entry.mount)];
  return to_camera(s.truth.frames[entry.frame], mount, point);
}

// Residuals of the truth have the stated noise: their normalised square sum is chi-square distributed.
TEST_P(SimulateTest, TruthLeavesTheStatedNoise) {
  const SimulatedBlock s = simulate_block(GetParam());
  double chi2 = 0, n = 0;
  for (std::size_t t = 0; t < s.points.size(); ++t)
    for (auto o = static_cast<std::size_t>(s.tracks.begin[t]); o < static_cast<std::size_t>(s.tracks.begin[t + 1]);
         ++o) {
      const ImageIndex image = s.tracks.image[o];
      const Camera& camera = s.block.cameras[s.block.camera_of(image)];
      const Eigen::Vector2d measured(from_fixed_pixel(s.tracks.x[o]), from_fixed_pixel(s.tracks.y[o]));
      ASSERT_TRUE(measured.x() >= 0 && measured.x() <= camera.width && measured.y() >= 0 &&
                  measured.y() <= camera.height);
      const Eigen::Vector3d inside = in_camera(s, image, s.points[t]);
      ASSERT_GT(inside.z(), 0);
      const Eigen::Vector2d residual = project(s.truth.cameras[s.block.camera_of(image)], inside) - measured;
      chi2 += (residual / GetParam().image_noise_px).squaredNorm();
      n += 2;
    }
  EXPECT_NEAR(chi2 / n, 1, 5 * std::sqrt(2 / n));
}

TEST_P(SimulateTest, TracksAreWellFormed) {
  const SimulatedBlock s = simulate_block(GetParam());
  ASSERT_EQ(s.tracks.track_count(), std::ssize(s.points));
  ASSERT_EQ(s.tracks.begin.size(), s.points.size() + 1);
  ASSERT_EQ(s.outlier.size(), s.tracks.image.size());
  for (std::size_t t = 0; t < s.points.size(); ++t) {
    ASSERT_EQ(s.tracks.id[t].value, static_cast<std::int64_t>(t));
    const auto begin = s.tracks.image.begin() + s.tracks.begin[t], end = s.tracks.image.begin() + s.tracks.begin[t + 1];
    ASSERT_TRUE(std::is_sorted(begin, end));
    ASSERT_EQ(std::adjacent_find(begin, end), end);
    ASSERT_NE(s.block.images[*begin].frame, s.block.images[*(end - 1)].frame);  // seen from two places
  }
}

TEST_P(SimulateTest, CountsAreAsAsked) {
  const SimulatedBlock s = simulate_block(GetParam());
  ASSERT_EQ(std::ssize(s.block.frames), GetParam().frames);
  std::vector<std::int64_t> count(s.block.frames.size(), 0);
  for (const ImageIndex image : s.tracks.image) ++count[static_cast<std::size_t>(s.block.images[image].frame.value)];
  const double observations = static_cast<double>(s.tracks.observation_count());
  EXPECT_NEAR(observations / static_cast<double>(s.tracks.track_count()), GetParam().mean_track,
              0.08 * GetParam().mean_track);
  EXPECT_NEAR(observations / static_cast<double>(GetParam().frames), GetParam().points_per_frame,
              0.12 * GetParam().points_per_frame);
  EXPECT_GE(*std::min_element(count.begin(), count.end()), 0.9 * GetParam().points_per_frame);
  EXPECT_LE(*std::max_element(count.begin(), count.end()), 1.8 * GetParam().points_per_frame);
}

TEST_P(SimulateTest, SeedDecidesEverything) {
  SimulationOptions options = GetParam();
  options.frames = 40;
  const SimulatedBlock a = simulate_block(options), b = simulate_block(options);
  EXPECT_EQ(a.tracks.x, b.tracks.x);
  EXPECT_EQ(a.tracks.image, b.tracks.image);
  EXPECT_EQ(a.points, b.points);
  options.seed = 2;
  const SimulatedBlock c = simulate_block(options);
  EXPECT_NE(a.tracks.x, c.tracks.x);
  EXPECT_NE(a.truth.frames.front().centre, c.truth.frames.front().centre);
}

TEST_P(SimulateTest, ThreadsDecideNothing) {
  SimulationOptions options = GetParam();
  options.frames = 150;  // groups of 64 frames, the last one smaller
  options.outlier_share = 0.1;
  const int before = omp_get_max_threads();
  omp_set_num_threads(1);
  const SimulatedBlock alone = simulate_block(options);
  omp_set_num_threads(3);
  const SimulatedBlock together = simulate_block(options);
  omp_set_num_threads(before);
  EXPECT_EQ(alone.tracks.begin, together.tracks.begin);
  EXPECT_EQ(alone.tracks.image, together.tracks.image);
  EXPECT_EQ(alone.tracks.x, together.tracks.x);
  EXPECT_EQ(alone.tracks.y, together.tracks.y);
  EXPECT_EQ(alone.outlier, together.outlier);
  EXPECT_EQ(alone.points, together.points);
}

// Root mean square of a list of normalised 3-vectors per axis; 1 when the stated sigmas are true.
double rms(const std::vector<Eigen::Vector3d>& normalised) {
  double sum = 0;
  for (const Eigen::Vector3d& v : normalised) sum += v.squaredNorm() / 3;
  return std::sqrt(sum / static_cast<double>(normalised.size()));
}

// `chain`: frames of a stretch; 0: whole passes.
void expect_integrated_start(SimulationOptions options, int chain) {
  options.relative_position_sigma_m = 0.02;
  const SimulatedBlock before = simulate_block(options);
  options.start_offset_m = 2;
  options.start_chain_frames = chain;
  const SimulatedBlock s = simulate_block(options);
  const auto start = [&](FrameIndex f) { return *s.block.frames[f].given_pose; };
  std::map<FrameIndex, const RelativePose*> relative_to;
  for (std::size_t i = 0; i < s.block.relative_poses.size(); ++i) {
    relative_to[s.block.relative_poses[i].to] = &s.block.relative_poses[i];
    ASSERT_EQ(s.block.relative_poses[i].pose.centre, before.block.relative_poses[i].pose.centre)
        << "no other quantity is disturbed";
  }
  int length = 0;
  for (FrameIndex f(0); s.block.frames.contains(f); ++f.value, ++length) {
    const auto linked = relative_to.find(f);
    if (linked != relative_to.end() && (chain == 0 || length < chain)) {
      const Pose a = start(linked->second->from), b = start(f), &r = linked->second->pose;
      ASSERT_LT((a.rotation * (b.centre - a.centre) - r.centre).norm(), 1e-9);
      ASSERT_LT((a.rotation.conjugate() * r.rotation.conjugate() * b.rotation).vec().norm(), 1e-9);
      continue;
    }
    length = 0;
    const double offset = (start(f).centre - s.truth.frames[f].centre).norm();
    EXPECT_LE(offset, 2);
    EXPECT_GT(offset, 0);
    EXPECT_EQ(start(f).rotation.coeffs(), s.truth.frames[f].rotation.coeffs());
  }
}

TEST_P(SimulateTest, GivenPosesAreTheIntegratedRelativePosesWithOffsets) {
  expect_integrated_start(GetParam(), 12);
  expect_integrated_start(GetParam(), 0);
}

TEST_P(SimulateTest, PriorsHaveTheStatedNoise) {
  SimulationOptions options = GetParam();
  options.attitude_sigma_deg = 0.3;
  options.relative_position_sigma_m = 0.02;
  options.gps_share = 0.5;
  const SimulatedBlock s = simulate_block(options);
  std::vector<Eigen::Vector3d> position, attitude, turn, step, start;
  for (std::size_t i = 0; i < s.block.frames.size(); ++i) {
    const FrameIndex index(static_cast<std::int64_t>(i));
    const Frame& frame = s.block.frames[index];
    const Pose& truth = s.truth.frames[index];
    if (frame.position_prior) {
      const PositionPrior& p = *frame.position_prior;
      ASSERT_DOUBLE_EQ(p.sigma.x(), options.gps_sigma_m);
      const Eigen::Vector3d antenna = truth.centre + truth.rotation.conjugate() * p.lever_arm;
      position.push_back((antenna - p.position).cwiseQuotient(p.sigma));
    }
    ASSERT_TRUE(frame.attitude_prior && frame.given_pose);
    const Eigen::Quaterniond error = truth.rotation * frame.attitude_prior->rotation_cw.conjugate();
    attitude.push_back(rotation_log<double>(error).cwiseQuotient(frame.attitude_prior->sigma_rad));
    start.push_back((frame.given_pose->centre - truth.centre) / options.start_position_error_m);
  }
  std::int64_t breaks = 0;
  for (std::size_t i = 1; i < s.block.frames.size(); ++i)
    breaks += s.block.frames[FrameIndex(static_cast<std::int64_t>(i))].pass !=
              s.block.frames[FrameIndex(static_cast<std::int64_t>(i) - 1)].pass;
  ASSERT_EQ(std::ssize(s.block.relative_poses), options.frames - 1 - breaks);
  for (const RelativePose& r : s.block.relative_poses) {
    ASSERT_EQ(s.block.frames[r.from].pass, s.block.frames[r.to].pass);
    const Pose &a = s.truth.frames[r.from], &b = s.truth.frames[r.to];
    turn.push_back(rotation_log<double>(b.rotation * a.rotation.conjugate() * r.pose.rotation.conjugate()) /
                   r.rotation_sigma_rad);
    step.push_back((a.rotation * (b.centre - a.centre) - r.pose.centre) / r.position_sigma_m);
    ASSERT_DOUBLE_EQ(r.rotation_sigma_rad, options.relative_rotation_sigma_deg * kDegree);
  }
  EXPECT_EQ(std::ssize(position), options.frames / 2);
  EXPECT_NEAR(rms(position), 1, 0.2);
  EXPECT_NEAR(rms(attitude), 1, 0.15);
  EXPECT_NEAR(rms(turn), 1, 0.15);
  EXPECT_NEAR(rms(step), 1, 0.15);
  EXPECT_NEAR(rms(start), 1, 0.5);  // correlated along the passes
}

TEST_P(SimulateTest, ControlIsMeasuredWithItsNoise) {
  SimulationOptions options = GetParam();
  options.control_points = 30;
  options.check_points = 15;
  const SimulatedBlock s = simulate_block(options);
  ASSERT_EQ(s.block.control_points.size(), s.control_truth.size());
  ASSERT_GE(s.control_truth.size(), 44u);
  double chi2 = 0, n = 0;
  std::int64_t control = 0;
  std::vector<Eigen::Vector3d> position;
  for (std::size_t p = 0; p < s.control_truth.size(); ++p) {
    const ControlPoint& point = s.block.control_points[p];
    control += point.role == PointRole::kControl;
    position.push_back((point.position - s.control_truth[p]).cwiseQuotient(point.sigma));
    ASSERT_GE(point.measurements.size(), 2u);
    for (const ImageMeasurement& m : point.measurements) {
      const Eigen::Vector3d inside = in_camera(s, m.image, s.control_truth[p]);
      ASSERT_GT(inside.z(), 0);
      chi2 += ((project(s.truth.cameras[s.block.camera_of(m.image)], inside) - m.pixel) / m.sigma_px).squaredNorm();
      n += 2;
    }
  }
  EXPECT_NEAR(static_cast<double>(control), 2.0 / 3 * static_cast<double>(s.control_truth.size()), 1.5);
  EXPECT_NEAR(chi2 / n, 1, 5 * std::sqrt(2 / n));
  EXPECT_NEAR(rms(position), 1, 0.3);
}

TEST_P(SimulateTest, OutliersHaveTheirShareAndLeaveTheOthersAlone) {
  SimulationOptions options = GetParam();
  options.frames = 60;
  options.outlier_share = 0.05;
  const SimulatedBlock s = simulate_block(options);
  const auto n = static_cast<double>(s.outlier.size());
  double share = 0;
  std::int64_t wrong_inlier = 0, right_outlier = 0;
  for (std::size_t t = 0; t < s.points.size(); ++t)
    for (auto o = static_cast<std::size_t>(s.tracks.begin[t]); o < static_cast<std::size_t>(s.tracks.begin[t + 1]);
         ++o) {
      const ImageIndex image = s.tracks.image[o];
      const Eigen::Vector2d measured(from_fixed_pixel(s.tracks.x[o]), from_fixed_pixel(s.tracks.y[o]));
      const double error =
          (project(s.truth.cameras[s.block.camera_of(image)], in_camera(s, image, s.points[t])) - measured).norm();
      share += s.outlier[o] / n;
      wrong_inlier += !s.outlier[o] && error > 6 * options.image_noise_px;
      right_outlier += s.outlier[o] && error < 6 * options.image_noise_px;
    }
  EXPECT_NEAR(share, 0.05, 5 * std::sqrt(0.05 * 0.95 / n));
  EXPECT_EQ(wrong_inlier, 0);
  EXPECT_LE(right_outlier, 2);
}

TEST_P(SimulateTest, CamerasStartNominalUnlessHeld) {
  SimulationOptions options = GetParam();
  options.frames = 20;
  for (const bool calibrate : {true, false}) {
    options.calibrate = calibrate;
    const SimulatedBlock s = simulate_block(options);
    for (std::size_t c = 0; c < s.block.cameras.size(); ++c) {
      const CameraIndex index(static_cast<std::int64_t>(c));
      const Camera& camera = s.block.cameras[index];
      EXPECT_NE(s.truth.cameras[index][kRadial1], 0);
      EXPECT_EQ(camera.intrinsics == s.truth.cameras[index], !calibrate);
      EXPECT_EQ(camera.prior_sigma[kFocal] > 0, calibrate);
    }
  }
}

// An affinity is drawn last, so that the block is the same otherwise.
TEST_P(SimulateTest, CamerasHaveAnAffinityWhenAsked) {
  SimulationOptions options = GetParam(), with = options;
  options.frames = with.frames = 20;
  with.affinity = 0.002;
  const SimulatedBlock plain = simulate_block(options), s = simulate_block(with);
  for (std::size_t c = 0; c < s.block.cameras.size(); ++c) {
    const CameraIndex index(static_cast<std::int64_t>(c));
    const Intrinsics &truth = s.truth.cameras[index], &before = plain.truth.cameras[index];
    for (int p = 0; p < kAffinity; ++p) EXPECT_EQ(truth[p], before[p]);
    for (const int p : {kAffinity, kSkew}) {
      EXPECT_EQ(before[p], 0);
      EXPECT_NE(truth[p], 0);
      EXPECT_LE(std::abs(truth[p]), 0.002 * options.focal_px);
      EXPECT_EQ(s.block.cameras[index].intrinsics[p], 0);
      EXPECT_GT(s.block.cameras[index].prior_sigma[static_cast<std::size_t>(p)], 0);
      EXPECT_EQ(plain.block.cameras[index].prior_sigma[static_cast<std::size_t>(p)], 0);
    }
  }
}

// Share of an image's ground footprint that its neighbour sees, from the distances of the projection centres.
TEST(SimulateAerial, OverlapsAreAsAsked) {
  SimulationOptions options = aerial_options();
  options.frames = 200;
  options.forward_overlap = 0.7;
  options.side_overlap = 0.4;
  const SimulatedBlock s = simulate_block(options);
  double along = 0, n = 0, first = 0, second = 0, n_first = 0, n_second = 0;
  for (std::size_t i = 0; i < s.block.frames.size(); ++i) {
    const FrameIndex f(static_cast<std::int64_t>(i));
    const Pose& pose = s.truth.frames[f];
    const Eigen::Vector3d view = pose.rotation.conjugate() * Eigen::Vector3d::UnitZ();
    EXPECT_LT(view.z(), -std::cos(6 * kDegree));  // nadir
    if (s.block.frames[f].pass == 0) first += pose.centre.y(), ++n_first;
    if (s.block.frames[f].pass == 1) second += pose.centre.y(), ++n_second;
    const FrameIndex next(f.value + 1);
    if (!s.block.frames.contains(next) || s.block.frames[next].pass != s.block.frames[f].pass) continue;
    along += std::abs(s.truth.frames[next].centre.x() - pose.centre.x());
    ++n;
  }
  const double scale = options.height_m / options.focal_px;
  EXPECT_NEAR(1 - along / n / (scale * options.image_height), 0.7, 0.01);
  EXPECT_NEAR(1 - (second / n_second - first / n_first) / (scale * options.image_width), 0.4, 0.02);
}

TEST(SimulateStreet, PassesShareTracksAndPointsAreNear) {
  const SimulatedBlock s = simulate_block(street_options());
  std::int64_t shared = 0;
  for (std::size_t t = 0; t < s.points.size(); ++t) {
    bool pass[2] = {false, false};
    for (auto o = s.tracks.begin[t]; o < s.tracks.begin[t + 1]; ++o) {
      const FrameIndex frame = s.block.images[s.tracks.image[static_cast<std::size_t>(o)]].frame;
      ASSERT_LT((s.truth.frames[frame].centre - s.points[t]).norm(), 41);
      pass[s.block.frames[frame].pass] = true;
    }
    shared += pass[0] && pass[1];
  }
  EXPECT_GT(shared, s.tracks.track_count() / 10);
  EXPECT_LT(shared, s.tracks.track_count() / 2);
  // Cameras around the compass: the viewing directions of a level rig sum to nearly nothing.
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Pose& mount : s.truth.mounts.front()) sum += mount.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  EXPECT_LT(sum.norm(), 0.2);
}

TEST(SimulateOptions, NonsenseIsRefused) {
  SimulationOptions options;
  options.frames = 1;
  EXPECT_THROW(simulate_block(options), InputError);
  options = {};
  options.mean_track = 1;
  EXPECT_THROW(simulate_block(options), InputError);
  options = {};
  options.outlier_share = 1.5;
  EXPECT_THROW(simulate_block(options), InputError);
  options = {};
  options.terrain_relief_m = 1000;
  EXPECT_THROW(simulate_block(options), InputError);
}

TEST(SimulateOptions, NumbersBeyondAnyBlockAreRefused) {
  using O = SimulationOptions;
  for (double O::*number :
       {&O::height_m, &O::street_spacing_m, &O::drift_m, &O::drift_per_frame_m, &O::mount_position_error_m,
        &O::panorama_radius_m, &O::gps_sigma_m, &O::attitude_sigma_deg, &O::relative_position_sigma_m,
        &O::relative_rotation_sigma_deg, &O::start_offset_m, &O::control_sigma_m, &O::focal_px}) {
    for (const double value : {1e300, std::numeric_limits<double>::quiet_NaN()}) {
      O options;
      options.*number = value;
      EXPECT_THROW(options.check(), InputError) << value;
    }
  }
  for (int O::*number : {&O::control_points, &O::check_points, &O::points_per_frame, &O::image_width}) {
    O options;
    options.*number = 2'000'000'000;
    EXPECT_THROW(options.check(), InputError);
  }
  O options;
  options.frames = std::int64_t{1} << 60;
  EXPECT_THROW(options.check(), InputError);
}

INSTANTIATE_TEST_SUITE_P(Scenes, SimulateTest, testing::Values(aerial_options(), street_options()),
                         [](const auto& scene) { return scene.index == 0 ? "aerial" : "street"; });

}  // namespace
}  // namespace megablock
