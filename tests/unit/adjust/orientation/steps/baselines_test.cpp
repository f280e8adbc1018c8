#include "adjust/orientation/steps/baselines.h"

#include <gtest/gtest.h>

#include "adjust/orientation/steps/global_positioning.h"
#include "adjust/orientation/steps/ground_alignment.h"
#include "adjust/orientation/steps/resection.h"
#include "adjust/orientation/steps/track_intersection.h"
#include "tests/support/adjust/orientation_scene.h"

namespace megablock {
namespace {

using namespace orientation_scene;

// A camera driven along the x axis looking forward and a little aside: all centres on one line.
struct Line {
  SimulatedBlock scene;
  OrientationGraph graph;
  std::vector<Eigen::Vector3d> rays;
  std::vector<std::optional<Eigen::Quaterniond>> rotations;

  explicit Line(const SceneOptions& options) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<Pose> poses;
    for (int i = 0; i < 10; ++i) poses.push_back({looking({1, 0.3, 0}, {0, 0, -1}), {2.0 * i + (i % 3), 0, 0}});
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 1500; ++i)
      points.push_back({5 + 40 * uniform(random), -10 + 40 * uniform(random), -4 + 10 * uniform(random)});
    scene = make_scene(poses, points, options);
    PairNoise noise;
    noise.wrong_share = 0;
    graph = make_orientation_graph(scene.block, initial_state(scene.block), all_frames(scene.block),
                                   pairs_of(scene, noise), scene.tracks, {});
    rays = viewing_rays(graph, {scene.truth.cameras[CameraIndex(0)]});
    for (const Pose& pose : poses) rotations.push_back(pose.rotation);
  }
  const Pose& truth(std::int32_t image) const { return scene.truth.frames[FrameIndex(image)]; }
  std::vector<Baseline> baselines() const {
    return measure_baselines(graph, rotations, std::vector<std::uint8_t>(graph.edges.size(), 1), rays);
  }
  OrientationValues values() const {
    OrientationValues result;
    for (const auto& frame : graph.frames) result.frames.push_back(scene.truth.frames[frame.index]);
    result.cameras = {scene.truth.cameras[CameraIndex(0)]};
    return result;
  }
};

TEST(Baselines, DirectionsAndLengthRatiosOfMotionAlongOneLine) {
  SceneOptions options;
  options.noise_px = 0.3;
  const Line line(options);
  const auto baselines = line.baselines();
  ASSERT_GT(baselines.size(), 9u);
  const auto true_length = [&](const Baseline& b) { return (line.truth(b.b).centre - line.truth(b.a).centre).norm(); };
  const double unit = baselines[0].length / true_length(baselines[0]);
  for (const Baseline& b : baselines) {
    const Eigen::Vector3d direction = (line.truth(b.b).centre - line.truth(b.a).centre).normalized();
    EXPECT_GT(b.direction.dot(direction), std::cos(1 * kDegree));
    EXPECT_NEAR(b.length / true_length(b) / unit, 1, 0.05);
  }
}

TEST(Baselines, UnusableEdgesAndUnknownRotationsAreLeftOut) {
  Line line({});
  line.rotations[4].reset();
  std::vector<std::uint8_t> usable(line.graph.edges.size(), 1);
  usable[0] = 0;
  for (const Baseline& b : measure_baselines(line.graph, line.rotations, usable, line.rays)) {
    EXPECT_TRUE(b.a != 4 && b.b != 4);
    EXPECT_FALSE(b.a == line.graph.edges[0].a && b.b == line.graph.edges[0].b);
  }
}

TEST(Centres, DifferencesAndPriorsWithGrossErrors) {
  std::mt19937_64 random(2);
  std::vector<Eigen::Vector3d> truth;
  for (int i = 0; i < 30; ++i) truth.push_back(50 * normal_vector(random));
  std::vector<CentreDifference> differences;
  for (std::int32_t i = 0; i < 30; ++i)
    for (std::int32_t j = i + 1; j < std::min(30, i + 5); ++j)
      differences.push_back({i, j, truth[static_cast<std::size_t>(j)] - truth[static_cast<std::size_t>(i)], 1});
  for (std::size_t e = 0; e < differences.size(); e += 9) differences[e].offset = 100 * normal_vector(random);

  std::vector<std::optional<CentrePrior>> priors(30);
  const auto free = solve_centres(30, differences, priors);
  for (std::size_t i = 1; i < 30; ++i) EXPECT_LT((*free[i] - *free[0] - (truth[i] - truth[0])).norm(), 1);

  for (std::size_t i = 0; i < 30; i += 3) priors[i] = CentrePrior{truth[i], Eigen::Vector3d(1, 1, 2)};
  std::vector<std::optional<Eigen::Vector3d>> start(truth.begin(), truth.end());
  priors[6]->position.x() += 10000;
  const auto known = solve_centres(30, differences, priors, start);
  for (std::size_t i = 0; i < 30; ++i) EXPECT_LT((*known[i] - truth[i]).norm(), 1) << i;
}

TEST(Centres, NodesThatNothingConnectsStayEmpty) {
  const std::vector<CentreDifference> differences = {{0, 1, {1, 0, 0}, 1}, {1, 2, {1, 0, 0}, 1}, {3, 4, {1, 0, 0}, 1}};
  std::vector<std::optional<CentrePrior>> priors(6);
  auto centres = solve_centres(6, differences, priors);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(centres[i].has_value(), i < 3);
  priors[3] = CentrePrior{{5, 5, 5}, {1, 1, 1}};
  centres = solve_centres(6, differences, priors);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(centres[i].has_value(), i == 3 || i == 4);
  EXPECT_LT((*centres[4] - Eigen::Vector3d(6, 5, 5)).norm(), 1e-9);
}

TEST(TrackIntersection, FindsPointsAndTellsWrongObservations) {
  SceneOptions options;
  options.wrong_tracks = 0.2;
  const Line line(options);
  OrientationValues values = line.values();
  intersect_tracks(line.graph, line.rays, {0.005, 2 * kDegree}, values);
  std::int64_t points = 0, judged = 0, wrong_verdicts = 0;
  for (std::size_t t = 0; t < values.points.size(); ++t) {
    if (!values.points[t]) continue;
    ++points;
    for (auto o = static_cast<std::size_t>(line.graph.begin[t]); o < static_cast<std::size_t>(line.graph.begin[t + 1]);
         ++o) {
      const Eigen::Vector3d inside = to_inside(line.truth(line.graph.observations[o].image), *values.points[t]);
      const bool agrees = (inside.normalized() - line.rays[o]).norm() < 0.005;
      ++judged;
      wrong_verdicts += agrees != static_cast<bool>(values.kept[o]);
    }
  }
  EXPECT_GT(points, line.graph.track_count() / 2);
  EXPECT_LE(wrong_verdicts, judged / 1000);
}

TEST(GlobalPositioning, BringsDisplacedCentresBack) {
  SceneOptions options;
  options.gps_sigma_m = 0.01;
  const Line line(options);
  OrientationValues values = line.values();
  std::mt19937_64 random(3);
  for (auto& frame : values.frames) frame->centre += 0.3 * normal_vector(random);
  intersect_tracks(line.graph, line.rays, {5 * kDegree, 2 * kDegree}, values);
  position_globally(line.graph, line.rays, {0.002, true, 30}, values);
  for (std::size_t f = 0; f < values.frames.size(); ++f)
    EXPECT_LT((values.frames[f]->centre - line.truth(static_cast<std::int32_t>(f)).centre).norm(), 0.05);
}

TEST(Resection, PoseOfOneFrameFromItsPoints) {
  SceneOptions options;
  options.wrong_tracks = 0.5;
  const Line line(options);
  OrientationValues values = line.values();
  intersect_tracks(line.graph, line.rays, {0.003, 2 * kDegree}, values);
  values.frames[5].reset();
  const auto pose = resect_frame(line.graph, line.rays, 5, 0.005, 15, values);
  ASSERT_TRUE(pose);
  EXPECT_LT((pose->centre - line.truth(5).centre).norm(), 0.05);
  EXPECT_LT(rotation_angle(pose->rotation, line.truth(5).rotation), 0.1 * kDegree);
  EXPECT_FALSE(resect_frame(line.graph, line.rays, 5, 0.005, 100000, values)) << "too few points";
  std::mt19937_64 random(9);
  for (auto& point : values.points)
    if (point) *point += 30 * normal_vector(random);
  EXPECT_FALSE(resect_frame(line.graph, line.rays, 5, 0.005, 15, values)) << "no agreement";
}

TEST(GroundAlignment, PositionsOnALineLeaveTheRollToGravity) {
  SceneOptions options;
  options.gps_sigma_m = 0.02;
  const Line line(options);
  OrientationValues turned = line.values();
  const Similarity gauge{0.3, rotation_exp<double>({2, -1, 0.5}), {100, 20, -7}};
  for (auto& frame : turned.frames) frame = gauge(*frame);
  const auto back = similarity_to_ground(line.graph, turned, 3, GroundAngles::kNone);
  ASSERT_TRUE(back);
  for (std::size_t f = 0; f < turned.frames.size(); ++f) {
    const Pose pose = (*back)(*turned.frames[f]);
    EXPECT_LT((pose.centre - line.truth(static_cast<std::int32_t>(f)).centre).norm(), 0.1);
    EXPECT_LT(rotation_angle(pose.rotation, line.truth(static_cast<std::int32_t>(f)).rotation), 1 * kDegree);
  }
  // Rotations that refer to the ground already keep their roll.
  OrientationValues shifted = line.values();
  for (auto& frame : shifted.frames) {
    frame = Similarity{2, Eigen::Quaterniond::Identity(), {5, 5, 5}}(*frame);
    frame->rotation = frame->rotation * rotation_exp<double>(Eigen::Vector3d(0.2, 0, 0));
  }
  const auto kept = similarity_to_ground(line.graph, shifted, 3, GroundAngles::kAll);
  ASSERT_TRUE(kept);
  EXPECT_LT(rotation_angle(kept->rotation, Eigen::Quaterniond::Identity()), 1 * kDegree);
  EXPECT_NEAR(kept->scale, 0.5, 0.01);
}

// Positions that lie wrong by 10 degrees turn the heading of a level block, by whatever it is, and never its level.
TEST(GroundAlignment, PositionsTurnOnlyTheHeadingOfALevelBlock) {
  const Line line({});
  OrientationGraph graph = line.graph;
  OrientationValues level = line.values();
  const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  for (const double heading : {0.0, 90.0, 180.0}) {
    const Similarity wrong{
        1,
        rotation_exp<double>({10 * kDegree, 0, 0}) * rotation_exp<double>(Eigen::Vector3d(heading * kDegree * up)),
        {}};
    for (std::size_t f = 0; f < level.frames.size(); ++f) {
      level.frames[f]->centre = 10 * Eigen::Vector3d(static_cast<double>(f % 5), static_cast<double>(f / 5), 0);
      PositionPrior known;
      known.position = wrong(level.frames[f]->centre);
      known.sigma.setConstant(0.02);
      graph.frames[f].position = known;
    }
    const auto ground = similarity_to_ground(graph, level, 3, GroundAngles::kLevel);
    ASSERT_TRUE(ground);
    EXPECT_LT((ground->rotation * up - up).norm(), 1e-6) << heading;
    const Eigen::Quaterniond rest = rotation_exp<double>(Eigen::Vector3d(-heading * kDegree * up)) * ground->rotation;
    EXPECT_LT(rotation_angle(rest, Eigen::Quaterniond::Identity()), 1 * kDegree) << heading;
  }
}

TEST(GroundAlignment, FreeFrameIsCentredUprightAndOfUnitBaseline) {
  const Line line({});
  OrientationValues values = line.values();
  std::mt19937_64 random(4);
  for (auto& frame : values.frames) frame->centre += Eigen::Vector3d(0, 3, 0) * normal_vector(random).x();
  const Similarity gauge{7, rotation_exp<double>({1, 2, -0.5}), {100, 20, -7}};
  for (auto& frame : values.frames) frame = gauge(*frame);
  const Similarity free = similarity_to_free_frame(line.graph, values, GroundAngles::kNone, false);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double baselines = 0;
  for (auto& frame : values.frames) {
    frame = free(*frame);
    mean += frame->centre / 10;
    EXPECT_NEAR(frame->centre.z(), 0, 1e-9) << "centres lay in one horizontal plane";
    EXPECT_GT((frame->rotation.conjugate() * Eigen::Vector3d::UnitY()).dot(-Eigen::Vector3d::UnitZ()), 0.99);
  }
  for (const auto& edge : line.graph.edges)
    baselines += (values.frames[static_cast<std::size_t>(edge.a)]->centre -
                  values.frames[static_cast<std::size_t>(edge.b)]->centre)
                     .norm();
  EXPECT_LT(mean.norm(), 1e-9);
  EXPECT_NEAR(baselines / static_cast<double>(line.graph.edges.size()), 1, 1e-9);
}

}  // namespace
}  // namespace megablock
