// Offsets and products of sizes beyond 2^31 in the merge, on addresses without memory (aliased_memory.h).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>

#include "adjust/lanes/tile_cost.h"
#include "adjust/terms/linearise.h"
#include "io/base/error.h"
#include "merge/front/front.h"
#include "merge/plan/unknowns.h"
#include "merge/scratch/bytes.h"
#include "merge/tile/cell_assembler.h"
#include "merge/tile/condense.h"
#include "partition/tiles/tiles.h"
#include "tests/support/adjust/single_tile.h"
#include "tests/unit/ranges/aliased_memory.h"

namespace megablock {
namespace {

constexpr std::int64_t kTwo31 = std::int64_t{1} << 31;

UnknownList frames(std::int64_t first, std::int64_t end) {
  UnknownList list;
  for (std::int64_t f = first; f < end; ++f) list.push_back({{UnknownKind::kFrame, 0, f}, 6});
  return list;
}

Bytes bytes_of(const TileFactor& factor) {
  ByteWriter writer;
  factor.write(writer);
  return writer.take();
}

TEST(IndexRanges, RowsOfUnknowns) {
  UnknownList list = frames(0, 4);
  for (Unknown& u : list) u.dimension = kTwo31 - 1;
  EXPECT_EQ(total_dimension(list), 4 * (kTwo31 - 1));
  EXPECT_EQ(row_offsets(list),
            (std::vector<std::int64_t>{0, kTwo31 - 1, 2 * (kTwo31 - 1), 3 * (kTwo31 - 1), 4 * (kTwo31 - 1)}));
  EXPECT_EQ(find_unknown(list, {UnknownKind::kFrame, 0, 3}), 3);
}

// Blocks at the far corner of a front of 7 733 frames: 46 398 rows, 2.15e9 entries.
TEST(IndexRanges, BlockAtTheFarCorner) {
  constexpr std::int64_t kFrames = 7733, n = 6 * kFrames;
  Front front({}, frames(0, kFrames));
  const Eigen::Matrix2d block = (Eigen::Matrix2d() << 1, 2, 3, 4).finished();
  add_block(front, n - 2, n - 2, block);
  add_block(front, n - 8, n - 4, block);  // transposed: below the diagonal
  const double* first = front.place(0, 0).values;
  EXPECT_EQ(first[(n - 2) + (n - 2) * n], 1);
  EXPECT_EQ(first[(n - 1) + (n - 2) * n], 3);
  EXPECT_EQ(first[(n - 1) + (n - 1) * n], 4);
  EXPECT_EQ(first[(n - 4) + (n - 7) * n], 3);
}

// 7 733 frames again. Children at both ends; the first frame is eliminated, and the update
// matrix ends with what the last child brought.
TEST(IndexRanges, FrontOfMoreThan2To31Entries) {
  constexpr std::int64_t kFrames = 7733, n = 6 * kFrames;
  ASSERT_GT(n * n, kTwo31);
  Front front(frames(0, 1), frames(1, kFrames));
  const auto child_of = [&](std::int64_t first, std::int64_t end, double diagonal) {
    UpdateMatrix child;
    child.unknowns = frames(first, end);
    const std::int64_t size = total_dimension(child.unknowns);
    for (std::int64_t j = 0; j < size; ++j)
      for (std::int64_t i = j; i < size; ++i)
        child.matrix.push_back(i == j ? diagonal : diagonal / static_cast<double>(100 + 20 * i + j));
    child.rhs.assign(static_cast<std::size_t>(size), 2 * diagonal);
    child.diagonal.assign(static_cast<std::size_t>(size), 3 * diagonal);
    return child;
  };
  const UpdateMatrix last = child_of(kFrames - 2, kFrames, 7);
  front.add(child_of(0, 1, 4));
  front.add(last);
  EXPECT_EQ(front.row_of({UnknownKind::kFrame, 0, kFrames - 1}), n - 6);
  EXPECT_EQ(*front.place(n - 1, n - 1).values, 7);
  Front::Result result = std::move(front).eliminate(0);

  const UpdateMatrix& update = result.update;
  ASSERT_EQ(static_cast<std::int64_t>(update.matrix.size()), (n - 6) * (n - 5) / 2);
  EXPECT_EQ(
      std::vector<double>(update.matrix.end() - static_cast<std::ptrdiff_t>(last.matrix.size()), update.matrix.end()),
      last.matrix);
  EXPECT_EQ(update.rhs.back(), 14);
  EXPECT_EQ(update.diagonal.back(), 21);
  EXPECT_TRUE(update.sums.held.empty());
  EXPECT_GT(result.factor.byte_count(), 6 * n * 8);
  const Step zero{frames(1, kFrames), 1, std::vector<double>(static_cast<std::size_t>(n - 6), 0)};
  const Step step = back_substitute(result.factor, zero);
  EXPECT_EQ(step.find({UnknownKind::kFrame, 0, kFrames - 1})[5], 0);
  EXPECT_NEAR(step.find({UnknownKind::kFrame, 0, 0})[0], 2, 0.5);  // 8 / 4, but for the small off-diagonals
}

// More than BLAS is given in one call are refused.
TEST(IndexRanges, FrontsOfMoreThan100000UnknownsAreRefused) {
  EXPECT_THROW(Front(frames(0, 10000), frames(10000, 17000)), ComputeError);
}

// What update matrices travel as.
TEST(IndexRanges, BytesBeyond2To31) {
  ByteWriter writer;
  writer.value(std::int64_t{1});
  writer.values(std::vector<char>(kTwo31 + 5));
  writer.value(std::int64_t{42});
  const Bytes bytes = writer.take();
  ASSERT_EQ(static_cast<std::int64_t>(bytes.size()), kTwo31 + 5 + 24);

  Bytes read(static_cast<std::size_t>(kTwo31) + 16, 0);
  const std::int64_t count = kTwo31 / 8, behind = 42;
  std::memcpy(read.data(), &count, sizeof count);
  std::memcpy(read.data() + kTwo31 + 8, &behind, sizeof behind);
  ByteReader reader(read);
  EXPECT_EQ(static_cast<std::int64_t>(reader.values<double>().size()), kTwo31 / 8);
  EXPECT_EQ(reader.value<std::int64_t>(), 42);
  EXPECT_TRUE(reader.at_end());

  ByteWriter wrong;  // says more than there is
  wrong.value(std::uint64_t{1} << 61);
  const Bytes truncated = wrong.take();
  EXPECT_THROW(ByteReader(truncated).values<double>(), StoreError);
}

// Rows of observations from 2^31 on: the same normal equations, steps and redundancy numbers as from 0 on.
TEST(IndexRanges, ObservationsBeyond2To31) {
  SimulationOptions options;
  options.frames = 12;
  options.points_per_frame = 40;
  const SingleTile near(options);
  TileState state = near.state;
  state.points = near.truth().points;
  TileProblem far = near.problem;
  const auto shift = [](auto& rows) {
    const auto own = rows;
    rows.assign(static_cast<std::size_t>(kTwo31) + own.size(), {});
    std::copy(own.begin(), own.end(), rows.end() - static_cast<std::ptrdiff_t>(own.size()));
  };
  shift(far.image);
  shift(far.x);
  shift(far.y);
  shift(far.inverse_sigma);
  shift(far.kept);
  for (std::int64_t& row : far.begin) row += kTwo31;
  ASSERT_EQ(far.begin.back(), far.observation_count());

  const TilePlan near_plan = make_lone_tile_plan(near.problem, near.problem.camera_free),
                 far_plan = make_lone_tile_plan(far, far.camera_free);
  const TileCondensation expected = condense_tile(near.problem, near_plan, state, 0),
                         found = condense_tile(far, far_plan, state, 0);
  EXPECT_GT(found.update.sums.observations, 300);
  EXPECT_EQ(found.update.to_bytes(), expected.update.to_bytes());
  EXPECT_EQ(bytes_of(found.factor), bytes_of(expected.factor));
  EXPECT_EQ(evaluate_cost(far, state), evaluate_cost(near.problem, state));
  const TileStep near_step = solve_tile_down(near.problem, near_plan, state, 0, expected.factor, {}),
                 far_step = solve_tile_down(far, far_plan, state, 0, found.factor, {});
  EXPECT_EQ(far_step.unknowns.values, near_step.unknowns.values);
  EXPECT_EQ(far_step.points, near_step.points);
  const TileCovariance near_covariance = covariance_tile(near.problem, near_plan, state, expected.factor, {}),
                       far_covariance = covariance_tile(far, far_plan, state, found.factor, {});
  EXPECT_EQ(far_covariance.points, near_covariance.points);
  EXPECT_EQ(far_covariance.redundancy_y.back(), near_covariance.redundancy_y.back());
}

}  // namespace
}  // namespace megablock
