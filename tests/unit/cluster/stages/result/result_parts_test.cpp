// The tracks of a result from the parts of its tiles, against one sort of all of them.
#include "cluster/stages/result/result_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <tuple>

#include "cluster/stages/merge/merge_outcome.h"
#include "cluster/stages/result/provenance.h"
#include "tests/support/io/scratch_directory.h"

namespace megablock {
namespace {

struct Part {
  RankTile tile;
  TrackSet tracks;
  TileCovariance covariance;
};

// Tracks of two to four observations, with keys from a common range; a control point behind them. Images have no pose.
Part made_up_part(std::int64_t number, std::int64_t count, std::int64_t keys) {
  std::mt19937_64 random(static_cast<std::uint64_t>(number));
  Part part;
  part.tile.tile = number;
  TileProblem& problem = part.tile.problem;
  std::vector<std::int64_t> ids;
  for (std::int64_t t = 0; t < count; ++t)
    ids.push_back(static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(keys)));
  std::sort(ids.begin(), ids.end());
  part.tracks.begin = problem.begin = {0};
  for (const std::int64_t id : ids) {
    part.tracks.id.emplace_back(id);
    problem.points.push_back({PointRole::kTie, id});
    part.tile.state.points.emplace_back(static_cast<double>(random() % 1000), 0, static_cast<double>(number));
    for (std::uint64_t o = 2 + random() % 3; o > 0; --o) {
      part.tracks.image.emplace_back(static_cast<std::int64_t>(random() % 9));
      part.tracks.x.push_back(static_cast<std::int32_t>(random() % 100000));
      part.tracks.y.push_back(static_cast<std::int32_t>(random() % 100000));
      part.tracks.feature.push_back(static_cast<std::int32_t>(random() % 500));
      problem.image.push_back(LocalImage(-1));
      problem.kept.push_back(0);
      part.covariance.redundancy_x.push_back(static_cast<float>(random() % 256) / 255);
      part.covariance.redundancy_y.push_back(std::nanf(""));
    }
    part.tracks.begin.push_back(part.tracks.observation_count());
    problem.begin.push_back(part.tracks.observation_count());
    part.covariance.points.push_back(Eigen::Matrix3d::Constant(static_cast<double>(random() % 100)));
  }
  problem.points.push_back({PointRole::kCheck, 2});
  part.tile.state.points.emplace_back(1, 2, 3);
  problem.image.push_back(LocalImage(-1));
  problem.kept.push_back(0);
  problem.begin.push_back(problem.begin.back() + 1);
  part.covariance.points.push_back(Eigen::Matrix3d::Identity());
  for (const std::int32_t x : part.tracks.x) problem.x.push_back(from_fixed_pixel(x));
  for (const std::int32_t y : part.tracks.y) problem.y.push_back(from_fixed_pixel(y));
  problem.x.push_back(0);
  problem.y.push_back(0);
  return part;
}

struct Row {
  std::int64_t key, tile, order;  // ascending by these
  Eigen::Vector3d point;
  double covariance;
  std::vector<std::int64_t> observations;  // image, x, y, feature
  std::vector<int> redundancy;
};

std::vector<Row> rows_of(const Part& part) {
  std::vector<Row> rows;
  for (std::int64_t t = 0; t < part.tracks.track_count(); ++t) {
    const auto row = static_cast<std::size_t>(t);
    Row made{part.tracks.id[row].value,
             part.tile.tile,
             t,
             part.tile.state.points[row],
             part.covariance.points[row](0, 0),
             {},
             {}};
    for (auto o = static_cast<std::size_t>(part.tracks.begin[row]);
         o < static_cast<std::size_t>(part.tracks.begin[row + 1]); ++o) {
      made.observations.insert(made.observations.end(), {part.tracks.image[o].value, part.tracks.x[o], part.tracks.y[o],
                                                         part.tracks.feature[o]});
      made.redundancy.push_back(static_cast<int>(std::lround(255 * part.covariance.redundancy_x[o])));
    }
    rows.push_back(std::move(made));
  }
  return rows;
}

class ResultPartsTest : public testing::TestWithParam<std::vector<std::int64_t>> {};

TEST_P(ResultPartsTest, AreMergedByKeyAndTile) {
  const ScratchDirectory scratch;
  std::vector<PartTracks::File> files;
  std::vector<Row> expected;
  for (const std::int64_t count : GetParam()) {
    const auto tile = static_cast<std::int64_t>(files.size());
    const Part part = made_up_part(tile, count, 3000);
    const TilePart written = write_part(scratch.path(std::to_string(tile)), part.tile, part.tracks, part.covariance);
    EXPECT_EQ(written.track_count, count);
    files.push_back({scratch.path(std::to_string(tile)), written.track_count});
    for (Row& row : rows_of(part)) expected.push_back(std::move(row));
  }
  std::sort(expected.begin(), expected.end(), [](const Row& a, const Row& b) {
    return std::tie(a.key, a.tile, a.order) < std::tie(b.key, b.tile, b.order);
  });
  const PartTracks merged(files, 2);
  ASSERT_EQ(merged.track_count(), static_cast<std::int64_t>(expected.size()));
  TrackResults all;
  merged.visit([&](const TrackResults& batch) { all.append(batch, 0, batch.tracks.id.size()); });
  ASSERT_EQ(all.tracks.id.size(), expected.size());
  for (std::size_t t = 0; t < expected.size(); ++t) {
    const Row& row = expected[t];
    EXPECT_EQ(all.tracks.id[t].value, static_cast<std::int64_t>(t));
    EXPECT_EQ(all.file_tracks[t].value, row.key);
    EXPECT_EQ(all.file_tiles[t].value, row.tile);
    EXPECT_EQ(all.points[t], row.point);
    EXPECT_EQ(all.point_covariance[t](1, 2), 2 * row.covariance);
    std::vector<std::int64_t> observations;
    const auto first = static_cast<std::size_t>(all.tracks.begin[t]);
    for (std::size_t o = first; o < static_cast<std::size_t>(all.tracks.begin[t + 1]); ++o) {
      observations.insert(observations.end(),
                          {all.tracks.image[o].value, all.tracks.x[o], all.tracks.y[o], all.tracks.feature[o]});
      EXPECT_EQ(all.kept[o], 0);
      EXPECT_EQ(all.redundancy_x[o], row.redundancy[o - first]);
      EXPECT_EQ(all.redundancy_y[o], 0);
      EXPECT_TRUE(std::isnan(all.residual_x[o]));  // no pose, no residual
    }
    EXPECT_EQ(observations, row.observations);
  }
}

// Empty tiles, one tile alone, tiles of many pieces, more tracks than a batch holds.
INSTANTIATE_TEST_SUITE_P(Tiles, ResultPartsTest,
                         testing::Values(std::vector<std::int64_t>{}, std::vector<std::int64_t>{0, 0},
                                         std::vector<std::int64_t>{1}, std::vector<std::int64_t>{700, 0, 5, 1500, 512},
                                         std::vector<std::int64_t>{70000, 40000}));

TEST(ResultPartsTest, RestTravelsAsBytes) {
  const ScratchDirectory scratch;
  const Part part = made_up_part(4, 20, 100);
  const TilePart written = write_part(scratch.path("4"), part.tile, part.tracks, part.covariance);
  const TilePart back = TilePart::from_bytes(written.to_bytes());
  EXPECT_EQ(back.tile, 4);
  EXPECT_EQ(back.track_count, 20);
  EXPECT_EQ(back.frames, written.frames);
  ASSERT_EQ(back.control_rows, std::vector<std::int64_t>{2});
  EXPECT_EQ(back.control[0].adjusted, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(back.control[0].covariance, Eigen::Matrix3d::Identity());
  EXPECT_EQ(back.control[0].residual_px.size(), 1u);
  EXPECT_EQ(back.control[0].kept, std::vector<std::uint8_t>{0});
}

TEST(ResultParts, TilesThatKeepFarLessThanOthersAreNamed) {
  const auto part = [](std::int64_t tile, std::int64_t measured, std::int64_t kept) {
    TilePart made;
    made.tile = tile;
    made.measured = measured;
    made.kept = kept;
    return TilePart::from_bytes(made.to_bytes());
  };
  EXPECT_TRUE(judge_kept({}).empty());
  EXPECT_TRUE(judge_kept({part(0, 1000, 20)}).empty()) << "nothing to compare with";
  EXPECT_TRUE(judge_kept({part(0, 1000, 600), part(1, 1000, 990), part(2, 0, 0)}).empty()) << "as photographs are";
  EXPECT_TRUE(judge_kept({part(0, 90, 0), part(1, 1000, 990)}).empty()) << "too few to judge by";
  const std::vector<std::string> lines = judge_kept({part(0, 1000, 950), part(1, 757, 46), part(2, 1000, 930)});
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_THAT(lines[0],
              testing::StartsWith(
                  "tile 1 keeps few observations: 46 of 757 tie point observations (6 %), the others 94 %:"));
  std::vector<TilePart> many{part(9, 100000, 99000)};
  for (std::int64_t t = 0; t < 5; ++t) many.push_back(part(t, 1000, 100 - t));
  const std::vector<std::string> worst = judge_kept(many);
  ASSERT_EQ(worst.size(), 4U);
  EXPECT_THAT(worst[0], testing::HasSubstr("tile 4 keeps few observations: 96 of 1000"));
  EXPECT_THAT(worst[3], testing::StartsWith("2 more tiles"));
}

}  // namespace
}  // namespace megablock
