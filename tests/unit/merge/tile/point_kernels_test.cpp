// The kernels over observations and points: against plain matrices, with the same bits on all processors.
#include "merge/tile/point_kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <random>

#include "adjust/lanes/observation_lanes.h"
#include "geometry/transform/rotation.h"
#include "merge/tile/point_equations.h"

namespace megablock {
namespace {

using namespace point_kernels;

constexpr std::int64_t kCount = 16, kStride = 24;
constexpr double kLambda = 0.01, kFloor = 1e-12;
// The frames of four observations, as if they belonged to one point.
constexpr std::array<std::int64_t, 4> kFramesOfPairs{1, 0, 3, 2};
constexpr std::size_t kPairs = pair_number(4, 0);

const Kernels* kernels_of_width(int width) {
  if (lane_kernels_of_width(width) == nullptr) return nullptr;  // not on this processor
  return width == 8 ? &kAvx512 : width == 4 ? &kAvx2 : &kPortable;
}

// The results of the kernels for sixteen observations of eight points, two of each point.
struct Worked {
  std::vector<double> linearised = random(lane_kernels::kValueCount * kStride, 1);
  std::vector<double> points = std::vector<double>(kPointValueCount * kStride, 0.0);
  alignas(64) std::array<double, kCount * kRecordSize> records{}, point_sums{}, steps{};
  alignas(64) std::array<double, kCount * kYSize> y{};
  alignas(64) std::array<std::array<double, kFrameSize>, 2> frames{};  // of the even observations, of the odd ones
  alignas(64) std::array<std::array<double, 8>, 2> motions{};
  std::vector<double> moved = std::vector<double>(3 * kStride, 0.0);
  alignas(64) std::array<double, kPairs* kPairSize> pairs = first_pairs();
  std::array<std::uint8_t, kPairs> used{};

  static std::vector<double> random(std::int64_t count, unsigned seed) {
    std::mt19937_64 generator(seed);
    std::normal_distribution<double> normal;
    std::vector<double> list(static_cast<std::size_t>(count));
    for (double& value : list) value = normal(generator);
    return list;
  }
  static std::array<double, kPairs * kPairSize> first_pairs() {
    std::array<double, kPairs * kPairSize> pairs;
    std::ranges::copy(random(std::ssize(pairs), 3), pairs.begin());
    return pairs;
  }
  // Element (row, column) of the matrix of the frames, below the blocks on its diagonal.
  static double element(const std::array<double, kPairs * kPairSize>& pairs, std::int64_t row, std::int64_t column) {
    return pairs[static_cast<std::size_t>(pair_number(row / 6, column / 6) * kPairSize + column % 6 * kPairStride +
                                          row % 6)];
  }
  double value(const std::vector<double>& from, int v, std::int64_t lane) const {
    return from[static_cast<std::size_t>(v * kStride + lane)];
  }

  explicit Worked(const Kernels& kernels) {
    const Columns of_points{points.data(), kStride};
    kernels.normal(linearised.data(), kStride, kCount, records.data());
    std::array<std::int64_t, kCount / 2 + 1> begin;
    for (std::size_t p = 0; p < begin.size(); ++p) begin[p] = 2 * static_cast<std::int64_t>(p);
    kernels.sum(kCount / 2, begin.data(), records.data(), point_sums.data());
    for (std::size_t v = 0; v < 6; ++v) point_sums[7 * kRecordSize + v] = 0;  // nothing observes it
    kernels.factorise(kCount / 2, kLambda, kFloor, point_sums.data(), of_points, steps.data());
    std::array<const double*, kCount> step_of_lane;
    for (std::size_t lane = 0; lane < kCount; ++lane) step_of_lane[lane] = steps.data() + lane / 2 * kRecordSize;
    std::array<double*, kCount> sums;
    std::array<const double*, kCount> of_lane;
    for (std::size_t m = 0; m < 2; ++m)
      for (std::size_t k = 0; k < 6; ++k) motions[m][k] = 0.1 * static_cast<double>(k) - 0.3 * static_cast<double>(m);
    for (std::size_t lane = 0; lane < kCount; ++lane) {
      sums[lane] = frames[lane % 2].data();
      of_lane[lane] = motions[lane % 2].data();
    }
    kernels.reduce(records.data(), kCount, step_of_lane.data(), y.data(), sums.data());
    kernels.move(records.data(), kCount, of_lane.data(), moved.data(), kStride);
    constexpr std::array<std::int64_t, 2> kOnePoint{0, 4};
    kernels.subtract_pairs(1, kOnePoint.data(), y.data(), kFramesOfPairs.data(), {pairs.data(), used.data()});
  }

  Eigen::Matrix<double, 2, 3> by_point(std::int64_t lane) const {
    Eigen::Matrix<double, 2, 3> j;
    for (int k = 0; k < 6; ++k) j(k / 3, k % 3) = value(linearised, lane_kernels::kByPoint + k, lane);
    return j;
  }
  Eigen::Vector3d three(const std::vector<double>& from, int v, std::int64_t lane) const {
    return {value(from, v, lane), value(from, v + 1, lane), value(from, v + 2, lane)};
  }
  Eigen::Matrix3d lower(const std::vector<double>& from, int v, std::int64_t lane) const {
    Eigen::Matrix3d m = Eigen::Matrix3d::Zero();
    for (int i = 0, k = v; i < 3; ++i)
      for (int j = 0; j <= i; ++j) m(i, j) = value(from, k++, lane);
    return m;
  }
};

Eigen::Matrix<double, 3, 6> turned_and_moved(const Eigen::Vector3d& u) {  // G
  Eigen::Matrix<double, 3, 6> g;
  g << -skew<double>(u), -Eigen::Matrix3d::Identity();
  return g;
}

class PointKernels : public testing::TestWithParam<int> {
 protected:
  void SetUp() override {
    if (kernels_of_width(GetParam()) == nullptr) GTEST_SKIP() << "this processor has no such vectors";
  }
};

TEST_P(PointKernels, EqualPlainMatrices) {
  const Worked w(*kernels_of_width(GetParam()));
  std::array<Eigen::Matrix<double, 6, 6>, 2> normal{Eigen::Matrix<double, 6, 6>::Zero(),
                                                    Eigen::Matrix<double, 6, 6>::Zero()};
  std::array<Eigen::Matrix<double, 6, 1>, 2> rhs{Eigen::Matrix<double, 6, 1>::Zero(),
                                                 Eigen::Matrix<double, 6, 1>::Zero()},
      diagonal = rhs;
  Eigen::Matrix<double, 6, 3> factors[kCount];
  for (std::int64_t lane = 0; lane < kCount; ++lane) {
    const std::int64_t point = lane / 2, first = 2 * point;
    Eigen::Matrix3d v = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
    for (const std::int64_t k : {first, first + 1}) {
      const Eigen::Matrix<double, 2, 3> j = w.by_point(k);
      v += j.transpose() * j;
      b -= j.transpose() * Eigen::Vector2d(w.value(w.linearised, lane_kernels::kResidual, k),
                                           w.value(w.linearised, lane_kernels::kResidual + 1, k));
    }
    const Eigen::Matrix3d inverse = w.lower(w.points, kPointInverse, point);
    if (point == 7) {
      EXPECT_EQ(w.value(w.points, kPointHeld, point), 3);
      EXPECT_TRUE(inverse.isZero(0));
    } else {
      EXPECT_EQ(w.value(w.points, kPointHeld, point), 0);
      const Eigen::Matrix3d damped = v + kLambda * Eigen::Matrix3d(v.diagonal().asDiagonal());
      EXPECT_LT((inverse * damped * inverse.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-9);
      EXPECT_LT((w.three(w.points, kPointOwnStep, point) - damped.ldlt().solve(b)).norm(), 1e-9 * (1 + b.norm()));
    }

    const Eigen::Matrix<double, 2, 3> j = w.by_point(lane);
    const Eigen::Vector2d residual(w.value(w.linearised, lane_kernels::kResidual, lane),
                                   w.value(w.linearised, lane_kernels::kResidual + 1, lane));
    const Eigen::Vector3d u = w.three(w.linearised, lane_kernels::kFromFrame, lane);
    const Eigen::Matrix<double, 3, 6> g = turned_and_moved(u);
    const Eigen::Matrix<double, 2, 6> by_frame = j * g;
    factors[lane] = by_frame.transpose() * j * inverse.transpose();
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 6; ++r)
        EXPECT_NEAR(w.y[static_cast<std::size_t>(lane * kYSize + c * kYStride + r)], factors[lane](r, c), 1e-9);
    const auto odd = static_cast<std::size_t>(lane % 2);
    normal[odd] += by_frame.transpose() * by_frame - factors[lane] * factors[lane].transpose();
    rhs[odd] -= by_frame.transpose() * residual + factors[lane] * w.three(w.points, kPointZ, point);
    diagonal[odd] += (by_frame.transpose() * by_frame).diagonal();
    const Eigen::Map<const Eigen::Matrix<double, 6, 1>> motion(w.motions[odd].data());
    EXPECT_LT((w.three(w.moved, 0, lane) + j.transpose() * (by_frame * motion)).norm(), 1e-9);
  }
  for (std::size_t f = 0; f < 2; ++f) {
    for (int i = 0, k = 0; i < 3; ++i) {
      for (int c = 0; c <= i; ++c, ++k) {
        EXPECT_NEAR(w.frames[f][static_cast<std::size_t>(kByRotation + k)], normal[f](i, c), 1e-8);
        EXPECT_NEAR(w.frames[f][static_cast<std::size_t>(kByCentre + k)], normal[f](3 + i, 3 + c), 1e-8);
      }
      for (int c = 0; c < 3 && 3 * i + c < 8; ++c)  // [u]x R stands in -J_rotation' J_centre
        EXPECT_NEAR(w.frames[f][static_cast<std::size_t>(kMixed + 3 * i + c)], -normal[f](i, 3 + c), 1e-8);
    }
    EXPECT_NEAR(normal[f](0, 3) + normal[f](1, 4) + normal[f](2, 5), 0, 1e-8);  // why the last is left out
    for (int k = 0; k < 6; ++k) {
      EXPECT_NEAR(w.frames[f][static_cast<std::size_t>(kDiagonal + k)], diagonal[f][k], 1e-8);
      EXPECT_NEAR(w.frames[f][static_cast<std::size_t>(kRightHandSide + k)], rhs[f][k], 1e-8);
    }
  }
  for (std::size_t a = 0; a < kFramesOfPairs.size(); ++a) {
    for (std::size_t b = 0; b < kFramesOfPairs.size(); ++b) {
      const std::int64_t row = 6 * kFramesOfPairs[a], column = 6 * kFramesOfPairs[b];
      if (row <= column) continue;
      const Eigen::Matrix<double, 6, 6> expected = -factors[a] * factors[b].transpose();
      for (std::int64_t i = 0; i < 36; ++i)
        EXPECT_NEAR(Worked::element(w.pairs, row + i % 6, column + i / 6) -
                        Worked::element(Worked::first_pairs(), row + i % 6, column + i / 6),
                    expected(i % 6, i / 6), 1e-9)
            << row << " " << column << " " << i;
    }
  }
  EXPECT_EQ(std::ranges::count(w.used, 1), std::ssize(w.used));
}

// The observations of a point in two images of one frame are joined into one.
TEST_P(PointKernels, MergeWhatAFrameSees) {
  constexpr std::array<std::int64_t, 6> kGroups{0, 0, 0, 1, 2, 2};
  const auto merged = [&](const Kernels& kernels) {
    const std::vector<double> linearised = Worked::random(lane_kernels::kValueCount * kStride, 1);
    alignas(64) std::array<double, kCount * kRecordSize> records{};
    kernels.normal(linearised.data(), kStride, 8, records.data());
    const auto single = records;
    kernels.merge(std::ssize(kGroups), kGroups.data(), records.data());
    return std::pair(single, records);
  };
  const auto [single, records] = merged(*kernels_of_width(GetParam()));
  for (std::size_t group = 0; group < 3; ++group) {
    for (std::size_t v = 0; v < 12; ++v) {
      double expected = 0;
      for (std::size_t k = 0; k < kGroups.size(); ++k)
        if (kGroups[k] == static_cast<std::int64_t>(group))
          expected = single[k * kRecordSize + v] + (v < kU ? expected : 0);  // one's u is all others', too
      EXPECT_NEAR(records[group * kRecordSize + v], expected, 1e-15 * (1 + std::abs(expected))) << group << " " << v;
    }
  }
  EXPECT_EQ(records, merged(kPortable).second);
}

TEST_P(PointKernels, HaveTheBitsOfThePortableOnes) {
  const Worked narrow(kPortable), wide(*kernels_of_width(GetParam()));
  EXPECT_EQ(narrow.records, wide.records);
  EXPECT_EQ(narrow.points, wide.points);
  EXPECT_EQ(narrow.y, wide.y);
  EXPECT_EQ(narrow.frames, wide.frames);
  EXPECT_EQ(narrow.moved, wide.moved);
  for (std::size_t block = 0; block < kPairs; ++block)  // unused rows differ
    for (std::size_t i = 0; i < 36; ++i) {
      const std::size_t place = block * kPairSize + i / 6 * kPairStride + i % 6;
      EXPECT_EQ(narrow.pairs[place], wide.pairs[place]);
    }
}

TEST_P(PointKernels, SolveForThePoints) {
  Worked w(*kernels_of_width(GetParam()));
  const Eigen::Vector3d b = w.three(w.points, kPointB, 2);
  const Eigen::Matrix3d inverse = w.lower(w.points, kPointInverse, 2);
  kernels_of_width(GetParam())->solve(kCount / 2, {w.points.data(), kStride});
  EXPECT_LT((w.three(w.points, kPointOwnStep, 2) - inverse.transpose() * (inverse * b)).norm(), 1e-12 * b.norm());
}

TEST_P(PointKernels, SubtractProductsOfAllSizes) {
  for (std::int64_t rows = 1; rows <= 17; ++rows) {
    for (const std::int64_t columns : {1, 5, 6, 8, 11}) {
      const std::vector<double> a = Worked::random(3 * 20, 5), b = Worked::random(3 * 12, 6);
      std::vector<double> c = Worked::random(20 * 12, 7), narrow = c;
      const std::vector<double> before = c;
      kernels_of_width(GetParam())->subtract_product(c.data(), 20, a.data(), 20, rows, b.data(), 12, columns);
      kPortable.subtract_product(narrow.data(), 20, a.data(), 20, rows, b.data(), 12, columns);
      EXPECT_EQ(c, narrow);
      const Eigen::MatrixXd left = Eigen::Map<const Eigen::MatrixXd>(a.data(), 20, 3),
                            right = Eigen::Map<const Eigen::MatrixXd>(b.data(), 12, 3);
      Eigen::MatrixXd expected = Eigen::Map<const Eigen::MatrixXd>(before.data(), 20, 12);
      expected.topLeftCorner(rows, columns) -= left.topRows(rows) * right.topRows(columns).transpose();
      EXPECT_LT((Eigen::Map<const Eigen::MatrixXd>(c.data(), 20, 12) - expected).norm(), 1e-13) << rows << columns;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Widths, PointKernels, testing::Values(2, 4, 8));

}  // namespace
}  // namespace megablock
