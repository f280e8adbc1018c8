#include "adjust/orientation/vertical_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <random>
#include <set>

#include "geometry/numbers/angles.h"
#include "io/block/set_aside_vertical.h"
#include "tests/support/adjust/orientation_scene.h"
#include "tests/support/adjust/seen_verticals.h"

namespace megablock {
namespace {

using orientation_scene::normal_vector;

// Nodes turned anyhow, their relative rotations, and what was averaged of them.
struct Averaged {
  std::vector<Eigen::Quaterniond> truth;
  std::vector<RelativeRotation> edges;
  AveragedRotations found;

  void measure(std::int32_t a, std::int32_t b, std::mt19937_64& random) {
    const Eigen::Quaterniond exact =
        truth[static_cast<std::size_t>(b)] * truth[static_cast<std::size_t>(a)].conjugate();
    edges.push_back({a, b, rotation_update(exact, 0.5 * kDegree * normal_vector(random)), 100});
  }
  void average() {
    const auto nodes = static_cast<std::int32_t>(truth.size());
    found = average_rotations(nodes, edges, std::vector<std::optional<RotationPrior>>(truth.size()), 10 * kDegree);
  }
  std::vector<VerticalVerdict> judge(const std::vector<SeenDown>& seen,
                                     const std::optional<AxisDirection>& down = std::nullopt) const {
    return judge_verticals(found.rotation, edges, found.kept, seen, down);
  }
};

// Every node is linked to the next two.
Averaged chain(std::int32_t nodes, std::uint64_t seed) {
  Averaged chain;
  std::mt19937_64 random(seed);
  for (std::int32_t i = 0; i < nodes; ++i) chain.truth.push_back(rotation_exp<double>(normal_vector(random)));
  for (std::int32_t i = 0; i < nodes; ++i)
    for (std::int32_t j = i + 1; j < std::min(nodes, i + 3); ++j) chain.measure(i, j, random);
  chain.average();
  return chain;
}

const Eigen::Vector3d kDown = -Eigen::Vector3d::UnitZ();

SeenDown seen_down(std::int32_t node, const Eigen::Vector3d& direction, double sigma_deg) {
  return {node, 0, direction.normalized(), std::pow(sigma_deg * kDegree, 2) * Eigen::Matrix3d::Identity(),
          Eigen::Matrix3Xd(3, 0)};
}

// Of every node, with errors of this sigma; some see down anywhere.
struct SeenVerticals {
  std::vector<SeenDown> seen;
  std::vector<std::uint8_t> wrong;
};
SeenVerticals verticals_of(const Averaged& block, double sigma_deg, double wrong, std::uint64_t seed) {
  SeenVerticals verticals;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (std::size_t i = 0; i < block.truth.size(); ++i) {
    Eigen::Vector3d seen = rotation_exp<double>(sigma_deg * kDegree * normal_vector(random)) * (block.truth[i] * kDown);
    const bool is_wrong = uniform(random) < wrong;
    if (is_wrong) seen = normal_vector(random);
    verticals.seen.push_back(seen_down(static_cast<std::int32_t>(i), seen, sigma_deg));
    verticals.wrong.push_back(is_wrong);
  }
  return verticals;
}

struct Believed {
  std::int64_t right = 0, right_believed = 0, wrong = 0, wrong_believed = 0;
};
Believed believed(const SeenVerticals& verticals, const std::vector<VerticalVerdict>& verdicts) {
  Believed counts;
  for (std::size_t i = 0; i < verdicts.size(); ++i) {
    const bool yes = verdicts[i] == VerticalVerdict::kBelieved;
    (verticals.wrong[i] ? counts.wrong : counts.right) += 1;
    (verticals.wrong[i] ? counts.wrong_believed : counts.right_believed) += yes;
  }
  return counts;
}

void expect_all(const std::vector<VerticalVerdict>& verdicts, VerticalVerdict verdict) {
  EXPECT_EQ(std::count(verdicts.begin(), verdicts.end(), verdict), std::ssize(verdicts));
}

// Two directions of one pass the test in 999 of 1000; the degree for walls that lean hardly counts beside 4 degrees.
TEST(VerticalCheck, RightOnesAreBelieved) {
  for (const double sigma_deg : {0.1, 4.}) {
    std::int64_t rejected = 0, all = 0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const Averaged block = chain(300, seed);
      const SeenVerticals verticals = verticals_of(block, sigma_deg, 0, seed + 100);
      const Believed counts = believed(verticals, block.judge(verticals.seen));
      rejected += counts.right - counts.right_believed;
      all += counts.right;
    }
    EXPECT_EQ(all, 3000);
    std::printf("[ reached  ] %lld of %lld right ones of %.1f deg set aside\n", static_cast<long long>(rejected),
                static_cast<long long>(all), sigma_deg);
    EXPECT_LE(rejected, sigma_deg < 1 ? 0 : 7) << sigma_deg;
  }
}

TEST(VerticalCheck, HalfOfThemWrong) {
  Believed sum;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Averaged block = chain(200, seed);
    const SeenVerticals verticals = verticals_of(block, 0.1, 0.5, seed + 200);
    const auto verdicts = block.judge(verticals.seen);
    const Believed counts = believed(verticals, verdicts);
    sum.right += counts.right, sum.right_believed += counts.right_believed;
    sum.wrong += counts.wrong, sum.wrong_believed += counts.wrong_believed;
    EXPECT_EQ(std::count(verdicts.begin(), verdicts.end(), VerticalVerdict::kNoConsensus), 0);
  }
  std::printf("[ reached  ] %lld of %lld right ones believed, %lld of %lld wrong ones\n",
              static_cast<long long>(sum.right_believed), static_cast<long long>(sum.right),
              static_cast<long long>(sum.wrong_believed), static_cast<long long>(sum.wrong));
  EXPECT_GE(sum.right_believed, sum.right - sum.right / 1000);
  EXPECT_LE(sum.wrong_believed, sum.wrong / 50) << "within the test by accident";
}

TEST(VerticalCheck, AllOfThemWrong) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Averaged block = chain(60, seed);
    expect_all(block.judge(verticals_of(block, 0.1, 1, seed).seen), VerticalVerdict::kNoConsensus);
  }
}

// Strips flown to and fro over rows of a field: what is seen is one direction of the ground, forth and back. Within a
// strip all agree, and strips of 12 are linked loosely.
TEST(VerticalCheck, RowsOfAField) {
  constexpr std::int32_t kStrips = 6, kLength = 12;
  Averaged block;
  std::mt19937_64 random(3);
  std::vector<SeenDown> to_and_fro, one_way;
  const Eigen::Vector3d row_of_field = Eigen::Vector3d::UnitX();
  for (std::int32_t i = 0; i < kStrips * kLength; ++i) {
    block.truth.push_back(rotation_exp<double>(normal_vector(random)));
    const double sign = (i / kLength) % 2 == 0 ? 1 : -1;
    to_and_fro.push_back(seen_down(i, block.truth.back() * (sign * row_of_field), 0.1));
    one_way.push_back(seen_down(i, block.truth.back() * row_of_field, 0.1));
  }
  for (std::int32_t i = 0; i < kStrips * kLength; ++i)
    for (const std::int32_t next : {1, 2, kLength})
      if (i + next < kStrips * kLength && (next == kLength || i % kLength + next < kLength))
        block.measure(i, i + next, random);
  block.average();
  expect_all(block.judge(to_and_fro), VerticalVerdict::kNoConsensus);
  // Only what is known of the ground tells that they are not down if all strips are flown one way.
  expect_all(block.judge(one_way), VerticalVerdict::kBelieved);
  const Eigen::Quaterniond to_world = block.found.rotation[0]->conjugate() * block.truth[0];
  const double sigma = 10 * kDegree;
  const auto known = [&](const Eigen::Vector3d& ground) {
    return AxisDirection{to_world * ground, sigma * sigma * Eigen::Matrix3d::Identity()};
  };
  expect_all(block.judge(one_way, known(kDown)), VerticalVerdict::kAgainstGround);
  expect_all(block.judge(one_way, known(row_of_field)), VerticalVerdict::kBelieved);
  expect_all(block.judge(one_way, known(-row_of_field)), VerticalVerdict::kAgainstGround);
}

// A focal length that nobody knows turns what all images of the camera see alike, to wherever they look.
TEST(VerticalCheck, ErrorsOfTheCameraAreNoContradiction) {
  const Averaged block = chain(100, 4);
  std::vector<SeenDown> known, unknown;
  for (std::int32_t i = 0; i < 100; ++i) {
    const Eigen::Vector3d down = block.truth[static_cast<std::size_t>(i)] * kDown;
    const Eigen::Vector3d across = Eigen::Vector3d::UnitX().cross(down);
    known.push_back(seen_down(i, down + 0.15 * across, 0.1));
    unknown.push_back(known.back());
    unknown.back().by_camera = 0.15 * across;
  }
  const auto verdicts = block.judge(known);
  EXPECT_GT(std::count(verdicts.begin(), verdicts.end(), VerticalVerdict::kNoConsensus) +
                std::count(verdicts.begin(), verdicts.end(), VerticalVerdict::kContradicted),
            50);
  expect_all(block.judge(unknown), VerticalVerdict::kBelieved);
}

TEST(VerticalCheck, FramesWithSeveralImages) {
  const Averaged block = chain(40, 5);
  std::vector<SeenDown> seen;
  for (std::int32_t i = 0; i < 40; ++i)
    for (int image = 0; image < 10; ++image)
      seen.push_back(seen_down(
          i, block.truth[static_cast<std::size_t>(i)] * (image == 9 ? Eigen::Vector3d::UnitX() : kDown), 0.1));
  const auto verdicts = block.judge(seen);
  for (std::size_t s = 0; s < seen.size(); ++s)
    EXPECT_EQ(verdicts[s], s % 10 == 9 ? VerticalVerdict::kContradicted : VerticalVerdict::kBelieved) << s;
}

TEST(VerticalCheck, Few) {
  const Averaged block = chain(10, 6);
  EXPECT_TRUE(block.judge({}).empty());
  const auto seen = [&](std::int32_t node, const Eigen::Vector3d& ground) {
    return seen_down(node, block.truth[static_cast<std::size_t>(node)] * ground, 0.1);
  };
  expect_all(block.judge({seen(3, kDown)}), VerticalVerdict::kBelieved);
  expect_all(block.judge({seen(3, kDown), seen(7, kDown)}), VerticalVerdict::kBelieved);
  expect_all(block.judge({seen(3, kDown), seen(7, -kDown)}), VerticalVerdict::kNoConsensus);
  EXPECT_EQ(block.judge({seen(3, kDown), seen(5, kDown), seen(7, -kDown)}),
            (std::vector{VerticalVerdict::kBelieved, VerticalVerdict::kBelieved, VerticalVerdict::kContradicted}));

  // A node without a rotation, and one that no edge reaches.
  Averaged loose = block;
  loose.truth.insert(loose.truth.end(), 2, Eigen::Quaterniond::Identity());
  loose.found.rotation.push_back(std::nullopt);
  loose.found.rotation.push_back(Eigen::Quaterniond::Identity());
  expect_all(loose.judge({seen(3, kDown), seen(7, kDown), seen_down(10, kDown, 0.1), seen_down(11, -kDown, 0.1)}),
             VerticalVerdict::kBelieved);
  EXPECT_EQ(loose.judge({seen(3, kDown), seen(7, -kDown), seen_down(10, kDown, 0.1)}).back(),
            VerticalVerdict::kNoConsensus);
}

TEST(VerticalCheck, IsRepeatable) {
  const Averaged block = chain(200, 7);
  const SeenVerticals verticals = verticals_of(block, 0.1, 0.5, 8);
  EXPECT_EQ(block.judge(verticals.seen), block.judge(verticals.seen));
}

Block street_with_verticals() {
  SimulationOptions options;
  options.scene = SimulationOptions::Scene::kStreet;
  options.frames = 20;
  options.rig_cameras = 2;
  SimulatedBlock scene = simulate_block(options);
  add_seen_verticals(scene, {.sigma_deg = 0.1, .noise_deg = 0.1});
  return scene.block;
}

// One by one: a pose says of its own frame alone. What is off by as much as an approximate pose may be stays.
TEST(VerticalCheck, AgainstGivenPoses) {
  Block block = street_with_verticals();
  EXPECT_TRUE(against_given_poses(block).empty());

  std::set<ImageIndex> wrong;
  std::mt19937_64 random(6);
  for (std::size_t v = 0; v < block.verticals.size(); ++v) {
    SeenVertical& vertical = block.verticals[v];
    const Eigen::Vector3d axis = tangent_plane(vertical.down).col(v % 2);
    const double off_deg = v % 3 == 0 ? 30 + 5 * static_cast<double>(v % 20) : v % 3 == 1 ? 10 : 0;
    vertical.down = rotation_exp<double>(off_deg * kDegree * axis) * vertical.down;
    const Eigen::Matrix<double, 3, 2> across = tangent_plane(vertical.down);
    vertical.covariance = std::pow(0.1 * kDegree, 2) * across * across.transpose();
    if (v % 3 == 0) wrong.insert(vertical.image);
  }
  std::shuffle(block.verticals.begin(), block.verticals.end(), random);
  std::set<ImageIndex> aside;
  const std::vector<SetAsideVertical> found = against_given_poses(block);
  for (const SetAsideVertical& vertical : found) {
    EXPECT_EQ(vertical.verdict, VerticalVerdict::kAgainstGround);
    aside.insert(vertical.image);
  }
  EXPECT_EQ(aside, wrong);
  EXPECT_TRUE(
      std::is_sorted(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.image < b.image; }));

  // Frames without a given pose are not judged here.
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) block.frames[f].given_pose.reset();
  EXPECT_TRUE(against_given_poses(block).empty());
}

// Given poses in the axes of an imported model, which are any: no vertical is down by them, but all show one direction.
// So none takes part and it is said why; pairs are joined by them, but for the wrong one's.
TEST(VerticalCheck, GivenPosesInAxesOfTheirOwn) {
  Block block = street_with_verticals();
  const Eigen::Quaterniond turn = rotation_exp<double>({0.6, 0.4, -1});
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
    Pose& pose = *block.frames[f].given_pose;
    pose = {pose.rotation * turn.conjugate(), turn * pose.centre};
  }
  ASSERT_GT(block.verticals.size(), 20u);
  constexpr std::size_t kWrong = 7;
  block.verticals[kWrong].down = block.verticals[kWrong].down.unitOrthogonal().eval();

  const std::vector<SetAsideVertical> aside = against_given_poses(block);
  EXPECT_EQ(aside.size(), block.verticals.size());
  for (const SetAsideVertical& vertical : aside) EXPECT_EQ(vertical.verdict, VerticalVerdict::kAgainstPoses);
  EXPECT_NE(set_aside_text(block, aside, aside.size()).find("may not be vertical"), std::string::npos);

  const auto seen = [&](std::size_t v) {
    const SeenVertical& vertical = block.verticals[v];
    const Camera& camera = block.cameras[block.camera_of(vertical.image)];
    return whole_error(vertical, camera, camera.intrinsics);
  };
  for (std::size_t v = 0; v < block.verticals.size(); ++v)
    for (std::size_t w = 0; w < v; ++w)
      EXPECT_EQ(given_poses_join(block, block.verticals[v].image, seen(v), block.verticals[w].image, seen(w)),
                v != kWrong && w != kWrong);

  // Nothing is said of images without a given pose.
  block.frames[block.images[block.verticals[kWrong].image].frame].given_pose.reset();
  EXPECT_TRUE(given_poses_join(block, block.verticals[kWrong].image, seen(kWrong), block.verticals[0].image, seen(0)));
}

}  // namespace
}  // namespace megablock
