// Candidate pairs and cells: the nearest neighbours against sorting, and the rules of candidates.h one by one.
#include "partition/candidates/candidates.h"

#include <gmock/gmock.h>

#include <chrono>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "geometry/numbers/angles.h"
#include "io/base/disjoint_sets.h"
#include "io/base/error.h"
#include "partition/candidates/cells.h"
#include "partition/views/kd_tree.h"

namespace megablock {
namespace {

Camera camera() {
  Camera c;
  c.name = "camera";
  c.width = 4000;
  c.height = 3000;
  c.intrinsics = {3000, 2000, 1500, 0, 0, 0, 0, 0};
  return c;
}

// A block of single images, which are added by position.
Block single_photo_block() {
  Block block;
  block.cameras.push_back(camera());
  block.rigs.push_back({"single", {Mount{CameraIndex(0), Pose{}, 0, 0}}});
  return block;
}

ImageIndex add_photo(Block& block, const std::string& name, std::optional<Eigen::Vector3d> position) {
  Frame frame;
  frame.name = name;
  frame.rig = RigIndex(0);
  if (position) frame.position_prior = PositionPrior{*position, Eigen::Vector3d(3, 3, 6), Eigen::Vector3d::Zero()};
  const FrameIndex index = block.frames.next_index();
  block.frames.push_back(frame);
  block.add_image(name, {index, 0, 0});
  return ImageIndex(block.images.next_index().value - 1);
}

std::string photo_name(int i) { return "IMG_" + std::to_string(i) + ".jpg"; }

// Flight lines in alternating directions, slightly irregular, so that distances differ.
Block aerial_block(int rows, int columns, double step = 10, double row_distance = 20) {
  Block block = single_photo_block();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> jitter(-0.5, 0.5);
  for (int r = 0; r < rows; ++r)
    for (int k = 0; k < columns; ++k) {
      const int c = r % 2 ? columns - 1 - k : k;
      add_photo(block, photo_name(r * columns + k),
                Eigen::Vector3d(c * step + jitter(random), r * row_distance + jitter(random), 60));
    }
  return block;
}

std::set<ImagePair> pair_set(const CandidateGraph& graph) { return {graph.pairs.begin(), graph.pairs.end()}; }

bool has(const CandidateGraph& graph, int a, int b) {
  return pair_set(graph).contains({ImageIndex(std::min(a, b)), ImageIndex(std::max(a, b))});
}

void expect_sound(const CandidateGraph& graph, const CandidateOptions& options) {
  EXPECT_TRUE(std::is_sorted(graph.pairs.begin(), graph.pairs.end()));
  EXPECT_EQ(pair_set(graph).size(), graph.pairs.size());
  for (const ImagePair& pair : graph.pairs) EXPECT_LT(pair.a, pair.b);
  ASSERT_FALSE(graph.cell_begin.empty());
  EXPECT_EQ(graph.cell_begin.front(), 0);
  EXPECT_EQ(graph.cell_begin.back(), static_cast<std::int64_t>(graph.pairs.size()));
  std::vector<int> seen(graph.pairs.size(), 0);
  for (std::size_t c = 0; c + 1 < graph.cell_begin.size(); ++c) {
    const auto begin = graph.cell_pairs.begin() + graph.cell_begin[c];
    const auto end = graph.cell_pairs.begin() + graph.cell_begin[c + 1];
    EXPECT_GT(end - begin, 0);
    EXPECT_LE(end - begin, options.cell_pairs);
    EXPECT_TRUE(std::is_sorted(begin, end));
    for (auto row = begin; row != end; ++row) ++seen.at(static_cast<std::size_t>(*row));
  }
  EXPECT_THAT(seen, testing::Each(1));
}

std::int64_t connected_sets(const Block& block, const CandidateGraph& graph) {
  DisjointSets sets(static_cast<std::int64_t>(block.images.size()));
  auto count = static_cast<std::int64_t>(block.images.size());
  for (const ImagePair& pair : graph.pairs) count -= sets.unite(pair.a.value, pair.b.value);
  return count;
}

GlobalDescriptors random_descriptors(std::size_t count, unsigned seed) {
  GlobalDescriptors result(count);
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  for (auto& d : result) {
    float square = 0;
    for (float& x : d) {
      x = normal(random);
      square += x * x;
    }
    for (float& x : d) x /= std::sqrt(square);
  }
  return result;
}

TEST(KdTree, SameAsSortingAllDistances) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> coordinate(0, 30);  // many equal distances
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < 700; ++i) points.emplace_back(coordinate(random), coordinate(random));
  const KdTree tree(points);
  for (int q = 0; q < 60; ++q) {
    const Eigen::Vector2d place(coordinate(random), coordinate(random));
    const auto odd = [](std::int64_t i) { return i % 3 != 0; };
    std::vector<KdTree::Neighbour> all;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (odd(static_cast<std::int64_t>(i)) && (points[i] - place).norm() <= 9)
        all.push_back({(points[i] - place).squaredNorm(), static_cast<std::int64_t>(i)});
    std::sort(all.begin(), all.end());
    all.resize(std::min<std::size_t>(all.size(), 25));
    EXPECT_EQ(tree.nearest(place, 25, 9, odd), all);
  }
  EXPECT_TRUE(KdTree({}).nearest(Eigen::Vector2d::Zero(), 3, 1e9, [](std::int64_t) { return true; }).empty());
}

TEST(Cells, LimitsFixedCutsAndEqualPlaces) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> coordinate(-300, 300);
  std::vector<Eigen::Vector2d> places;
  for (int i = 0; i < 5000; ++i) places.emplace_back(coordinate(random), coordinate(random));
  const auto before = cells_of(places, 100);
  for (const auto& cell : before) EXPECT_LE(cell.size(), 100u);
  places.emplace_back(9000, -4000);  // far away: the extent grows tenfold
  const auto after = cells_of(places, 100);
  EXPECT_EQ(after.size(), before.size() + 1);
  const std::set<std::vector<std::int64_t>> kept(after.begin(), after.end());
  for (const auto& cell : before) EXPECT_TRUE(kept.contains(cell));
  EXPECT_EQ(cells_of(std::vector<Eigen::Vector2d>(950, {3, 4}), 100).size(), 10u);
  EXPECT_TRUE(cells_of({}, 10).empty());
}

TEST(Candidates, NeighboursOnAGridOfPhotos) {
  const Block block = aerial_block(10, 20);
  const CandidateOptions options;
  const CandidateGraph graph = candidate_pairs(block, {}, options);
  expect_sound(graph, options);
  EXPECT_EQ(connected_sets(block, graph), 1);
  // Every image and its eight nearest, by brute force.
  for (std::int64_t i = 0; i < 200; ++i) {
    std::vector<std::pair<double, int>> others;
    for (int j = 0; j < 200; ++j)
      if (j != i)
        others.push_back({(block.frames[FrameIndex(i)].position_prior->position -
                           block.frames[FrameIndex(j)].position_prior->position)
                              .head<2>()
                              .norm(),
                          j});
    std::sort(others.begin(), others.end());
    for (int k = 0; k < 5; ++k)
      EXPECT_TRUE(has(graph, static_cast<int>(i), others[static_cast<std::size_t>(k)].second));
  }
  EXPECT_LT(graph.pairs.size(), 200u * 14);
}

TEST(Candidates, LinesWithDenseImagesAreTiedToTheNextLine) {
  // With 2 m along the line and 30 m across, the 14 nearest of an image are all in its own line.
  const Block block = aerial_block(4, 60, 2, 30);
  CandidateOptions options;
  const CandidateGraph graph = candidate_pairs(block, {}, options);
  int across = 0;
  for (const ImagePair& pair : graph.pairs) across += pair.a.value / 60 != pair.b.value / 60;
  EXPECT_GE(across, 3 * 30);
}

TEST(Candidates, DoNotDependOnTheOrderOfImages) {
  Block block = aerial_block(9, 15);
  block.frames[FrameIndex(40)].position_prior.reset();
  block.frames[FrameIndex(70)].position_prior->position.x() += 10000;
  const GlobalDescriptors descriptors = random_descriptors(135, 3);
  CandidateOptions options;
  options.cell_pairs = 60;
  std::vector<std::size_t> order(135);
  std::iota(order.begin(), order.end(), 0);
  std::mt19937 random(11);
  std::shuffle(order.begin(), order.end(), random);
  Block shuffled = single_photo_block();
  GlobalDescriptors shuffled_descriptors;
  for (std::size_t i : order) {
    const ImageIndex image(static_cast<std::int64_t>(i));
    const ImageIndex added = add_photo(shuffled, block.name_of(image), std::nullopt);
    shuffled.frames[shuffled.images[added].frame] = block.frames[block.images[image].frame];
    shuffled_descriptors.push_back(descriptors[image]);
  }
  const auto by_name = [](const Block& b, const CandidateGraph& graph) {
    std::set<std::set<std::set<std::string>>> cells;
    for (std::size_t c = 0; c + 1 < graph.cell_begin.size(); ++c) {
      std::set<std::set<std::string>> cell;
      for (std::int64_t row = graph.cell_begin[c]; row < graph.cell_begin[c + 1]; ++row) {
        const ImagePair& pair = graph.pairs[static_cast<std::size_t>(graph.cell_pairs[static_cast<std::size_t>(row)])];
        cell.insert({b.name_of(pair.a), b.name_of(pair.b)});
      }
      cells.insert(cell);
    }
    return cells;
  };
  EXPECT_EQ(by_name(block, candidate_pairs(block, descriptors, options)),
            by_name(shuffled, candidate_pairs(shuffled, shuffled_descriptors, options)));
}

TEST(Candidates, FarPairsAreLeftOut) {
  const Block block = aerial_block(5, 20);
  CandidateOptions options;
  options.max_pair_distance_m = 25;
  options.order_neighbours = 0;
  const CandidateGraph graph = candidate_pairs(block, {}, options);
  expect_sound(graph, options);
  EXPECT_FALSE(graph.pairs.empty());
  for (const ImagePair& pair : graph.pairs)
    EXPECT_LE((block.frames[FrameIndex(pair.a.value)].position_prior->position -
               block.frames[FrameIndex(pair.b.value)].position_prior->position)
                  .head<2>()
                  .norm(),
              25);
}

TEST(Candidates, AGpsOutlierDoesNotTearTheGraph) {
  Block block = aerial_block(8, 20);
  const int outlier = 70;
  block.frames[FrameIndex(outlier)].position_prior->position += Eigen::Vector3d(10000, 3000, 0);
  CandidateOptions options;
  options.max_pair_distance_m = 50;
  const CandidateGraph graph = candidate_pairs(block, {}, options);
  EXPECT_EQ(connected_sets(block, graph), 1);
  for (int d : {-2, -1, 1, 2}) EXPECT_TRUE(has(graph, outlier, outlier + d));
  // Also sought between its neighbours in the order of acquisition: images of the next line.
  int other_lines = 0;
  for (const ImagePair& pair : graph.pairs)
    if (pair.a.value == outlier || pair.b.value == outlier)
      other_lines += std::abs(pair.a.value + pair.b.value - 2 * outlier) > 10;
  EXPECT_GE(other_lines, 3);

  GlobalDescriptors descriptors = random_descriptors(160, 4);
  descriptors[ImageIndex(outlier)] = descriptors[ImageIndex(5)];
  EXPECT_TRUE(has(candidate_pairs(block, descriptors, options), outlier, 5));
  EXPECT_FALSE(has(candidate_pairs(aerial_block(8, 20), descriptors, options), outlier, 5));
}

TEST(Candidates, ImagesWithoutPositionGoByDescriptors) {
  Block block = aerial_block(20, 20);
  const ImageIndex lost = add_photo(block, "another.jpg", std::nullopt);
  GlobalDescriptors descriptors = random_descriptors(401, 9);
  for (int i : {33, 34, 35})
    for (std::size_t k = 0; k < 100; ++k) descriptors[ImageIndex(i)][k] = descriptors[lost][k];
  CandidateOptions options;
  options.descriptor_neighbours = 3;
  options.order_neighbours = 0;
  const CandidateGraph graph = candidate_pairs(block, descriptors, options);
  for (int i : {33, 34, 35}) EXPECT_TRUE(has(graph, static_cast<int>(lost.value), i));
  expect_sound(graph, options);
  descriptors[lost].fill(0);  // no descriptor either: only the order of acquisition
  options.order_neighbours = 2;
  EXPECT_EQ(connected_sets(block, candidate_pairs(block, descriptors, options)), 1);
}

TEST(Candidates, WithoutPositionsAllPairsOfASmallBlock) {
  Block block = single_photo_block();
  for (int i = 0; i < 30; ++i) add_photo(block, photo_name(i), std::nullopt);
  CandidateOptions options;
  options.cell_pairs = 50;
  const CandidateGraph graph = candidate_pairs(block, {}, options);
  EXPECT_EQ(graph.pairs.size(), 30u * 29 / 2);
  expect_sound(graph, options);
  EXPECT_LE(graph.cell_begin.size(), 30u);
  options.exhaustive_below = 30;
  EXPECT_EQ(candidate_pairs(block, {}, options).pairs.size(), 29u + 28);  // the order of acquisition remains
}

TEST(Candidates, OrderIsByTimeElseByNumberInTheName) {
  Block block = single_photo_block();
  for (int i = 0; i < 400; ++i) add_photo(block, photo_name(i), std::nullopt);
  CandidateOptions options;
  options.order_neighbours = 1;
  const CandidateGraph by_name = candidate_pairs(block, {}, options);
  EXPECT_EQ(by_name.pairs.size(), 399u);
  EXPECT_TRUE(has(by_name, 9, 10));
  EXPECT_TRUE(has(by_name, 99, 100));
  for (int i = 0; i < 400; ++i) block.frames[FrameIndex(i)].time_s = (i * 7) % 400;
  const CandidateGraph by_time = candidate_pairs(block, {}, options);
  EXPECT_EQ(by_time.pairs.size(), 399u);
  for (const ImagePair& pair : by_time.pairs)
    EXPECT_EQ(std::abs(block.frames[FrameIndex(pair.a.value)].time_s - block.frames[FrameIndex(pair.b.value)].time_s),
              1);
}

// Rotation ground -> camera of a camera that looks along `heading` (radians, clockwise from north), `pitch` below the
// horizon, with an upright image.
Eigen::Quaterniond looking(double heading, double pitch) {
  const Eigen::Vector3d z(std::sin(heading) * std::cos(pitch), std::cos(heading) * std::cos(pitch), -std::sin(pitch));
  const Eigen::Vector3d x(std::cos(heading), -std::sin(heading), 0);
  Eigen::Matrix3d rotation;
  rotation.row(0) = x;
  rotation.row(1) = z.cross(x);
  rotation.row(2) = z;
  return Eigen::Quaterniond(rotation);
}

TEST(Candidates, RigImagesByConesAndViewingDirections) {
  Block block;
  block.cameras.push_back(camera());  // 67 degrees wide
  Rig rig{"rig", {}};
  for (int m = 0; m < 4; ++m)
    rig.mounts.push_back(Mount{CameraIndex(0), Pose{looking(90 * m * kDegree, 0) * looking(0, 0).conjugate()}, 0, 0});
  // Mount rotations turn the rig's camera axes. A fifth camera between two others overlaps both.
  rig.mounts.push_back(Mount{CameraIndex(0), Pose{looking(45 * kDegree, 0) * looking(0, 0).conjugate()}, 0, 0});
  block.rigs.push_back(rig);
  for (int f = 0; f < 30; ++f) {
    Frame frame;
    frame.name = "frame" + std::to_string(f);
    frame.rig = RigIndex(0);
    frame.given_pose = Pose{looking(0, 0), Eigen::Vector3d(0, 4.0 * f, 2)};
    block.frames.push_back(frame);
    for (int m = 0; m < 5; ++m) block.add_image(frame.name + "/" + std::to_string(m), {FrameIndex(f), m, 0});
  }
  const CandidateOptions options;
  const CandidateGraph graph = candidate_pairs(block, {}, options);
  expect_sound(graph, options);
  const auto direction = [&](ImageIndex i) -> Eigen::Vector3d {
    return camera_pose(*block.frames[block.images[i].frame].given_pose, block.mount_of(i).pose).rotation.conjugate() *
           Eigen::Vector3d::UnitZ();
  };
  int within = 0;
  for (const ImagePair& pair : graph.pairs) {
    const double angle = std::acos(std::clamp(direction(pair.a).dot(direction(pair.b)), -1.0, 1.0)) / kDegree;
    EXPECT_LE(angle, 75);
    if (block.images[pair.a].frame == block.images[pair.b].frame) {
      ++within;
      EXPECT_NEAR(angle, 45, 1e-6);
    }
  }
  EXPECT_EQ(within, 2 * 30);
  for (int m = 0; m < 5; ++m) EXPECT_TRUE(has(graph, 50 + m, 55 + m));
}

TEST(Candidates, FootprintsDecideForObliqueViews) {
  // Two lines 100 m apart at 100 m height. One looks at the ground below the other, 45 degrees to the east.
  Block block = single_photo_block();
  for (int i = 0; i < 40; ++i) add_photo(block, "nadir" + std::to_string(i), Eigen::Vector3d(100, 5.0 * i, 100));
  for (int i = 0; i < 40; ++i) add_photo(block, "oblique" + std::to_string(i), Eigen::Vector3d(0, 5.0 * i, 100));
  for (int i = 0; i < 40; ++i) add_photo(block, "west" + std::to_string(i), Eigen::Vector3d(-60, 5.0 * i, 100));
  for (int i = 0; i < 120; ++i)
    block.frames[FrameIndex(i)].attitude_prior =
        AttitudePrior{looking(90 * kDegree, (i / 40 == 1 ? 45 : 90) * kDegree), Eigen::Vector3d::Constant(0.05)};
  ControlPoint ground;
  ground.name = "ground";
  block.control_points.push_back(ground);
  CandidateOptions options;
  options.order_neighbours = 0;
  const CandidateGraph graph = candidate_pairs(block, {}, options);
  for (int i = 0; i < 40; ++i) EXPECT_TRUE(has(graph, i, 40 + i));
  for (const ImagePair& pair : graph.pairs) {
    const bool away_from_ends = pair.a.value % 40 >= 10 && pair.a.value % 40 < 30;
    EXPECT_FALSE(away_from_ends && pair.a.value / 40 == 1 && pair.b.value / 40 == 2);
  }
}

TEST(ExtendCandidates, FormerPairsAndCellsStay) {
  Block block = aerial_block(12, 20);
  CandidateOptions options;
  options.cell_pairs = 80;
  const CandidateGraph before = candidate_pairs(block, {}, options);
  const ImageIndex added = add_photo(block, "IMG_9999.jpg", Eigen::Vector3d(93, 111, 60));
  const CandidateGraph after = extend_candidates(before, block, {}, options, added);
  expect_sound(after, options);
  std::set<ImagePair> expected = pair_set(before);
  for (const ImagePair& pair : candidate_pairs(block, {}, options).pairs)
    if (pair.b == added) expected.insert(pair);
  EXPECT_EQ(pair_set(after), expected);
  EXPECT_GE(after.pairs.size() - before.pairs.size(), 14u);
  const auto cell = [](const CandidateGraph& graph, std::size_t c) {
    std::vector<ImagePair> pairs;
    for (std::int64_t row = graph.cell_begin[c]; row < graph.cell_begin[c + 1]; ++row)
      pairs.push_back(graph.pairs[static_cast<std::size_t>(graph.cell_pairs[static_cast<std::size_t>(row)])]);
    return pairs;
  };
  for (std::size_t c = 0; c + 1 < before.cell_begin.size(); ++c) EXPECT_EQ(cell(after, c), cell(before, c));
  EXPECT_LE(after.cell_begin.size(), before.cell_begin.size() + 2);
  EXPECT_THROW(extend_candidates(after, block, {}, options, added), InputError);
}

TEST(Candidates, EmptyBlockSingleImageAndEqualPositions) {
  const CandidateOptions options;
  Block block = single_photo_block();
  expect_sound(candidate_pairs(block, {}, options), options);
  add_photo(block, "one.jpg", Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(candidate_pairs(block, {}, options).pairs.empty());
  for (int i = 0; i < 300; ++i) add_photo(block, photo_name(i), Eigen::Vector3d(1, 2, 3));
  const CandidateGraph graph = candidate_pairs(block, {}, options);
  expect_sound(graph, options);
  EXPECT_EQ(connected_sets(block, graph), 1);
}

TEST(Candidates, FiftyThousandImagesInSeconds) {
  const Block block = aerial_block(200, 250);
  const auto start = std::chrono::steady_clock::now();
  const CandidateGraph graph = candidate_pairs(block, {}, {});
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::cout << graph.pairs.size() << " pairs, " << graph.cell_begin.size() - 1 << " cells, " << seconds << " s\n";
  EXPECT_EQ(connected_sets(block, graph), 1);
  EXPECT_LT(seconds, 20);
}

TEST(CandidateOptions, Checked) {
  const Block block = aerial_block(2, 3);
  CandidateOptions options;
  options.neighbours = 0;
  EXPECT_THROW(candidate_pairs(block, {}, options), InputError);
  options = {};
  options.max_pair_distance_m = -2;
  EXPECT_THROW(options.check(), InputError);
  options = {};
  options.cell_pairs = 0;
  EXPECT_THROW(options.check(), InputError);
  EXPECT_THROW(candidate_pairs(block, random_descriptors(5, 1), {}), ComputeError);
}

}  // namespace
}  // namespace megablock
