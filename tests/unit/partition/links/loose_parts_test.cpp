// Which parts of networks of links have a scale of their own, against the null space of their directions.
#include "partition/links/loose_parts.h"

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <random>
#include <set>

namespace megablock {
namespace {

struct Network {
  Block block;
  BlockState state;
  std::vector<FrameEdge> links;

  explicit Network(const std::vector<Eigen::Vector3d>& centres) {
    Rig rig;
    rig.mounts.resize(1);
    block.rigs.push_back(rig);
    block.cameras.resize(1);
    for (const Eigen::Vector3d& centre : centres) {
      Frame frame;
      frame.name = "f" + std::to_string(block.frames.size());
      frame.rig = RigIndex(0);
      block.frames.push_back(frame);
      block.add_image(frame.name + ".jpg", {FrameIndex(std::ssize(block.frames) - 1), 0, 0});
      state.frames.push_back({Eigen::Quaterniond::Identity(), centre});
      state.oriented.push_back(1);
    }
  }
  void link(std::int64_t a, std::int64_t b, std::int64_t points = 20) {
    links.push_back({FrameIndex(std::min(a, b)), FrameIndex(std::max(a, b)), points});
  }
  void link_all(const std::vector<std::int64_t>& frames) {
    for (std::size_t i = 0; i < frames.size(); ++i)
      for (std::size_t j = i + 1; j < frames.size(); ++j) link(frames[i], frames[j]);
  }
  std::vector<BlockDiagnostics::LoosePart> loose() const {
    LinkWeights weights;
    for (const FrameEdge& link : links) weights.add(link.a, link.b, link.weight);
    BlockDiagnostics d;
    find_loose_parts(block, state, weights, d);
    return d.loose_parts;
  }
};

std::vector<Eigen::Vector3d> random_centres(int count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> at(-10, 10);
  std::vector<Eigen::Vector3d> centres;
  for (int i = 0; i < count; ++i) centres.emplace_back(at(random), at(random), at(random));
  return centres;
}

std::vector<std::int64_t> numbers(const std::vector<FrameIndex>& frames) {
  std::vector<std::int64_t> numbers;
  for (const FrameIndex f : frames) numbers.push_back(f.value);
  return numbers;
}

using Numbers = std::vector<std::int64_t>;

TEST(LooseParts, HangOnASingleFrame) {
  Network network(random_centres(9, 1));
  network.link_all({0, 1, 2, 3, 4});
  network.link_all({4, 5, 6, 7});
  network.link(3, 6, 4);
  network.link(2, 7, 3);
  const auto loose = network.loose();
  ASSERT_EQ(loose.size(), 1u);
  EXPECT_EQ(numbers(loose[0].frames), (Numbers{5, 6, 7}));
  EXPECT_EQ(numbers(loose[0].joints), Numbers{4});
  EXPECT_EQ(loose[0].points, 4);
}

TEST(LooseParts, AreHeldByASecondJoint) {
  Network network(random_centres(8, 2));
  network.link_all({0, 1, 2, 3, 4});
  network.link_all({4, 5, 6, 3});
  EXPECT_TRUE(network.loose().empty());
}

// Three sides of a triangle, which have one frame in common each.
TEST(LooseParts, AreHeldByATriangle) {
  Network network(random_centres(9, 3));
  network.link_all({0, 1, 2});
  network.link_all({2, 3, 4});
  EXPECT_EQ(network.loose().size(), 1u);
  network.link_all({4, 5, 0});
  EXPECT_TRUE(network.loose().empty());
}

// Two parts that three links join, none of which has an end with another in common.
TEST(LooseParts, AreHeldByThreeLinks) {
  Network network(random_centres(8, 4));
  network.link_all({0, 1, 2, 3});
  network.link_all({4, 5, 6, 7});
  network.link(0, 4);
  EXPECT_EQ(network.loose().size(), 1u);
  EXPECT_EQ(numbers(network.loose()[0].joints), Numbers{4});
  network.link(1, 5);
  network.link(2, 6);
  EXPECT_TRUE(network.loose().empty());
}

// A ring of four in one plane is a pantograph.
TEST(LooseParts, AreTheSidesOfASquareInOnePlane) {
  const std::vector<Eigen::Vector3d> square{{0, 0, 0},   {5, 1, 0},  {10, 0, 0}, {11, 5, 0},
                                            {10, 10, 0}, {5, 11, 0}, {0, 10, 0}, {-1, 5, 0}};
  Network flat(square);
  Network high(square);
  high.state.frames[FrameIndex(2)].centre.z() = 5;
  for (Network* network : {&flat, &high})
    for (std::int64_t side = 0; side < 4; ++side) network->link_all({2 * side, 2 * side + 1, (2 * side + 2) % 8});
  EXPECT_FALSE(flat.loose().empty());
  EXPECT_TRUE(high.loose().empty());
}

TEST(LooseParts, AreNotThoseWithAKnownLength) {
  Network network(random_centres(8, 5));
  network.link_all({0, 1, 2, 3, 4});
  network.link_all({4, 5, 6, 7});
  ASSERT_EQ(network.loose().size(), 1u);
  Network positions = network;
  for (const std::int64_t f : {6, 7}) positions.block.frames[FrameIndex(f)].position_prior.emplace();
  ASSERT_EQ(positions.loose().size(), 1u);
  EXPECT_EQ(numbers(positions.loose()[0].frames), (Numbers{0, 1, 2, 3})) << "the smaller part has known lengths";
  positions.block.frames[FrameIndex(0)].position_prior.emplace();
  EXPECT_TRUE(positions.loose().empty());
  Network control = network;
  control.block.control_points.resize(2);
  for (ControlPoint& point : control.block.control_points)
    for (const std::int64_t image : {0, 1, 6, 7}) point.measurements.push_back({ImageIndex(image), {1, 1}, 1});
  EXPECT_TRUE(control.loose().empty());
  for (ControlPoint& point : control.block.control_points) point.role = PointRole::kCheck;
  EXPECT_EQ(control.loose().size(), 1u);
  Network vehicle = network;
  vehicle.block.relative_poses.push_back({FrameIndex(0), FrameIndex(1), {}, 1e-3, 0.01});
  vehicle.block.relative_poses.push_back({FrameIndex(5), FrameIndex(6), {}, 1e-3, 0.01});
  EXPECT_TRUE(vehicle.loose().empty());
}

TEST(LooseParts, WithoutAGoodLinkHaveNoJoint) {
  Network network(random_centres(8, 6));
  network.link_all({0, 1, 2, 3, 4});
  network.link_all({5, 6, 7});
  EXPECT_TRUE(network.loose().empty()) << "parts that nothing links are no parts of one block";
  network.link(0, 5, 14);
  const auto loose = network.loose();
  ASSERT_EQ(loose.size(), 1u);
  EXPECT_TRUE(loose[0].joints.empty());
  EXPECT_EQ(loose[0].points, 14);
}

// The null space of the equations (I - d d') (x_b - x_a) = 0 of all links: three shifts, one scale, and a scale for
// each loose part.
std::int64_t free_scales(const Network& network) {
  const auto n = std::ssize(network.block.frames);
  Eigen::MatrixXd equations = Eigen::MatrixXd::Zero(3 * std::ssize(network.links), 3 * n);
  for (std::size_t l = 0; l < network.links.size(); ++l) {
    const auto& [a, b, points] = network.links[l];
    const Eigen::Vector3d d = (network.state.frames[b].centre - network.state.frames[a].centre).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    equations.block<3, 3>(3 * static_cast<Eigen::Index>(l), 3 * b.value) = across;
    equations.block<3, 3>(3 * static_cast<Eigen::Index>(l), 3 * a.value) = -across;
  }
  Eigen::JacobiSVD<Eigen::MatrixXd> svd(equations);
  svd.setThreshold(1e-9);
  return 3 * n - svd.rank() - 4;
}

// Frames that each are linked with some of those before them.
TEST(LooseParts, AreThoseThatTheNullSpaceShows) {
  std::int64_t with = 0, without = 0;
  for (std::uint64_t seed = 0; seed < 600; ++seed) {
    std::mt19937_64 random(seed);
    constexpr int kFrames = 12;
    Network network(random_centres(kFrames, seed + 1000));
    std::set<std::pair<int, int>> pairs;
    for (int f = 1; f < kFrames; ++f)
      for (int k = 0; k < 1 + static_cast<int>(random() % 3); ++k)
        pairs.emplace(static_cast<int>(random() % static_cast<std::uint64_t>(f)), f);
    for (const auto& [a, b] : pairs) network.link(a, b);
    const bool expected = free_scales(network) > 0;
    EXPECT_EQ(!network.loose().empty(), expected) << seed;
    ++(expected ? with : without);
  }
  EXPECT_GT(with, 50);
  EXPECT_GT(without, 50);
}

}  // namespace
}  // namespace megablock
