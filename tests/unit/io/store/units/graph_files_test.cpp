// Round trips of features, candidates, matches, tiles and adjustments, full and empty.
#include "io/store/units/graph_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "cluster/stages/pipeline/features.h"
#include "io/base/error.h"
#include "io/block/features.h"
#include "io/store/hdf5/hdf5_file.h"
#include "io/store/units/adjustment_file.h"
#include "io/store/units/features_file.h"
#include "io/store/units/state_file.h"
#include "tests/support/io/same_bits.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

class GraphFiles : public ::testing::Test {
 protected:
  ScratchDirectory scratch_;
  std::string path_ = scratch_.path("unit.h5");
};

std::vector<ImageFeatures> example_features() {
  std::vector<ImageFeatures> images(3);
  images[0].image = ImageIndex(64);
  images[0].width = 4000;
  images[0].height = 3000;
  for (int k = 0; k < 300; ++k) {
    images[0].keypoints.push_back({k * 1000, 3071999 - k, 30.5f - 0.1f * static_cast<float>(k), -179.5f});
    SiftDescriptor descriptor;
    for (std::size_t i = 0; i < descriptor.size(); ++i) descriptor[i] = static_cast<std::uint8_t>(31 * i + 7 * k);
    images[0].descriptors.push_back(descriptor);
  }
  images[0].global_descriptor.fill(0.25f);
  images[1].image = ImageIndex(65);
  images[1].failure = "truncated JPEG";
  images[2].image = ImageIndex(70000000000);
  images[2].width = 5;
  images[2].height = 6;
  images[2].keypoints.push_back({1, 2, 3, 4});
  images[2].descriptors.push_back({});
  return images;
}

void expect_equal(const std::vector<ImageFeatures>& a, const std::vector<ImageFeatures>& b, bool with_descriptors) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].image, b[i].image);
    EXPECT_EQ(a[i].width, b[i].width);
    EXPECT_EQ(a[i].height, b[i].height);
    EXPECT_EQ(a[i].failure, b[i].failure);
    ASSERT_EQ(a[i].keypoints.size(), b[i].keypoints.size());
    for (std::size_t k = 0; k < a[i].keypoints.size(); ++k) {
      const Keypoint &left = a[i].keypoints[k], &right = b[i].keypoints[k];
      EXPECT_EQ(left.x, right.x);
      EXPECT_EQ(left.y, right.y);
      EXPECT_EQ(left.scale_px, right.scale_px);
      EXPECT_EQ(left.angle_deg, right.angle_deg);
    }
    EXPECT_EQ(a[i].global_descriptor, b[i].global_descriptor);
    if (with_descriptors) {
      EXPECT_EQ(a[i].descriptors, b[i].descriptors);
    }
  }
}

TEST_F(GraphFiles, FeaturesComeBack) {
  write_features(path_, example_features());
  expect_equal(read_features(path_), example_features(), true);
  expect_equal(read_keypoints(path_), example_features(), false);
}

TEST_F(GraphFiles, EmptyFeaturesComeBack) {
  write_features(path_, {});
  EXPECT_TRUE(read_features(path_).empty());
}

TEST_F(GraphFiles, FeaturesWithoutDescriptorsAreRefused) {
  std::vector<ImageFeatures> images = example_features();
  images[0].descriptors.pop_back();
  EXPECT_THROW(write_features(path_, images), ComputeError);
}

TEST_F(GraphFiles, CandidatesComeBack) {
  CandidateGraph graph;
  graph.pairs = {{ImageIndex(0), ImageIndex(1)},
                 {ImageIndex(0), ImageIndex(90000000000)},
                 {ImageIndex(3), ImageIndex(4)},
                 {ImageIndex(7), ImageIndex(9)}};
  graph.cell_begin = {0, 3, 3, 4};
  graph.cell_pairs = {0, 2, 3, 1};
  write_candidates(path_, graph);
  const CandidateGraph back = read_candidates(path_);
  EXPECT_EQ(back.pairs, graph.pairs);
  EXPECT_EQ(back.cell_begin, graph.cell_begin);
  EXPECT_EQ(back.cell_pairs, graph.cell_pairs);
}

TEST_F(GraphFiles, EmptyCandidatesComeBack) {
  write_candidates(path_, CandidateGraph{{}, {0}, {}});
  const CandidateGraph back = read_candidates(path_);
  EXPECT_TRUE(back.pairs.empty());
  EXPECT_EQ(back.cell_begin, std::vector<std::int64_t>{0});
}

TEST_F(GraphFiles, CellThatNamesNoPairIsRefused) {
  write_candidates(path_, CandidateGraph{{{ImageIndex(0), ImageIndex(1)}}, {0, 1}, {1}});
  EXPECT_THROW(read_candidates(path_), StoreError);
}

TEST_F(GraphFiles, MatchesComeBack) {
  std::vector<VerifiedPair> pairs(3);
  pairs[0] = {{{0.5, -0.5, 0.5, -0.5}, {0.6, 0, 0.8}, {6, 5, 4, 3, 2, 1}, {1, 2, 3, 4, 5, 6}},
              ImageIndex(1),
              ImageIndex(2),
              PairModel::kEssential,
              12.5,
              {0, 5, 7999},
              {7, 3, 0},
              400,
              true,
              std::nullopt};
  pairs[1].a = ImageIndex(1);
  pairs[1].b = ImageIndex(3);
  pairs[1].putative = 3;
  pairs[2].a = ImageIndex(2);
  pairs[2].b = ImageIndex(5000000000);
  pairs[2].model = PairModel::kHomography;
  pairs[2].feature_a = {2};
  pairs[2].feature_b = {9};
  pairs[2].putative = 1;
  pairs[2].twin = PairOrientation{{0, 1, 0, 0}, {0, 0, -1}, {1, 2, 3, 4, 5, 6}, {7, 8, 9, 8, 7, 6}};
  write_matches(path_, pairs);
  const std::vector<VerifiedPair> back = read_matches(path_);
  ASSERT_EQ(back.size(), pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    EXPECT_EQ(back[i].a, pairs[i].a);
    EXPECT_EQ(back[i].b, pairs[i].b);
    EXPECT_EQ(back[i].model, pairs[i].model);
    EXPECT_EQ(back[i].rotation_wxyz, pairs[i].rotation_wxyz);
    EXPECT_EQ(back[i].translation, pairs[i].translation);
    EXPECT_EQ(back[i].median_angle_deg, pairs[i].median_angle_deg);
    EXPECT_EQ(back[i].feature_a, pairs[i].feature_a);
    EXPECT_EQ(back[i].feature_b, pairs[i].feature_b);
    EXPECT_EQ(back[i].putative, pairs[i].putative);
    EXPECT_EQ(back[i].rotation_covariance, pairs[i].rotation_covariance);
    EXPECT_EQ(back[i].base_covariance, pairs[i].base_covariance);
    EXPECT_EQ(back[i].ill_conditioned, pairs[i].ill_conditioned);
    ASSERT_EQ(back[i].twin.has_value(), pairs[i].twin.has_value());
    if (!pairs[i].twin) continue;
    EXPECT_EQ(back[i].twin->rotation_wxyz, pairs[i].twin->rotation_wxyz);
    EXPECT_EQ(back[i].twin->translation, pairs[i].twin->translation);
    EXPECT_EQ(back[i].twin->rotation_covariance, pairs[i].twin->rotation_covariance);
    EXPECT_EQ(back[i].twin->base_covariance, pairs[i].twin->base_covariance);
  }
}

TEST_F(GraphFiles, EmptyMatchesComeBack) {
  write_matches(path_, {});
  EXPECT_TRUE(read_matches(path_).empty());
}

TEST_F(GraphFiles, MatchesOfEarlierVersionsAreRefused) {
  Hdf5Writer file(path_, "matches");
  file.group("pairs");
  file.vector("pairs/a", std::vector<std::int64_t>{1});
  file.close();
  try {
    read_matches(path_);
    FAIL();
  } catch (const StoreError& error) {
    EXPECT_EQ(error.what(), path_ +
                                ": pairs/rotation_covariance: is missing, as earlier versions of this program did "
                                "not write it; delete the file and run again");
  }
}

TEST_F(GraphFiles, TilesComeBack) {
  Tiles tiles;
  tiles.tile_count = 2;
  tiles.tile_of_frame = IndexedVector<FrameIndex, TileIndex>(
      std::vector<TileIndex>{TileIndex(0), TileIndex(1), TileIndex(), TileIndex(1)});
  tiles.component = IndexedVector<FrameIndex, std::int32_t>(std::vector<std::int32_t>{0, 0, -1, 0});
  tiles.separator_depth = IndexedVector<FrameIndex, std::int32_t>(std::vector<std::int32_t>{0, -1, -1, 3});
  tiles.tree.nodes = {{-1, -1, 2, TileIndex(0), 0}, {-1, -1, 2, TileIndex(1), 0}, {0, 1, -1, TileIndex(), 1}};
  tiles.dropped_links = {{FrameIndex(0), FrameIndex(3), 5}};
  write_tiles(path_, tiles);
  const Tiles back = read_tiles(path_);
  EXPECT_EQ(back.tile_count, 2);
  EXPECT_EQ(back.tile_of_frame, tiles.tile_of_frame);
  EXPECT_EQ(back.component, tiles.component);
  EXPECT_EQ(back.separator_depth, tiles.separator_depth);
  EXPECT_EQ(back.dropped_links, tiles.dropped_links);
  ASSERT_EQ(back.tree.nodes.size(), 3u);
  for (std::size_t n = 0; n < 3; ++n) {
    EXPECT_EQ(back.tree.nodes[n].left, tiles.tree.nodes[n].left);
    EXPECT_EQ(back.tree.nodes[n].right, tiles.tree.nodes[n].right);
    EXPECT_EQ(back.tree.nodes[n].parent, tiles.tree.nodes[n].parent);
    EXPECT_EQ(back.tree.nodes[n].tile, tiles.tree.nodes[n].tile);
    EXPECT_EQ(back.tree.nodes[n].level, tiles.tree.nodes[n].level);
  }
}

TEST_F(GraphFiles, EmptyTilesComeBack) {
  write_tiles(path_, Tiles{});
  EXPECT_EQ(read_tiles(path_).tile_count, 0);
}

TEST_F(GraphFiles, FrameInNoTileOfTheFileIsRefused) {
  Tiles tiles;
  tiles.tile_count = 1;
  tiles.tile_of_frame.push_back(TileIndex(1));
  tiles.component.push_back(0);
  write_tiles(path_, tiles);
  EXPECT_THROW(read_tiles(path_), StoreError);
}

TEST_F(GraphFiles, AdjustmentComesBack) {
  TileAdjustment adjustment;
  adjustment.frames = {FrameIndex(3), FrameIndex(70000000000)};
  adjustment.poses = {{Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5), {1, 2, 3}}, {}};
  adjustment.observations = {10, 20};
  adjustment.cameras = {CameraIndex(1)};
  adjustment.intrinsics = {{1, 2, 3, 4, 5, 6, 7, 8}};
  adjustment.camera_observations = {30};
  adjustment.mount_rigs = {RigIndex(2)};
  adjustment.mount_numbers = {5};
  adjustment.mounts = {{Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), {0.1, 0.2, 0.3}}};
  adjustment.mount_observations = {31};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  adjustment.points = {{0.1, 0.2, 0.3}, {nan, nan, nan}};
  adjustment.kept = {1, 0, 1};
  adjustment.image_sigma_px = 0.31;
  adjustment.summary = "2 frames, \xcf\x83\xe2\x82\x80 = 1.01";
  write_adjustment(path_, adjustment);
  const TileAdjustment back = read_adjustment(path_);
  EXPECT_EQ(back.frames, adjustment.frames);
  ASSERT_EQ(back.poses.size(), 2u);
  EXPECT_TRUE(same_bits(back.poses[0], adjustment.poses[0]));
  EXPECT_TRUE(same_bits(back.poses[1], adjustment.poses[1]));
  EXPECT_EQ(back.observations, adjustment.observations);
  EXPECT_EQ(back.cameras, adjustment.cameras);
  EXPECT_EQ(back.intrinsics, adjustment.intrinsics);
  EXPECT_EQ(back.camera_observations, adjustment.camera_observations);
  EXPECT_EQ(back.mount_rigs, adjustment.mount_rigs);
  EXPECT_EQ(back.mount_numbers, adjustment.mount_numbers);
  ASSERT_EQ(back.mounts.size(), 1u);
  EXPECT_TRUE(same_bits(back.mounts[0], adjustment.mounts[0]));
  EXPECT_EQ(back.mount_observations, adjustment.mount_observations);
  ASSERT_EQ(back.points.size(), 2u);
  EXPECT_TRUE(same_bits(back.points[0], adjustment.points[0]));
  EXPECT_TRUE(same_bits(back.points[1], adjustment.points[1]));
  EXPECT_EQ(back.kept, adjustment.kept);
  EXPECT_EQ(back.image_sigma_px, 0.31);
  EXPECT_EQ(back.summary, adjustment.summary);
}

TEST_F(GraphFiles, EmptyAdjustmentComesBack) {
  write_adjustment(path_, {});
  EXPECT_TRUE(read_adjustment(path_).frames.empty());
  EXPECT_EQ(read_adjustment(path_).summary, "");
}

TEST(OrientationFile, KeepsWhyFramesGotNoPose) {
  const ScratchDirectory scratch;
  const std::string path = scratch.path("orientation.h5");
  InitialOrientation orientation;
  orientation.state.frames.resize(2);
  orientation.state.oriented.resize(2);
  orientation.failed = {{FrameIndex(1), "only 3 of its points could be intersected"}};
  orientation.verticals_aside = {{ImageIndex(0), VerticalVerdict::kAgainstGround},
                                 {ImageIndex(1), VerticalVerdict::kContradicted},
                                 {ImageIndex(2), VerticalVerdict::kNoConsensus},
                                 {ImageIndex(3), VerticalVerdict::kAgainstPoses}};
  write_orientation(path, orientation);
  const InitialOrientation read = read_orientation(path);
  EXPECT_EQ(read.state.frames.size(), 2u);
  EXPECT_EQ(read.failed, orientation.failed);
  ASSERT_EQ(read.verticals_aside.size(), 4u);
  EXPECT_EQ(read.verticals_aside[3].verdict, VerticalVerdict::kAgainstPoses);
  EXPECT_EQ(read.verticals_aside[0].image, ImageIndex(0));
  EXPECT_EQ(read.verticals_aside[0].verdict, VerticalVerdict::kAgainstGround);
}

}  // namespace
}  // namespace megablock
