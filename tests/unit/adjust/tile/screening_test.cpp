#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "adjust/lanes/tile_cost.h"
#include "io/base/error.h"
#include "tests/support/adjust/single_tile.h"

namespace megablock {
namespace {

// Exact observations of a small aerial block at its true poses.
class Screening : public testing::Test {
 protected:
  std::int64_t long_track(std::int64_t count) const { return tile_.long_track(count); }
  std::vector<std::uint8_t> kept(std::int64_t p) const {
    return {tile_.problem.kept.begin() + tile_.problem.begin[p],
            tile_.problem.kept.begin() + tile_.problem.begin[p + 1]};
  }
  std::int64_t screen(double threshold = 4) {
    return screen_observations(tile_.problem, tile_.state, threshold, tile_.options);
  }
  void redirect(std::int64_t row, const Eigen::Vector3d& point) { tile_.redirect(row, point); }
  std::int64_t rejected() const { return std::count(tile_.problem.kept.begin(), tile_.problem.kept.end(), 0); }

  ExactTile tile_;
};

TEST_F(Screening, IntersectsEveryPointAtItsPlace) {
  tile_.state.points = no_points(tile_.problem);
  triangulate_points(tile_.problem, tile_.state, tile_.options);
  const TileState truth = tile_.truth();
  std::int64_t found = 0;
  for (std::int64_t p = 0; p < tile_.problem.point_count(); ++p) {
    if (!tile_.problem.active(p)) continue;
    ++found;
    // Positions are rounded to 2^-10 px.
    EXPECT_LT((tile_.state.points[p] - truth.points[p]).norm(), 0.02);
  }
  EXPECT_GT(found, tile_.problem.point_count() * 9 / 10);
}

TEST_F(Screening, LeavesGoodObservationsAlone) {
  screen();  // holds out narrow points
  const std::int64_t narrow = rejected();
  EXPECT_EQ(screen(), 0);
  EXPECT_LT(narrow, tile_.problem.observation_count() / 20);
}

TEST_F(Screening, FindsAWrongObservationAndRestoresItWhenItIsRight) {
  const std::int64_t p = long_track(4), row = tile_.problem.begin[p] + 1;
  const double x = tile_.problem.x[row];
  tile_.problem.x[row] += 100;
  tile_.state.points[p] += Eigen::Vector3d(2, -1, 3);  // where least squares would have dragged it
  screen();
  std::vector<std::uint8_t> expected(kept(p).size(), 1);
  expected[1] = 0;
  EXPECT_EQ(kept(p), expected);
  EXPECT_LT((tile_.state.points[p] - tile_.truth().points[p]).norm(), 0.02);
  tile_.problem.x[row] = x;
  EXPECT_EQ(screen(), 1);
  EXPECT_EQ(kept(p), std::vector<std::uint8_t>(kept(p).size(), 1));
}

// One residual just beyond the threshold at the adjusted point, all within it at the least squares point.
TEST_F(Screening, LeavesPointsInPlaceWhenNoVerdictChanges) {
  const std::int64_t p = long_track(4);
  screen();
  const Eigen::Vector3d adjusted = tile_.state.points[p] + Eigen::Vector3d(0.17, 0, 0);
  tile_.state.points[p] = adjusted;
  EXPECT_EQ(screen(4), 0);
  EXPECT_EQ(tile_.state.points[p], adjusted);
  tile_.state.points[p].x() += 1;  // that is not a point of these rays
  EXPECT_EQ(screen(4), 0);
  EXPECT_LT((tile_.state.points[p] - tile_.truth().points[p]).norm(), 0.02);
}

TEST_F(Screening, KeepsTheLargerOfTwoConsistentParts) {
  const std::int64_t p = long_track(7), begin = tile_.problem.begin[p], count = tile_.problem.begin[p + 1] - begin;
  const Eigen::Vector3d other = tile_.state.points[p] + Eigen::Vector3d(8, 5, 1);
  for (std::int64_t i = 0; i < 3; ++i) redirect(begin + i, other);
  tile_.state.points[p] = 0.5 * (tile_.state.points[p] + other);
  screen();
  std::vector<std::uint8_t> expected(static_cast<std::size_t>(count), 1);
  std::fill_n(expected.begin(), 3, 0);
  EXPECT_EQ(kept(p), expected);
}

TEST_F(Screening, GivesUpPointsWhoseRaysDoNotMeet) {
  std::int64_t p = 0;
  while (tile_.problem.begin[p + 1] - tile_.problem.begin[p] != 2) ++p;
  const std::int64_t row = tile_.problem.begin[p];
  const double x = tile_.problem.x[row], y = tile_.problem.y[row];
  tile_.problem.x[row] = 1900 - x;
  tile_.problem.y[row] = 1260 - y;
  screen();
  EXPECT_EQ(kept(p), (std::vector<std::uint8_t>{0, 0}));
  tile_.problem.x[row] = x;
  tile_.problem.y[row] = y;
  screen();
  EXPECT_EQ(kept(p), (std::vector<std::uint8_t>{1, 1}));
}

TEST_F(Screening, HoldsOutNarrowPointsButKeepsTheirPlace) {
  const std::int64_t p = long_track(3);
  tile_.options.min_intersection_deg = 80;
  screen();
  EXPECT_FALSE(tile_.problem.active(p));
  EXPECT_LT((tile_.state.points[p] - tile_.truth().points[p]).norm(), 0.02);
  tile_.options.min_intersection_deg = 1.5;
  screen();
  EXPECT_TRUE(tile_.problem.active(p));
}

TEST_F(Screening, RowsWithoutPoseStayRejected) {
  const std::int64_t p = long_track(4), row = tile_.problem.begin[p];
  tile_.problem.image[row] = LocalImage();
  tile_.problem.kept[row] = 0;
  triangulate_points(tile_.problem, tile_.state, tile_.options);
  screen();
  EXPECT_EQ(tile_.problem.kept[row], 0);
  EXPECT_TRUE(tile_.problem.active(p));
}

TEST_F(Screening, PointsBehindACameraAreNotKept) {
  const std::int64_t p = long_track(3);
  tile_.state.points[p].z() += 1000;  // above all cameras
  screen();
  EXPECT_LT((tile_.state.points[p] - tile_.truth().points[p]).norm(), 0.02);  // intersected again
  EXPECT_TRUE(std::isfinite(evaluate_cost(tile_.problem, tile_.state)));
}

TEST_F(Screening, RefusesBadThresholds) {
  EXPECT_THROW(screen(0), InputError);
  EXPECT_THROW(screen(std::nan("")), InputError);
}

}  // namespace
}  // namespace megablock
