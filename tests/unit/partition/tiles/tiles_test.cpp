// Tiles of artificial graphs: limits, balance, components, dropped links, and blocks that grow.
#include "partition/tiles/tiles.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <random>
#include <set>

#include "io/base/error.h"
#include "partition/links/link_weights.h"
#include "tests/support/partition/frame_graphs.h"

namespace megablock {
namespace {

std::vector<std::int64_t> tile_sizes(const Tiles& tiles) {
  std::vector<std::int64_t> sizes(static_cast<std::size_t>(tiles.tile_count), 0);
  for (TileIndex tile : tiles.tile_of_frame)
    if (tile.valid()) ++sizes.at(static_cast<std::size_t>(tile.value));
  return sizes;
}

void expect_tiles(const FrameGraph& graph, const Tiles& tiles, const TileOptions& options) {
  expect_tree(tiles.tree, tiles.tile_count);
  for (std::int64_t size : tile_sizes(tiles)) {
    EXPECT_GE(size, 1);
    EXPECT_LE(size, options.tile_max_frames);
  }
  std::map<std::int64_t, std::set<std::int32_t>> components;
  for (std::int64_t f = 0; f < graph.frame_count; ++f) {
    const FrameIndex frame(f);
    EXPECT_EQ(tiles.tile_of_frame[frame].valid(), tiles.component[frame] >= 0);
    components[tiles.tile_of_frame[frame].value].insert(tiles.component[frame]);
  }
  for (const auto& [tile, of_tile] : components) EXPECT_EQ(of_tile.size(), 1u) << "tile " << tile;
  std::vector<FrameEdge> dropped;
  for (const FrameEdge& edge : graph.edges)
    if (tiles.tile_of_frame[edge.a] != tiles.tile_of_frame[edge.b] && edge.weight < options.weak_link_tracks)
      dropped.push_back(edge);
    else
      EXPECT_EQ(tiles.component[edge.a], tiles.component[edge.b]);
  EXPECT_EQ(tiles.dropped_links, dropped);
}

// The frames of a component must be connected without the dropped links.
void expect_connected_components(const FrameGraph& graph, const Tiles& tiles) {
  std::vector<std::int64_t> label(static_cast<std::size_t>(graph.frame_count));
  for (std::size_t i = 0; i < label.size(); ++i) label[i] = static_cast<std::int64_t>(i);
  for (bool changed = true; changed;) {
    changed = false;
    for (const FrameEdge& edge : graph.edges) {
      if (std::binary_search(tiles.dropped_links.begin(), tiles.dropped_links.end(), edge)) continue;
      auto &a = label[static_cast<std::size_t>(edge.a.value)], &b = label[static_cast<std::size_t>(edge.b.value)];
      if (a != b) changed = true, a = b = std::min(a, b);
    }
  }
  std::map<std::int32_t, std::set<std::int64_t>> labels;
  for (std::int64_t f = 0; f < graph.frame_count; ++f)
    if (tiles.component[FrameIndex(f)] >= 0)
      labels[tiles.component[FrameIndex(f)]].insert(label[static_cast<std::size_t>(f)]);
  for (const auto& [component, of_component] : labels) EXPECT_EQ(of_component.size(), 1u);
}

TEST(MakeTiles, FourTilesFromAHundredFrames) {
  TileOptions options;
  const FrameGraph hundred = sorted(100, grid(10, 10));
  const Tiles tiles = make_tiles(hundred, options);
  EXPECT_EQ(tiles.tile_count, 4);
  for (std::int64_t size : tile_sizes(tiles)) EXPECT_NEAR(static_cast<double>(size), 25, 3);
  expect_tiles(hundred, tiles, options);
  EXPECT_EQ(make_tiles(sorted(99, grid(9, 11)), options).tile_count, 1);
}

TEST(MakeTiles, LimitAndInvariants) {
  TileOptions options;
  options.tile_max_frames = 100;
  const FrameGraph graph = sorted(40 * 50, grid(40, 50));
  const Tiles tiles = make_tiles(graph, options);
  expect_tiles(graph, tiles, options);
  EXPECT_GE(tiles.tile_count, 20);
  EXPECT_LE(tiles.tile_count, 26);
  EXPECT_TRUE(tiles.dropped_links.empty());
  EXPECT_GE(tiles.tree.nodes.back().level, 4);
}

// Streets of single frames in a grid: fragments and chains make halves uneven.
TEST(MakeTiles, TilesOfAStreetGridAreBalanced) {
  constexpr std::int64_t kStreets = 40, kPerBlock = 25, kLength = kStreets * kPerBlock;
  std::vector<FrameEdge> edges;
  for (std::int64_t street = 0; street < 2 * kStreets; ++street)
    for (std::int64_t i = 0; i + 1 < kLength; ++i) add(edges, street * kLength + i, street * kLength + i + 1, 300);
  for (std::int64_t s = 0; s < kStreets; ++s)
    for (std::int64_t t = 0; t < kStreets; ++t)
      add(edges, s * kLength + t * kPerBlock, (kStreets + t) * kLength + s * kPerBlock, 300);
  const Tiles tiles = make_tiles(sorted(2 * kStreets * kLength, edges), {});
  const std::vector<std::int64_t> sizes = tile_sizes(tiles);
  const double mean = static_cast<double>(2 * kStreets * kLength) / static_cast<double>(tiles.tile_count);
  EXPECT_LE(static_cast<double>(*std::max_element(sizes.begin(), sizes.end())), 1.1 * mean);
  EXPECT_GE(static_cast<double>(*std::min_element(sizes.begin(), sizes.end())), 0.9 * mean);
  EXPECT_LE(*std::max_element(sizes.begin(), sizes.end()), TileOptions().tile_max_frames);
}

TEST(LinkWeights, AreTheSumsOfWhatWasAdded) {
  std::mt19937_64 generator(2);
  std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> expected;
  LinkWeights links;
  constexpr std::int64_t kFrames = 700;
  for (int i = 0; i < 3'000'000; ++i) {
    const auto a = static_cast<std::int64_t>(generator() % kFrames),
               b = static_cast<std::int64_t>(generator() % kFrames);
    links.add(FrameIndex(a), FrameIndex(b), 1 + i % 3);
    if (a != b) expected[std::minmax(a, b)] += 1 + i % 3;
  }
  for (const std::int64_t frames : {kFrames, std::int64_t{100}}) {
    const FrameGraph graph = links.graph(frames);
    EXPECT_EQ(graph.frame_count, frames);
    std::vector<FrameEdge> edges;
    for (const auto& [pair, weight] : expected)
      if (pair.second < frames) edges.push_back({FrameIndex(pair.first), FrameIndex(pair.second), weight});
    EXPECT_EQ(graph.edges, edges);
  }
}

TEST(LinkWeights, StopAtWhatTheyHold) {
  LinkWeights links;
  EXPECT_THROW(links.add(FrameIndex(0), FrameIndex(std::int64_t{1} << 32), 1), ComputeError);
  links.add(FrameIndex(2), FrameIndex(1), std::int64_t{1} << 40);
  links.add(FrameIndex(1), FrameIndex(2), 1);
  EXPECT_EQ(links.graph(3).edges, (std::vector<FrameEdge>{{FrameIndex(1), FrameIndex(2), 0xffffffff}}));
}

TEST(MakeTiles, SameTilesEveryTime) {
  TileOptions options;
  options.tile_max_frames = 60;
  const FrameGraph graph = sorted(30 * 40, grid(30, 40));
  const Tiles first = make_tiles(graph, options);
  for (int i = 0; i < 3; ++i) {
    std::srand(static_cast<unsigned>(i));  // METIS draws from the generator of the C library
    EXPECT_EQ(make_tiles(graph, options).tile_of_frame, first.tile_of_frame);
  }
}

TEST(MakeTiles, DisjointSetsAreComponentsUnderOneRoot) {
  std::vector<FrameEdge> edges = grid(5, 8, 0);
  for (const FrameEdge& edge : grid(10, 12, 40)) edges.push_back(edge);
  for (const FrameEdge& edge : grid(1, 2, 160)) edges.push_back(edge);
  const FrameGraph graph = sorted(163, edges);  // frame 162 is alone
  TileOptions options;
  const Tiles tiles = make_tiles(graph, options);
  expect_tiles(graph, tiles, options);
  EXPECT_EQ(tiles.component[FrameIndex(40)], 0);  // the largest component
  EXPECT_EQ(tiles.component[FrameIndex(0)], 1);
  EXPECT_EQ(tiles.component[FrameIndex(160)], 2);
  EXPECT_EQ(tiles.component[FrameIndex(162)], -1);
  EXPECT_FALSE(tiles.tile_of_frame[FrameIndex(162)].valid());
  EXPECT_GE(tiles.tile_count, 4);
}

TEST(MakeTiles, ManySmallSetsKeepTheTreeShallow) {
  std::vector<FrameEdge> edges;
  for (int i = 0; i < 300; ++i) add(edges, 2 * i, 2 * i + 1, 30);
  const FrameGraph graph = sorted(600, edges);
  const Tiles tiles = make_tiles(graph, {});
  EXPECT_EQ(tiles.tile_count, 300);
  expect_tiles(graph, tiles, {});
  EXPECT_LE(tiles.tree.nodes.back().level, 9);
}

TEST(MakeTiles, EmptyAndSingleFrame) {
  expect_tiles({0, {}}, make_tiles({0, {}}, {}), {});
  const Tiles single = make_tiles({1, {}}, {});
  EXPECT_EQ(single.tile_count, 0);
  EXPECT_EQ(single.component[FrameIndex(0)], -1);
  expect_tiles({1, {}}, single, {});
}

TEST(MakeTiles, WeakLinkBetweenDistantTilesIsDropped) {
  std::vector<FrameEdge> edges = grid(10, 40);
  add(edges, 0, 399, 5);  // opposite corners: one false match
  add(edges, 20, 21 + 40, 5);
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end(),
                          [](const FrameEdge& a, const FrameEdge& b) { return a.a == b.a && a.b == b.b; }),
              edges.end());
  const FrameGraph graph = sorted(400, edges);
  TileOptions options;
  const Tiles tiles = make_tiles(graph, options);
  expect_tiles(graph, tiles, options);
  EXPECT_TRUE(std::binary_search(tiles.dropped_links.begin(), tiles.dropped_links.end(),
                                 FrameEdge{FrameIndex(0), FrameIndex(399), 5}));
}

TEST(MakeTiles, AWeakBridgeMakesTwoComponents) {
  std::vector<FrameEdge> edges = grid(5, 10, 0);
  for (const FrameEdge& edge : grid(5, 10, 50)) edges.push_back(edge);
  add(edges, 3, 77, 7);
  const FrameGraph graph = sorted(100, edges);
  const Tiles tiles = make_tiles(graph, {});
  expect_tiles(graph, tiles, {});
  EXPECT_NE(tiles.component[FrameIndex(3)], tiles.component[FrameIndex(77)]);
  EXPECT_EQ(tiles.dropped_links.size(), 1u);
}

TEST(MakeTiles, AFrameWithSeveralWeakLinksToOneSetStays) {
  std::vector<FrameEdge> edges = grid(5, 5);
  add(edges, 12, 25, 4);
  add(edges, 13, 25, 4);
  const FrameGraph graph = sorted(26, edges);
  const Tiles tiles = make_tiles(graph, {});
  EXPECT_EQ(tiles.component[FrameIndex(25)], 0);
  expect_tiles(graph, tiles, {});
}

TEST(MakeTiles, PartsHeldByWeakLinksAloneFallApart) {
  std::vector<FrameEdge> edges = grid(10, 10, 0);
  for (const FrameEdge& edge : grid(10, 10, 100)) edges.push_back(edge);
  for (int i = 0; i < 10; ++i) add(edges, 90 + i, 100 + i, 3);  // 30 tracks in total, none strong
  const FrameGraph graph = sorted(200, edges);
  const Tiles tiles = make_tiles(graph, {});
  expect_tiles(graph, tiles, {});
  expect_connected_components(graph, tiles);
  EXPECT_NE(tiles.component[FrameIndex(0)], tiles.component[FrameIndex(199)]);
  EXPECT_EQ(tiles.dropped_links.size(), 10u);
}

TEST(MakeTiles, TilesAreInOnePiece) {
  TileOptions options;
  options.tile_max_frames = 80;
  const FrameGraph graph = sorted(40 * 40, grid(40, 40));
  const Tiles tiles = make_tiles(graph, options);
  std::vector<FrameEdge> inner;
  for (const FrameEdge& edge : graph.edges)
    if (tiles.tile_of_frame[edge.a] == tiles.tile_of_frame[edge.b]) inner.push_back(edge);
  TileOptions whole;
  whole.min_tiles = 1;
  const Tiles pieces = make_tiles(sorted(1600, inner), whole);
  EXPECT_EQ(1 + *std::max_element(pieces.component.begin(), pieces.component.end()), tiles.tile_count);
}

TEST(MakeTiles, HundredThousandFramesInSeconds) {
  std::vector<FrameEdge> edges = grid(316, 316);
  for (int r = 0; r < 316; ++r)
    for (int c = 0; c < 316; ++c)
      for (int step : {2, 3, 4, 5, 6, 7})
        if (c + step < 316) add(edges, r * 316 + c, r * 316 + c + step, 100 / step);
  const FrameGraph graph = sorted(316 * 316, edges);
  const auto start = std::chrono::steady_clock::now();
  const Tiles tiles = make_tiles(graph, {});
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  RecordProperty("seconds", std::to_string(seconds));
  std::cout << graph.edges.size() << " links, " << tiles.tile_count << " tiles, " << seconds << " s\n";
  expect_tiles(graph, tiles, {});
  EXPECT_LT(seconds, 15);  // about 2 s on an idle core
}

TEST(ExtendTiles, KeepsOldAssignmentsAndJoinsTheBestTile) {
  TileOptions options;
  const FrameGraph before = sorted(144, grid(12, 12));
  const Tiles previous = make_tiles(before, options);
  std::vector<FrameEdge> edges = before.edges;
  add(edges, 0, 144, 50);
  add(edges, 1, 144, 50);
  add(edges, 143, 144, 60);
  add(edges, 144, 145, 40);  // a chain of new frames
  const FrameGraph after = sorted(146, edges);
  const Tiles tiles = extend_tiles(after, previous, options);
  expect_tiles(after, tiles, options);
  EXPECT_EQ(tiles.tile_count, previous.tile_count);
  for (std::int64_t f = 0; f < 144; ++f)
    EXPECT_EQ(tiles.tile_of_frame[FrameIndex(f)], previous.tile_of_frame[FrameIndex(f)]);
  ASSERT_EQ(previous.tile_of_frame[FrameIndex(0)], previous.tile_of_frame[FrameIndex(1)]);
  EXPECT_EQ(tiles.tile_of_frame[FrameIndex(144)], tiles.tile_of_frame[FrameIndex(0)]);
  EXPECT_EQ(tiles.tile_of_frame[FrameIndex(145)], tiles.tile_of_frame[FrameIndex(0)]);
}

TEST(ExtendTiles, WithoutNewFramesNothingChanges) {
  TileOptions options;
  options.tile_max_frames = 40;
  std::vector<FrameEdge> edges = grid(12, 12);
  for (const FrameEdge& edge : grid(6, 6, 144)) edges.push_back(edge);
  const FrameGraph graph = sorted(180, edges);
  const Tiles previous = make_tiles(graph, options);
  const Tiles tiles = extend_tiles(graph, previous, options);
  EXPECT_EQ(tiles.tile_of_frame, previous.tile_of_frame);
  EXPECT_EQ(tiles.component, previous.component);
  ASSERT_EQ(tiles.tree.nodes.size(), previous.tree.nodes.size());
  for (std::size_t n = 0; n < tiles.tree.nodes.size(); ++n) {
    EXPECT_EQ(tiles.tree.nodes[n].left, previous.tree.nodes[n].left);
    EXPECT_EQ(tiles.tree.nodes[n].right, previous.tree.nodes[n].right);
    EXPECT_EQ(tiles.tree.nodes[n].tile, previous.tree.nodes[n].tile);
  }
}

TEST(ExtendTiles, BisectsATileOverTheLimit) {
  TileOptions options;
  options.tile_max_frames = 40;
  const FrameGraph before = sorted(120, grid(12, 10));
  const Tiles previous = make_tiles(before, options);
  const FrameGraph after = sorted(240, grid(24, 10));
  const Tiles tiles = extend_tiles(after, previous, options);
  expect_tiles(after, tiles, options);
  expect_connected_components(after, tiles);
  EXPECT_GT(tiles.tile_count, previous.tile_count);
  std::int64_t moved = 0;
  for (std::int64_t f = 0; f < 120; ++f)
    moved += tiles.tile_of_frame[FrameIndex(f)] != previous.tile_of_frame[FrameIndex(f)];
  EXPECT_LT(moved, 60);  // tiles away from the new frames keep all their frames
}

TEST(ExtendTiles, SeparatorsOfFormerFramesStayAndBisectedTilesGetTheirs) {
  TileOptions options;
  options.tile_max_frames = 60;
  std::vector<FrameEdge> edges = grid(12, 20);
  const Tiles previous = make_tiles(sorted(240, edges), options);
  const auto separating = [](const Tiles& tiles) {
    return std::count_if(tiles.separator_depth.begin(), tiles.separator_depth.end(), [](auto d) { return d >= 0; });
  };
  ASSERT_GT(separating(previous), 12);
  options.tile_max_frames = 30;
  for (const FrameEdge& edge : grid(12, 20, 240)) edges.push_back(edge);  // a set without links to the others
  const Tiles tiles = extend_tiles(sorted(480, edges), previous, options);
  ASSERT_GT(tiles.tile_count, previous.tile_count + 8);
  for (std::int64_t f = 0; f < 240; ++f)
    if (const std::int32_t former = previous.depth_of(FrameIndex(f)); former >= 0) {
      EXPECT_EQ(tiles.depth_of(FrameIndex(f)), former);
    }
  EXPECT_GT(separating(tiles), separating(previous));
  for (const FrameEdge& edge : edges) {
    const bool former = edge.b.value < 240;
    if (former && previous.tile_of_frame[edge.a] != previous.tile_of_frame[edge.b]) continue;
    if (tiles.tile_of_frame[edge.a] == tiles.tile_of_frame[edge.b]) continue;
    EXPECT_TRUE(tiles.depth_of(edge.a) >= 0 || tiles.depth_of(edge.b) >= 0);
  }
}

TEST(ExtendTiles, NewSetsAndJoinedComponents) {
  TileOptions options;
  std::vector<FrameEdge> edges = grid(5, 8, 0);
  for (const FrameEdge& edge : grid(5, 7, 40)) edges.push_back(edge);
  const FrameGraph before = sorted(75, edges);
  const Tiles previous = make_tiles(before, options);
  ASSERT_EQ(previous.tile_count, 2);
  add(edges, 10, 75, 30);  // joins the two sets
  add(edges, 50, 75, 20);
  add(edges, 76, 77, 30);  // a set without links to the others
  add(edges, 5, 78, 3);    // too weak: no tile
  const FrameGraph after = sorted(79, edges);
  const Tiles tiles = extend_tiles(after, previous, options);
  expect_tiles(after, tiles, options);
  EXPECT_EQ(tiles.component[FrameIndex(0)], 0);
  EXPECT_EQ(tiles.component[FrameIndex(60)], 0);
  EXPECT_EQ(tiles.component[FrameIndex(77)], 1);
  EXPECT_EQ(tiles.component[FrameIndex(78)], -1);
  EXPECT_EQ(tiles.tile_count, 3);
}

TEST(ExtendTiles, FromNothingAndOntoAShrunkBlock) {
  const FrameGraph graph = sorted(100, grid(10, 10));
  const Tiles fresh = make_tiles(graph, {});
  EXPECT_EQ(extend_tiles(graph, Tiles(), {}).tile_of_frame, fresh.tile_of_frame);
  EXPECT_THROW(extend_tiles(sorted(90, grid(9, 10)), fresh, {}), InputError);
}

TEST(TileOptions, Checked) {
  TileOptions options;
  options.tile_max_frames = 1;
  EXPECT_THROW(make_tiles({}, options), InputError);
  options = {};
  options.weak_link_tracks = 0;
  EXPECT_THROW(options.check(), InputError);
}

}  // namespace
}  // namespace megablock
