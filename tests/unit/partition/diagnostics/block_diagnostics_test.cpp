// Diagnostics of simulated blocks with known gaps, thin ground, missing lines and single links.
#include "partition/diagnostics/block_diagnostics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <set>
#include <tuple>

#include "io/base/disjoint_sets.h"
#include "io/base/error.h"
#include "partition/diagnostics/ground_cover.h"
#include "partition/links/link_parts.h"
#include "partition/views/flight_lines.h"

namespace megablock {
namespace {

// Vertical images that cover 60 m across and 40 m along their line, from 100 m height.
struct Survey {
  Block block;
  BlockState state;
  std::vector<FrameEdge> links;

  Survey() {
    Camera camera;
    camera.name = "camera";
    camera.width = 600;
    camera.height = 400;
    camera.intrinsics = Intrinsics(CameraModel{CameraModelKind::kPinhole});
    camera.intrinsics[kFocal] = 1000;
    camera.intrinsics[kPrincipalX] = 300;
    camera.intrinsics[kPrincipalY] = 200;
    block.cameras.push_back(camera);
    Rig rig;
    rig.name = "rig";
    rig.mounts.resize(1);
    rig.mounts[0].camera = CameraIndex(0);
    block.rigs.push_back(rig);
  }

  // An exposure that flies along `heading` (counter-clockwise from east) and looks down, or ahead.
  FrameIndex add(double x, double y, double heading = 0, std::int64_t pass = 0, bool down = true) {
    const FrameIndex index(static_cast<std::int64_t>(block.frames.size()));
    Frame frame;
    frame.name = "f" + std::to_string(index.value);
    frame.rig = RigIndex(0);
    frame.pass = pass;
    Pose pose;
    pose.centre = {x, y, 100};
    Eigen::Matrix3d r;
    const Eigen::Vector3d ahead(std::cos(heading), std::sin(heading), 0), up(0, 0, 1);
    r.row(0) = ahead.cross(up);
    r.row(1) = down ? -ahead : -up;
    r.row(2) = down ? -up : ahead;
    pose.rotation = Eigen::Quaterniond(r);
    frame.given_pose = pose;
    block.frames.push_back(frame);
    block.add_image(frame.name + ".jpg", {index, 0, 0});
    return index;
  }

  void link(FrameIndex a, FrameIndex b, std::int64_t points) { links.push_back({a, b, points}); }

  BlockDiagnostics found(const DiagnosticsOptions& options = {}) {
    state = initial_state(block);
    const auto gather = [&](bool with_heights) {
      TieEvidence ties;
      for (const FrameEdge& link : links) ties.links.add(link.a, link.b, link.weight);
      if (with_heights) ties.ground_height.assign(block.images.size(), 0.0);
      return ties;
    };
    return diagnose(block, state, gather, options);
  }
};

TEST(FlightLines, AreFoundWithoutPassesAndTurnsBelongToNone) {
  Survey survey;
  for (int i = 0; i < 6; ++i) survey.add(16 * i, 0, 0, -1);
  for (int i = 5; i >= 0; --i) survey.add(16 * i, 42, std::numbers::pi, -1);
  survey.add(-16, 60, 1, -1);
  survey.add(-16, 84, 1, -1);
  for (int i = 0; i < 6; ++i) survey.add(16 * i, 84, 0, -1);
  const BlockState state = initial_state(survey.block);
  const auto lines = flight_lines(acquisition_order(survey.block, state), state);
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0].front(), FrameIndex(0));
  EXPECT_EQ(lines[0].back(), FrameIndex(5));
  EXPECT_EQ(lines[1].front(), FrameIndex(6));
  EXPECT_EQ(lines[1].back(), FrameIndex(11));
  EXPECT_EQ(lines[2].back(), FrameIndex(19));
}

TEST(FlightLines, TwoExposuresOfOnePlaceDoNotEndALine) {
  Survey survey;
  for (const double x : {0., 16., 32., 31.9, 48., 64.}) survey.add(x, 0);
  const BlockState state = initial_state(survey.block);
  EXPECT_EQ(flight_lines(acquisition_order(survey.block, state), state).size(), 1u);
}

// Without times the order is by name, numbers in names by value, without a table of the ranks of all names.
TEST(FlightLines, AreInTheOrderOfNamesOrTimes) {
  Survey survey;
  for (int i = 0; i < 12; ++i) survey.add(16 * i, 0);
  Block& block = survey.block;
  block.image_names = {};
  for (int i = 0; i < 12; ++i) block.image_names.push_back("img_" + std::to_string(12 - i) + ".jpg");
  const BlockState state = initial_state(block);
  const auto by_name = acquisition_order(block, state);
  ASSERT_EQ(by_name.size(), 1u);
  for (std::int64_t i = 0; i < 12; ++i) EXPECT_EQ(by_name[0][static_cast<std::size_t>(i)], FrameIndex(11 - i));
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) block.frames[f].time_s = static_cast<double>(f.value / 2);
  const auto by_time = acquisition_order(block, state);  // of equal times by name
  for (std::int64_t i = 0; i < 12; ++i) EXPECT_EQ(by_time[0][static_cast<std::size_t>(i)], FrameIndex(i ^ 1));
}

TEST(GroundCover, CommonShareOfQuadrilaterals) {
  const Quadrilateral a = {Eigen::Vector2d(0, 0), {4, 0}, {4, 2}, {0, 2}};
  const Quadrilateral turned = {Eigen::Vector2d(0, 2), {4, 2}, {4, 0}, {0, 0}};
  EXPECT_NEAR(common_share(a, turned), 1, 1e-14);
  EXPECT_NEAR(common_share(a, {Eigen::Vector2d(3, 1), {7, 1}, {7, 3}, {3, 3}}), 1. / 8, 1e-14);
  // One inside the other.
  EXPECT_NEAR(common_share(a, {Eigen::Vector2d(1, 0.5), {2, 0.5}, {2, 1.5}, {1, 1.5}}), 1, 1e-14);
  EXPECT_NEAR(common_share(a, {Eigen::Vector2d(2, -1), {4, 1}, {2, 3}, {0, 1}}), 6. / 8, 1e-14);
  EXPECT_EQ(common_share(a, {Eigen::Vector2d(5, 0), {9, 0}, {9, 2}, {5, 2}}), 0);
  EXPECT_EQ(common_share(a, {Eigen::Vector2d(1, 1), {1, 1}, {1, 1}, {1, 1}}), 0);
}

TEST(BlockDiagnostics, BasesOverlapsAndTwoMissingExposures) {
  Survey survey;
  for (const int i : {0, 1, 2, 5, 6, 7}) survey.add(16 * i, 0);
  const BlockDiagnostics d = survey.found();
  EXPECT_TRUE(d.aerial);
  EXPECT_FALSE(d.links_known);
  ASSERT_EQ(d.footprints.size(), 6u);
  EXPECT_NEAR((d.footprints[0].corners[1] - d.footprints[0].corners[0]).norm(), 60, 1e-9);
  EXPECT_DOUBLE_EQ(d.usual_step_m, 16);
  EXPECT_DOUBLE_EQ(d.height_m, 100);
  ASSERT_EQ(d.pairs.size(), 5u);
  EXPECT_NEAR(d.pairs[0].base_to_height, 0.16, 1e-12);
  EXPECT_NEAR(d.pairs[0].overlap, 0.6, 1e-9);
  EXPECT_EQ(d.pairs[2].overlap, 0);
  EXPECT_TRUE(d.overlap_is_missing(d.pairs[2]));
  ASSERT_EQ(d.gaps.size(), 1u);
  EXPECT_EQ(d.gaps[0].missing, 2);
  ASSERT_EQ(d.proposals.size(), 2u);
  EXPECT_LT((d.proposals[0].centre - Eigen::Vector3d(48, 0, 100)).norm(), 1e-9);
  EXPECT_LT((d.proposals[1].centre - Eigen::Vector3d(64, 0, 100)).norm(), 1e-9);
  EXPECT_TRUE(d.thin_ground.empty());  // a single line has a rim on both sides
}

// Lines flown in alternating directions; one line and one exposure are missing.
Survey turned_survey(double turn, double noise) {
  Survey survey;
  std::mt19937 random(1);
  std::uniform_real_distribution<double> error(-noise, noise);
  for (int line = 0; line < 5; ++line)
    for (int k = 0; k < 8; ++k) {
      const int i = line % 2 == 0 ? k : 7 - k;
      if (line == 2 || (line == 3 && i == 4)) continue;
      const double x = 16 * i + error(random), y = 42 * line + error(random);
      const Eigen::Vector2d p = Eigen::Rotation2Dd(turn) * Eigen::Vector2d(x, y);
      survey.add(p.x(), p.y(), turn + (line % 2) * std::numbers::pi, line);
    }
  return survey;
}

TEST(BlockDiagnostics, RotatedBlockHasTheSameGaps) {
  for (const double turn : {0.3, 1.0, 2.5, std::numbers::pi / 2, std::numbers::pi})
    for (const double noise : {0., 1.}) {
      const BlockDiagnostics d = turned_survey(turn, noise).found();
      ASSERT_EQ(d.gaps.size(), 2u) << turn << " " << noise;
      EXPECT_FALSE(d.gaps[0].line);
      EXPECT_TRUE(d.gaps[1].line);
      EXPECT_EQ(d.gaps[1].missing, 1);
      EXPECT_NEAR(d.gaps[1].distance_m, 84, 1e-9 + 3 * noise);
      // Complete; its ends turn by the noise.
      EXPECT_NEAR((d.gaps[1].to - d.gaps[1].from).norm(), 7 * 16, 1e-9 + 14 * noise);
      if (noise == 0) {
        EXPECT_EQ(d.proposals.size(), 9u);
      }
    }
}

TEST(BlockDiagnostics, TwoCamerasAtOnePlaceAreNoStep) {
  Survey survey;
  for (const int i : {0, 1, 2, 5, 6, 7})
    for (int camera = 0; camera < 2; ++camera) survey.add(16 * i, 0);
  const BlockDiagnostics d = survey.found();
  EXPECT_DOUBLE_EQ(d.usual_step_m, 16);
  ASSERT_EQ(d.gaps.size(), 1u);
  EXPECT_EQ(d.gaps[0].before, FrameIndex(5));
  EXPECT_EQ(d.gaps[0].missing, 2);
  EXPECT_EQ(d.proposals.size(), 2u);
}

TEST(BlockDiagnostics, TinyStepsDoNotProposeMillions) {
  Survey survey;
  for (const double x : {0., 0.001, 0.002, 1000.}) survey.add(x, 0);
  const BlockDiagnostics d = survey.found();
  ASSERT_EQ(d.gaps.size(), 1u);
  EXPECT_EQ(d.gaps[0].missing, 1000);
  EXPECT_EQ(d.proposals.size(), 1000u);
}

TEST(BlockDiagnostics, LinesFlownTwiceAreOneBesideAMissingLine) {
  Survey survey;
  for (const int line : {0, 1, 3, 4})
    for (int again = 0; again < 2; ++again)
      for (int k = 0; k < 8; ++k) {
        const int i = again ? 7 - k : k;
        survey.add(16 * i + 0.5 * again, 42 * line + 3 * again, again * std::numbers::pi, 2 * line + again);
      }
  const BlockDiagnostics d = survey.found();
  EXPECT_EQ(d.lines, 8);
  EXPECT_NEAR(d.line_distance_m, 42, 1e-9);
  ASSERT_EQ(d.gaps.size(), 1u);
  EXPECT_TRUE(d.gaps[0].line);
  EXPECT_EQ(d.gaps[0].missing, 1);
  EXPECT_NEAR(d.gaps[0].distance_m, 84, 1e-9);
  EXPECT_EQ(d.proposals.size(), 8u);
}

TEST(BlockDiagnostics, StreetsHaveInterruptionsAndLinksOnly) {
  Survey survey;
  for (const int i : {0, 1, 2, 4, 5, 9, 10}) survey.add(4 * i, 0, 0, 7, false);
  survey.add(0, 100, 0, 8, false);
  for (std::int64_t f = 0; f < 6; ++f) survey.link(FrameIndex(f), FrameIndex(f + 1), 40);
  survey.link(FrameIndex(0), FrameIndex(2), 40);
  survey.link(FrameIndex(6), FrameIndex(7), 3);
  const BlockDiagnostics d = survey.found();
  EXPECT_FALSE(d.aerial);
  ASSERT_EQ(d.gaps.size(), 1u);  // two steps are no gap where vehicles stop
  EXPECT_EQ(d.gaps[0].before, FrameIndex(4));
  EXPECT_TRUE(d.pairs.empty() && d.footprints.empty() && d.thin_ground.empty() && d.proposals.empty());
  EXPECT_EQ(d.part_frames, (std::vector<std::int64_t>{7, 1}));
  ASSERT_EQ(d.weak_links.size(), 1u);
  EXPECT_EQ(d.weak_links[0].points, 3);
  ASSERT_EQ(d.single_links.size(), 3u);  // 2-3, 3-4, 4-5: at least two frames on either side
  EXPECT_EQ(d.single_links[0].a, FrameIndex(2));
  EXPECT_EQ(d.single_links[0].frames, 3);
}

TEST(BlockDiagnostics, RelativePosesHoldPartsTogether) {
  Survey survey;
  for (int i = 0; i < 4; ++i) survey.add(4 * i, 0, 0, 0, false);
  survey.link(FrameIndex(0), FrameIndex(1), 40);
  survey.link(FrameIndex(2), FrameIndex(3), 40);
  EXPECT_EQ(survey.found().part_frames.size(), 2u);
  survey.block.relative_poses.push_back({FrameIndex(2), FrameIndex(1), {}, 1e-3, 0.01});
  const BlockDiagnostics d = survey.found();
  EXPECT_EQ(d.part_frames.size(), 1u);
  EXPECT_TRUE(d.single_links.empty());  // a relative pose is no link of tie points
}

// Number of frames that remain connected with the first one without one of the links.
std::int64_t reached(std::int64_t frames, const std::vector<FrameEdge>& links, std::size_t without, FrameIndex from) {
  DisjointSets sets(frames);
  for (std::size_t l = 0; l < links.size(); ++l)
    if (l != without) sets.unite(links[l].a.value, links[l].b.value);
  std::int64_t count = 0;
  for (std::int64_t f = 0; f < frames; ++f) count += sets.find(f) == sets.find(from.value);
  return count;
}

TEST(BlockDiagnostics, SingleLinksAreThoseWithoutWhichFramesAreApart) {
  constexpr std::int64_t kFrames = 24;
  std::mt19937 random(11);
  const auto any = [&] { return FrameIndex(static_cast<std::int64_t>(random() % kFrames)); };
  std::size_t bridges = 0;
  for (int graph = 0; graph < 300; ++graph) {
    Survey survey;
    for (int f = 0; f < kFrames; ++f) survey.add(16 * f, 0, 0, 0, false);
    std::set<std::pair<FrameIndex, FrameIndex>> pairs;
    const std::size_t wanted = 15 + random() % 25;
    while (pairs.size() < wanted)
      if (const FrameIndex a = any(), b = any(); a < b) pairs.emplace(a, b);
    std::vector<FrameEdge> good;
    for (const auto& [a, b] : pairs) {
      const bool relative = random() % 4 == 0;  // alone, or beside a link
      if (relative || random() % 4 == 0) survey.block.relative_poses.push_back({b, a, Pose(), 0.01, 0.01});
      if (!relative) survey.link(a, b, 20);
      good.push_back({a, b, relative ? 0 : 20});
    }
    std::vector<std::tuple<FrameIndex, FrameIndex, std::int64_t>> expected, found;
    for (std::size_t l = 0; l < good.size(); ++l) {
      const std::int64_t whole = reached(kFrames, good, good.size(), good[l].a),
                         left = reached(kFrames, good, l, good[l].a), smaller = std::min(left, whole - left);
      if (left < whole && smaller >= 2 && good[l].weight > 0) expected.emplace_back(good[l].a, good[l].b, smaller);
    }
    for (const auto& link : survey.found().single_links) found.emplace_back(link.a, link.b, link.frames);
    EXPECT_EQ(found, expected) << graph;
    bridges += expected.size();
  }
  EXPECT_GT(bridges, 300u);
}

TEST(BlockDiagnostics, OfImagesAloneNobodyKnowsWhereDownIs) {
  Survey survey;
  for (int i = 0; i < 6; ++i) survey.add(20 * i, 0);
  EXPECT_TRUE(survey.found().aerial);
  survey.state = initial_state(survey.block);
  for (Frame& frame : survey.block.frames) frame.given_pose.reset();
  const auto found = [&] { return diagnose(survey.block, survey.state, [](bool) { return TieEvidence(); }, {}); };
  EXPECT_FALSE(found().aerial);
  EXPECT_TRUE(found().pairs.empty() && found().footprints.empty());
  ControlPoint& point = survey.block.control_points.emplace_back();
  point.role = PointRole::kCheck;  // must not count
  EXPECT_FALSE(found().aerial);
  point.role = PointRole::kControl;
  EXPECT_TRUE(found().aerial);
}

// Tie points alone show no weakness either.
TEST(BlockDiagnostics, WithoutPosesNothingIsExamined) {
  Survey survey;
  for (int i = 0; i < 4; ++i) survey.add(16 * i, 0, 0, 0, false);
  for (int i = 0; i < 3; ++i) survey.link(FrameIndex(i), FrameIndex(i + 1), 100);
  EXPECT_EQ(to_text(survey.found(), survey.block).find("nothing could be examined"), std::string::npos);
  for (Frame& frame : survey.block.frames) frame.given_pose.reset();
  EXPECT_EQ(to_text(survey.found(), survey.block),
            "nothing could be examined, because no image has a pose: run the job as far as its initial orientation "
            "('megablock orient'), or give poses, or positions with attitudes\n");
}

TEST(BlockDiagnostics, NothingPlacedAndBadOptions) {
  Survey survey;
  const BlockDiagnostics empty = survey.found();
  EXPECT_FALSE(empty.aerial);
  EXPECT_TRUE(empty.gaps.empty() && empty.part_frames.empty());
  survey.add(0, 0);
  survey.block.frames[FrameIndex(0)].given_pose.reset();
  EXPECT_TRUE(survey.found().pairs.empty());
  for (int i = 0; i < 3; ++i) survey.add(5, 5);  // all at one place
  EXPECT_TRUE(survey.found().gaps.empty());
  DiagnosticsOptions options;
  options.min_base_to_height = 2;
  EXPECT_THROW(survey.found(options), InputError);
  options = {};
  options.gap_factor = 1;
  EXPECT_THROW(survey.found(options), InputError);
}

TEST(BlockDiagnostics, PosesOfPriorsBeforeAnythingIsOriented) {
  Survey survey;
  for (int i = 0; i < 4; ++i) {
    const FrameIndex f = survey.add(16 * i, 0);
    Frame& frame = survey.block.frames[f];
    frame.attitude_prior = AttitudePrior{frame.given_pose->rotation, Eigen::Vector3d::Constant(0.05)};
    PositionPrior position;
    position.lever_arm = {0.1, 0, -0.2};
    position.position = frame.given_pose->centre + frame.given_pose->rotation.conjugate() * position.lever_arm;
    frame.position_prior = position;
    frame.given_pose.reset();
  }
  survey.block.frames[FrameIndex(3)].attitude_prior.reset();
  const BlockState state = state_of_priors(survey.block);
  EXPECT_EQ(std::vector<std::uint8_t>(state.oriented.begin(), state.oriented.end()),
            (std::vector<std::uint8_t>{1, 1, 1, 0}));
  EXPECT_LT((state.frames[FrameIndex(2)].centre - Eigen::Vector3d(32, 0, 100)).norm(), 1e-12);
}

}  // namespace
}  // namespace megablock
