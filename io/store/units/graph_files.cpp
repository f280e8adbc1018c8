// Reads and writes candidate pairs, verified matches and tiles (docs/reference/file-formats.md, "Candidates",
// "Matches", "Tiles").
#include "io/store/units/graph_files.h"

#include <algorithm>

#include "io/store/hdf5/hdf5_tables.h"
#include "io/store/units/hdf5_tiles.h"

namespace megablock {

void write_candidates(const std::string& path, const CandidateGraph& graph) {
  Hdf5Writer file(path, "candidates");
  file.group("pairs", "pairs of images (a, b), a < b, ascending");
  file.integers("pairs/a_difference", differences(column(graph.pairs, [](const ImagePair& p) { return p.a.value; })),
                {"", "image index a, minus that of the row before"});
  file.integers("pairs/b_minus_a", column(graph.pairs, [](const ImagePair& p) { return p.b.value - p.a.value; }));
  file.group("cells", "spatial cells, the units of matching");
  file.integers("cells/pairs", counts_of(graph.cell_begin),
                {"", "number of pairs: rows of 'cells/pair_difference', in the order of the cells"});
  file.integers("cells/pair_difference", differences(graph.cell_pairs), {"", "row in pairs, minus that before"});
  file.close();
}

CandidateGraph read_candidates(const std::string& path) {
  const Hdf5Reader file(path, "candidates");
  // The columns hold differences, which are small numbers and take little space.
  const auto first = cumulate(file.vector<std::int64_t>("pairs/a_difference"));
  const auto offset = file.vector<std::int64_t>("pairs/b_minus_a", static_cast<std::int64_t>(first.size()));
  CandidateGraph graph;
  graph.pairs.reserve(first.size());
  for (std::size_t i = 0; i < first.size(); ++i)
    graph.pairs.push_back({ImageIndex(first[i]), ImageIndex(first[i] + offset[i])});
  graph.cell_pairs = cumulate(file.vector<std::int64_t>("cells/pair_difference"));
  for (const std::int64_t row : graph.cell_pairs)
    if (row < 0 || row >= static_cast<std::int64_t>(graph.pairs.size()))
      file.fail("cells/pair_difference", "refers to a pair that does not exist");
  graph.cell_begin = begin_of(file, "cells/pairs", file.vector<std::int64_t>("cells/pairs"),
                              static_cast<std::int64_t>(graph.cell_pairs.size()));
  return graph;
}

namespace {

// The columns of relative orientations within a group.
void put_orientations(Hdf5Writer& file, const std::string& group, const std::vector<const PairOrientation*>& of) {
  const auto column = [&](auto member) {
    std::vector<double> values;
    for (const PairOrientation* orientation : of) {
      const auto& some = orientation->*member;
      values.insert(values.end(), some.begin(), some.end());
    }
    return values;
  };
  file.matrix(group + "/rotation_wxyz", column(&PairOrientation::rotation_wxyz), 4,
              {"", "unit quaternion, camera a -> camera b"});
  file.matrix(group + "/translation", column(&PairOrientation::translation), 3,
              {"", "X_b = R X_a + t; length 1, or 0 when rotation only"});
  file.matrix(group + "/rotation_covariance", column(&PairOrientation::rotation_covariance), 6,
              {"rad^2", "of w of R Exp(w), axes of a: xx, xy, xz, yy, yz, zz; all 0: not known"});
  file.matrix(group + "/base_covariance", column(&PairOrientation::base_covariance), 6,
              {"", "of the translation at length 1, axes of b: xx, xy, xz, yy, yz, zz"});
}

std::vector<PairOrientation> get_orientations(const Hdf5Reader& file, const std::string& group, std::int64_t count) {
  std::vector<PairOrientation> result(static_cast<std::size_t>(count));
  const auto column = [&](const char* name, auto member) {
    const std::size_t columns = (PairOrientation{}.*member).size();
    const auto values = file.matrix<double>(group + name, static_cast<std::int64_t>(columns), count);
    for (std::size_t i = 0; i < result.size(); ++i)
      std::copy_n(&values[columns * i], columns, (result[i].*member).begin());
  };
  if (count == 0) return result;
  column("/rotation_wxyz", &PairOrientation::rotation_wxyz);
  column("/translation", &PairOrientation::translation);
  column("/rotation_covariance", &PairOrientation::rotation_covariance);
  column("/base_covariance", &PairOrientation::base_covariance);
  return result;
}

// The second orientations of pairs over planes.
void put_twins(Hdf5Writer& file, const std::vector<VerifiedPair>& pairs) {
  std::vector<std::int64_t> row;
  std::vector<const PairOrientation*> twins;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!pairs[i].twin) continue;
    row.push_back(static_cast<std::int64_t>(i));
    twins.push_back(&*pairs[i].twin);
  }
  file.group("twins", "second orientations of pairs over a plane, which explain the matches nearly as well");
  file.integers("twins/pair_difference", differences(row), {"", "row in pairs, minus that of the row before"});
  put_orientations(file, "twins", twins);
}

void get_twins(const Hdf5Reader& file, std::vector<VerifiedPair>& pairs) {
  const auto row = cumulate(file.vector<std::int64_t>("twins/pair_difference"));
  const auto twins = get_orientations(file, "twins", std::ssize(row));
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (row[i] < 0 || row[i] >= std::ssize(pairs))
      file.fail("twins/pair_difference", "refers to a pair that does not exist");
    pairs[static_cast<std::size_t>(row[i])].twin = twins[i];
  }
}

}  // namespace

void write_matches(const std::string& path, const std::vector<VerifiedPair>& pairs) {
  std::vector<const PairOrientation*> orientations;
  std::vector<std::int64_t> feature_a, feature_b;
  for (const VerifiedPair& pair : pairs) {
    orientations.push_back(&pair);
    // Differences of rows start anew in each pair.
    std::int64_t previous = 0;
    for (const std::int32_t row : pair.feature_a) {
      feature_a.push_back(row - previous);
      previous = row;
    }
    feature_b.insert(feature_b.end(), pair.feature_b.begin(), pair.feature_b.end());
  }
  const auto value = [&](auto get) { return column(pairs, get); };
  Hdf5Writer file(path, "matches");
  file.group("pairs", "one row per pair of images a < b");
  file.vector("pairs/a", value([](const VerifiedPair& p) { return p.a.value; }), {"", "image index"});
  file.vector("pairs/b", value([](const VerifiedPair& p) { return p.b.value; }), {"", "image index"});
  file.vector("pairs/model", value([](const VerifiedPair& p) { return static_cast<std::uint8_t>(p.model); }),
              {"", "0: not verified, 1: essential matrix, 2: homography, 3: rotation only"});
  put_orientations(file, "pairs", orientations);
  file.vector("pairs/ill_conditioned",
              value([](const VerifiedPair& p) { return static_cast<std::uint8_t>(p.ill_conditioned); }),
              {"", "1: the matches hardly determine the direction of the base"});
  file.vector("pairs/median_angle", value([](const VerifiedPair& p) { return p.median_angle_deg; }),
              {"deg", "median intersection angle of the inliers' rays"});
  file.vector("pairs/putative", value([](const VerifiedPair& p) { return p.putative; }),
              {"", "number of matches before verification"});
  file.integers("pairs/inliers",
                value([](const VerifiedPair& p) { return static_cast<std::int64_t>(p.feature_a.size()); }),
                {"", "number of rows of the group 'inliers', in the order of the pairs"});
  put_twins(file, pairs);
  file.group("inliers", "matches that passed the verification");
  file.integers("inliers/feature_a_difference", feature_a,
                {"", "row in the features of a, minus that of the inlier before in the pair"});
  file.integers("inliers/feature_b", feature_b, {"", "row in the features of b"});
  file.close();
}

std::vector<VerifiedPair> read_matches(const std::string& path) {
  const Hdf5Reader file(path, "matches");
  if (!file.has("pairs/rotation_covariance"))
    file.fail("pairs/rotation_covariance", "is missing, as earlier versions of this program did not write it");
  const auto a = file.vector<std::int64_t>("pairs/a");
  const auto count = static_cast<std::int64_t>(a.size());
  const auto b = file.vector<std::int64_t>("pairs/b", count);
  const auto model = file.vector<std::uint8_t>("pairs/model", count);
  const auto orientations = get_orientations(file, "pairs", count);
  const auto ill_conditioned = file.vector<std::uint8_t>("pairs/ill_conditioned", count);
  const auto angle = file.vector<double>("pairs/median_angle", count);
  const auto putative = file.vector<std::int32_t>("pairs/putative", count);
  const auto feature_a = file.vector<std::int64_t>("inliers/feature_a_difference");
  const auto rows = static_cast<std::int64_t>(feature_a.size());
  const auto feature_b = file.vector<std::int32_t>("inliers/feature_b", rows);
  const auto begin = begin_of(file, "pairs/inliers", file.vector<std::int64_t>("pairs/inliers", count), rows);
  std::vector<VerifiedPair> pairs(a.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    VerifiedPair& pair = pairs[i];
    if (model[i] > static_cast<std::uint8_t>(PairModel::kRotationOnly))
      file.fail("pairs/model", "holds an unknown model");
    pair.a = ImageIndex(a[i]);
    pair.b = ImageIndex(b[i]);
    pair.model = static_cast<PairModel>(model[i]);
    static_cast<PairOrientation&>(pair) = orientations[i];
    pair.ill_conditioned = ill_conditioned[i] != 0;
    pair.median_angle_deg = angle[i];
    pair.putative = putative[i];
    std::int64_t row = 0;
    for (std::int64_t k = begin[i]; k < begin[i + 1]; ++k) {
      row += feature_a[static_cast<std::size_t>(k)];
      pair.feature_a.push_back(static_cast<std::int32_t>(row));
    }
    pair.feature_b.assign(feature_b.begin() + begin[i], feature_b.begin() + begin[i + 1]);
  }
  get_twins(file, pairs);
  return pairs;
}

void put_tiles(Hdf5Writer& file, const Tiles& tiles) {
  using Node = MergeTree::Node;
  const std::vector<Node>& nodes = tiles.tree.nodes;
  file.group("tiles", "leaves of the recursive bisection");
  file.attribute("tiles", "count", tiles.tile_count);
  file.integers("tiles/tile_of_frame", plain(tiles.tile_of_frame), {"", "-1: frame without any verified link"});
  file.vector("tiles/component_of_frame", tiles.component, {"", "connected component, 0: largest, -1: none"});
  std::vector<std::int64_t> depths;
  for (FrameIndex f(0); f < tiles.tile_of_frame.next_index(); ++f.value) depths.push_back(tiles.depth_of(f));
  file.integers("tiles/separator_depth", depths,
                {"", "depth in the merge tree of the node whose halves the frame separates, 0: root, -1: none"});
  file.group("tiles/tree", "merge tree, children before parents; -1: none");
  file.integers("tiles/tree/left", column(nodes, [](const Node& n) { return n.left; }));
  file.integers("tiles/tree/right", column(nodes, [](const Node& n) { return n.right; }));
  file.integers("tiles/tree/parent", column(nodes, [](const Node& n) { return n.parent; }));
  file.integers("tiles/tree/tile", column(nodes, [](const Node& n) { return n.tile.value; }), {"", "of a leaf"});
  file.integers("tiles/tree/level", column(nodes, [](const Node& n) { return std::int64_t{n.level}; }),
                {"", "0: leaf, else 1 + the larger of the children's"});
  const std::vector<FrameEdge>& dropped = tiles.dropped_links;
  file.group("tiles/dropped_links", "weak links between tiles, dropped before the tree was fixed");
  file.integers("tiles/dropped_links/a", column(dropped, [](const FrameEdge& e) { return e.a.value; }), {"", "frame"});
  file.integers("tiles/dropped_links/b", column(dropped, [](const FrameEdge& e) { return e.b.value; }), {"", "frame"});
  file.integers("tiles/dropped_links/tracks", column(dropped, [](const FrameEdge& e) { return e.weight; }));
}

Tiles get_tiles(const Hdf5Reader& file) {
  Tiles tiles;
  tiles.tile_count = file.attribute<std::int64_t>("tiles", "count");
  tiles.tile_of_frame =
      IndexedVector<FrameIndex, TileIndex>(indices<TileIndex>(file.vector<std::int64_t>("tiles/tile_of_frame")));
  for (const TileIndex tile : tiles.tile_of_frame)
    if (tile.value < -1 || tile.value >= tiles.tile_count)
      file.fail("tiles/tile_of_frame", "refers to a tile that does not exist");
  tiles.component = IndexedVector<FrameIndex, std::int32_t>(
      file.vector<std::int32_t>("tiles/component_of_frame", static_cast<std::int64_t>(tiles.tile_of_frame.size())));
  if (file.has("tiles/separator_depth"))  // earlier versions of the program did not write it
    tiles.separator_depth = IndexedVector<FrameIndex, std::int32_t>(
        file.vector<std::int32_t>("tiles/separator_depth", static_cast<std::int64_t>(tiles.tile_of_frame.size())));
  for (const std::int32_t depth : tiles.separator_depth)
    if (depth < -1) file.fail("tiles/separator_depth", "is below -1");
  const auto left = file.vector<std::int64_t>("tiles/tree/left");
  const auto count = static_cast<std::int64_t>(left.size());
  const auto right = file.vector<std::int64_t>("tiles/tree/right", count);
  const auto parent = file.vector<std::int64_t>("tiles/tree/parent", count);
  const auto tile = file.vector<std::int64_t>("tiles/tree/tile", count);
  const auto level = file.vector<std::int32_t>("tiles/tree/level", count);
  for (std::size_t i = 0; i < left.size(); ++i)
    tiles.tree.nodes.push_back({left[i], right[i], parent[i], TileIndex(tile[i]), level[i]});
  const auto a = file.vector<std::int64_t>("tiles/dropped_links/a");
  const auto links = static_cast<std::int64_t>(a.size());
  const auto b = file.vector<std::int64_t>("tiles/dropped_links/b", links);
  const auto tracks = file.vector<std::int64_t>("tiles/dropped_links/tracks", links);
  for (std::size_t i = 0; i < a.size(); ++i)
    tiles.dropped_links.push_back({FrameIndex(a[i]), FrameIndex(b[i]), tracks[i]});
  return tiles;
}

void write_tiles(const std::string& path, const Tiles& tiles) {
  Hdf5Writer file(path, "tiles");
  put_tiles(file, tiles);
  file.close();
}

Tiles read_tiles(const std::string& path) { return get_tiles(Hdf5Reader(path, "tiles")); }

}  // namespace megablock
