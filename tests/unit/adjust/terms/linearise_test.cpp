// Every analytic Jacobian against Ceres' automatic differentiation, in tangent space.
#include "adjust/terms/linearise.h"

#include <ceres/autodiff_cost_function.h>
#include <ceres/crs_matrix.h>
#include <ceres/loss_function.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "adjust/terms/line_terms.h"
#include "adjust/terms/vertical_terms.h"
#include "adjust/tile/ceres_problem.h"
#include "geometry/camera/camera.h"
#include "geometry/camera/models/brown.h"

namespace megablock {
namespace {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>;

struct Evaluated {
  Eigen::VectorXd residual;
  Matrix jacobian;  // columns: the blocks in the order given, tangent space
};

// A fresh Ceres problem of one residual; blocks of seven are poses.
template <int kResiduals, int... kBlocks, typename Functor>
Evaluated by_ceres(const Functor& functor, std::vector<std::vector<double>> blocks) {
  PoseManifold manifold;
  ceres::Problem::Options options;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(options);
  std::vector<double*> pointers;
  for (auto& block : blocks) pointers.push_back(block.data());
  problem.AddResidualBlock(new ceres::AutoDiffCostFunction<Functor, kResiduals, kBlocks...>(new Functor(functor)),
                           nullptr, pointers);
  for (auto& block : blocks)
    if (block.size() == kPoseBlock) problem.SetManifold(block.data(), &manifold);
  ceres::Problem::EvaluateOptions evaluate;
  evaluate.parameter_blocks = pointers;
  std::vector<double> residuals;
  ceres::CRSMatrix crs;
  EXPECT_TRUE(problem.Evaluate(evaluate, nullptr, &residuals, nullptr, &crs));
  Evaluated result{Eigen::Map<Eigen::VectorXd>(residuals.data(), static_cast<Eigen::Index>(residuals.size())),
                   Matrix::Zero(crs.num_rows, crs.num_cols)};
  for (int row = 0; row < crs.num_rows; ++row)
    for (int i = crs.rows[row]; i < crs.rows[row + 1]; ++i) result.jacobian(row, crs.cols[i]) = crs.values[i];
  return result;
}

std::vector<double> block(const Pose& pose) {
  std::vector<double> values(kPoseBlock);
  to_block(pose, values.data());
  return values;
}
std::vector<double> block(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
std::vector<double> block(const Intrinsics& k) { return {k.begin(), k.end()}; }

// Relative to the largest entry of a row.
void expect_same(const Matrix& ours, const Matrix& reference) {
  ASSERT_EQ(ours.rows(), reference.rows());
  ASSERT_EQ(ours.cols(), reference.cols());
  for (Eigen::Index row = 0; row < ours.rows(); ++row) {
    const double scale = reference.row(row).cwiseAbs().maxCoeff();
    EXPECT_LE((ours.row(row) - reference.row(row)).cwiseAbs().maxCoeff<Eigen::PropagateNaN>(), 1e-9 * scale + 1e-300)
        << "row " << row;
  }
}
void expect_residual(const Eigen::VectorXd& ours, const Eigen::VectorXd& reference) {
  EXPECT_LE((ours - reference).norm(), 1e-9 * (1 + reference.norm()));
}

constexpr int kBrown = BrownModel::parameter_count(0);

class Linearise : public testing::TestWithParam<int> {
 protected:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Eigen::Vector3d vector(double size) { return {uniform(-size, size), uniform(-size, size), uniform(-size, size)}; }
  Eigen::Quaterniond rotation(double angle = 3) {
    return rotation_exp<double>(vector(1).normalized() * uniform(0, angle)).normalized();
  }
  Pose far_pose() { return {rotation(), Eigen::Vector3d(4e5, -3e5, 500) + vector(100)}; }
  Pose near_pose(double angle = 3) { return {rotation(angle), vector(2)}; }
  Eigen::Vector3d sigma(double low, double high) {
    return {uniform(low, high), uniform(low, high), uniform(low, high)};
  }
  Intrinsics intrinsics() {
    return {uniform(800, 4000),   uniform(500, 2000),   uniform(500, 2000),   uniform(-0.2, 0.2), uniform(-0.1, 0.1),
            uniform(-0.05, 0.05), uniform(-0.01, 0.01), uniform(-0.01, 0.01), uniform(-20, 20),   uniform(-20, 20)};
  }

  std::mt19937_64 random_{static_cast<std::uint64_t>(GetParam())};
};

TEST_P(Linearise, Image) {
  const Pose frame = far_pose(), mount = near_pose();
  const Intrinsics k = intrinsics();
  const Eigen::Vector3d in_camera(uniform(-30, 30), uniform(-30, 30), uniform(40, 200));
  const Eigen::Vector3d in_rig = mount.rotation.conjugate() * in_camera + mount.centre;
  const Eigen::Vector3d point = frame.rotation.conjugate() * in_rig + frame.centre;
  const Eigen::Vector2d measured = project(k, in_camera) + Eigen::Vector2d(uniform(-3, 3), uniform(-3, 3));
  const double weight = uniform(0.5, 4);

  const ImageResidual ours = linearise_image(frame, mount, k, point, measured, weight);
  const Evaluated reference = by_ceres<2, 7, 7, kBrown, 3>(residual::ImageMeasured{k.model(), measured, weight},
                                                           {block(frame), block(mount), block(k), block(point)});
  ASSERT_TRUE(ours.in_front);
  expect_residual(ours.residual, reference.residual);
  Matrix jacobian(2, 15 + kBrown);
  jacobian << ours.by_frame, ours.by_mount, ours.by_intrinsics, ours.by_point;
  expect_same(jacobian.leftCols(12), reference.jacobian.leftCols(12));
  expect_same(jacobian.middleCols(12, kBrown), reference.jacobian.middleCols(12, kBrown));
  expect_same(jacobian.rightCols(3), reference.jacobian.rightCols(3));
}

TEST_P(Linearise, PositionWithLeverArm) {
  const Pose frame = far_pose();
  const PositionPrior prior{frame.centre + vector(3), sigma(0.02, 5), vector(2)};
  const FrameResidual3 ours = linearise_position(frame, prior);
  const Evaluated reference = by_ceres<3, 7>(residual::PositionMeasured{prior}, {block(frame)});
  expect_residual(ours.residual, reference.residual);
  expect_same(ours.by_frame, reference.jacobian);
}

TEST_P(Linearise, Attitude) {
  const Pose frame = far_pose();
  const double angle = GetParam() % 2 ? 1e-9 : 1.5;
  const AttitudePrior prior{(rotation(angle) * frame.rotation).normalized(), sigma(0.001, 0.1)};
  const FrameResidual3 ours = linearise_attitude(frame, prior);
  const Evaluated reference = by_ceres<3, 7>(residual::AttitudeMeasured{prior}, {block(frame)});
  expect_residual(ours.residual, reference.residual);
  expect_same(ours.by_frame, reference.jacobian);
}

// Rays to the ends of a line anywhere, seen by two frames.
TEST_P(Linearise, Line) {
  const Pose frame = far_pose(), other = far_pose();
  TileProblem::LineTerm term;
  const Eigen::Vector3d first = vector(1).normalized(), second = vector(1).normalized();
  term.middle = (first + second).normalized();
  term.across = (first - second).cross(term.middle) / 2;
  term.other_normal = vector(1).normalized();
  term.up = (Eigen::Vector3d::UnitZ() + vector(0.01)).normalized();
  term.weight = uniform(100, 4000);
  const LineResidual vertical = linearise_line(frame, frame, term);
  const Evaluated one = by_ceres<1, 7>(residual::VerticalLine{term}, {block(frame)});
  expect_residual(Eigen::VectorXd::Constant(1, vertical.residual), one.residual);
  expect_same(vertical.by_frame, one.jacobian);
  EXPECT_TRUE(vertical.by_other.isZero(0));

  term.other = LocalFrame(1);
  const LineResidual horizontal = linearise_line(frame, other, term);
  const Evaluated two = by_ceres<1, 7, 7>(residual::HorizontalLine{term}, {block(frame), block(other)});
  expect_residual(Eigen::VectorXd::Constant(1, horizontal.residual), two.residual);
  Matrix jacobian(1, 12);
  jacobian << horizontal.by_frame, horizontal.by_other;
  expect_same(jacobian, two.jacobian);
}

// Everything from a good attitude to one nearly upside down; a camera that matters and one that does not.
TEST_P(Linearise, Vertical) {
  const Pose frame = far_pose(), mount = near_pose();
  const Intrinsics k = intrinsics();
  SeenVertical seen;
  const Eigen::Vector3d down = mount.rotation * (frame.rotation * -Eigen::Vector3d::UnitZ());
  seen.down = rotation(GetParam() % 2 ? 0.01 : 3.1) * down;
  const Eigen::Matrix<double, 3, 2> plane = tangent_plane(seen.down);
  const Eigen::Matrix2d root{{uniform(1e-4, 1e-2), 0}, {uniform(-1e-3, 1e-3), uniform(1e-4, 1e-2)}};
  seen.covariance = plane * root * root.transpose() * plane.transpose();
  seen.camera = Eigen::VectorXd(kBrown);
  for (int p = 0; p < kBrown; ++p) seen.camera[p] = k[static_cast<std::size_t>(p)] * uniform(0.9, 1.1);
  seen.by_camera.resize(3, kBrown);
  for (int p = 0; p < kBrown; ++p) seen.by_camera.col(p) = plane * plane.transpose() * vector(0.1);

  const auto term = vertical_term(seen, GroundVertical(GroundFrame()), frame.centre);
  const VerticalResidual ours = linearise_vertical(frame, mount, k, term);
  const Evaluated reference =
      by_ceres<2, 7, 7, kBrown>(residual::VerticalSeen{term}, {block(frame), block(mount), block(k)});
  expect_residual(ours.residual, reference.residual);
  Matrix jacobian(2, 12 + kBrown);
  jacobian << ours.by_frame, ours.by_mount, -term.by_camera;
  expect_same(jacobian, reference.jacobian);

  // Of the length of the chord, in sigmas.
  seen.camera.resize(0);
  seen.by_camera.resize(3, 0);
  seen.covariance = 1e-4 * plane * plane.transpose();
  const auto plain = vertical_term(seen, GroundVertical(GroundFrame()), frame.centre);
  const VerticalResidual alone = linearise_vertical(frame, mount, k, plain);
  EXPECT_NEAR(alone.residual.norm(), 100 * (seen.down - down).norm(), 1e-6);
  EXPECT_NEAR((alone.by_frame * PoseIncrement::Unit(2)).norm(), 0, 1e-9) << "a turn about the vertical";
  const Evaluated without = by_ceres<2, 7, 7>(residual::VerticalSeen{plain}, {block(frame), block(mount)});
  expect_residual(alone.residual, without.residual);
}

TEST_P(Linearise, RelativePose) {
  const Pose from = far_pose();
  const Pose to{(rotation(0.5) * from.rotation).normalized(), from.centre + vector(10)};
  const double angle = GetParam() % 2 ? 1e-9 : 1.5;
  TileProblem::RelativeTerm term;
  term.pose.rotation = (rotation(angle) * to.rotation * from.rotation.conjugate()).normalized();
  term.pose.centre = from.rotation * (to.centre - from.centre) + vector(0.1);
  term.rotation_sigma_rad = uniform(1e-4, 1e-2);
  term.position_sigma_m = uniform(1e-3, 1e-1);
  const RelativeResidual ours = linearise_relative(from, to, term);
  const Evaluated reference = by_ceres<6, 7, 7>(residual::RelativeMeasured{term}, {block(from), block(to)});
  expect_residual(ours.residual, reference.residual);
  Matrix jacobian(6, 12);
  jacobian << ours.by_from, ours.by_to;
  expect_same(jacobian, reference.jacobian);
}

TEST_P(Linearise, Mount) {
  const Pose mount = near_pose();
  TileProblem::MountTerm term;
  term.value = {(rotation(0.1) * mount.rotation).normalized(), mount.centre + vector(0.01)};
  term.rotation_sigma_rad = uniform(1e-4, 1e-2);
  term.position_sigma_m = uniform(1e-3, 1e-1);
  const MountResidual ours = linearise_mount(mount, term);
  const Evaluated reference = by_ceres<6, 7>(residual::MountKnown{term}, {block(mount)});
  expect_residual(ours.residual, reference.residual);
  expect_same(ours.by_mount, reference.jacobian);
}

TEST_P(Linearise, LinearPriors) {
  TileProblem::PointTerm point_term{LocalPoint(0), vector(1e5), sigma(0.01, 1)};
  point_term.sigma.z() = std::numeric_limits<double>::infinity();
  const Eigen::Vector3d point = point_term.position + vector(1);
  const Evaluated known_point = by_ceres<3, 3>(residual::PointKnown{point_term}, {block(point)});
  expect_residual(point_prior_residual(point, point_term), known_point.residual);
  EXPECT_EQ(known_point.residual.z(), 0);

  TileProblem::IntrinsicTerm term{LocalCamera(0), intrinsics(), {}};
  const Intrinsics k = intrinsics();
  term.sigma = {10, 0, std::numeric_limits<double>::infinity(), 0.1, 0.01, 0, 0.001, 0.001, 5, 0};
  const Evaluated known = by_ceres<kBrown, kBrown>(residual::IntrinsicsKnown{term}, {block(k)});
  for (int i = 0; i < k.size(); ++i) {
    EXPECT_DOUBLE_EQ(intrinsic_prior_residual(k, term, i), known.residual[i]);
    EXPECT_DOUBLE_EQ(intrinsic_prior_weight(term, i), known.jacobian(i, i));
  }
  EXPECT_EQ(known.residual[1], 0);
  EXPECT_EQ(known.residual[2], 0);
}

TEST_P(Linearise, PoseManifoldUpdatesAsPoseUpdate) {
  const Pose pose = far_pose();
  PoseIncrement d;
  d << vector(0.3), vector(5);
  const Pose expected = pose_update(pose, d);
  const PoseManifold manifold;
  double from[kPoseBlock], to[kPoseBlock];
  PoseIncrement back;
  to_block(pose, from);
  ASSERT_TRUE(manifold.Plus(from, d.data(), to));
  EXPECT_LT(rotation_angle(from_block(to).rotation, expected.rotation), 1e-14);
  EXPECT_EQ(from_block(to).centre, expected.centre);
  ASSERT_TRUE(manifold.Minus(to, from, back.data()));
  EXPECT_LT((back - d).norm(), 1e-9);  // the centre of the difference is rounded at 4e5 m

  Eigen::Matrix<double, 7, 6, Eigen::RowMajor> plus;
  Eigen::Matrix<double, 6, 7, Eigen::RowMajor> minus;
  ASSERT_TRUE(manifold.PlusJacobian(from, plus.data()));
  ASSERT_TRUE(manifold.MinusJacobian(from, minus.data()));
  EXPECT_LT((minus * plus - Eigen::Matrix<double, 6, 6>::Identity()).norm(), 1e-14);
  constexpr double kStep = 1e-6;  // central differences of Plus on the quaternion
  for (int i = 0; i < 3; ++i) {
    PoseIncrement step = PoseIncrement::Zero();
    step[i] = kStep;
    double up[kPoseBlock], down[kPoseBlock];
    manifold.Plus(from, step.data(), up);
    step[i] = -kStep;
    manifold.Plus(from, step.data(), down);
    for (int row = 0; row < 4; ++row) EXPECT_NEAR((up[row] - down[row]) / (2 * kStep), plus(row, i), 1e-9);
  }
}

INSTANTIATE_TEST_SUITE_P(Random, Linearise, testing::Range(0, 40));

TEST(LineariseImage, RefusesPointsBehindTheCamera) {
  const Intrinsics k{1000, 500, 500, 0, 0, 0, 0, 0};
  EXPECT_FALSE(linearise_image({}, {}, k, {0, 0, -1}, {0, 0}, 1).in_front);
  EXPECT_FALSE(linearise_image({}, {}, k, {1, 0, 0}, {0, 0}, 1).in_front);
  EXPECT_TRUE(linearise_image({}, {}, k, {0, 0, 1}, {0, 0}, 1).in_front);
}

TEST(RobustLoss, MatchesCeres) {
  for (double scale : {0.5, 2.0, 7.0}) {
    const ceres::HuberLoss huber(scale);
    const ceres::CauchyLoss cauchy(scale);
    for (double s : {0.0, 1e-6, 0.1, 0.25, 1.0, 4.0, 4.1, 49.0, 1e3, 1e9}) {
      double expected[3];
      huber.Evaluate(s, expected);
      auto ours = RobustLoss{RobustLoss::Kind::kHuber, scale}.evaluate(s);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(ours[i], expected[i], 1e-14 * std::abs(expected[i])) << s;
      cauchy.Evaluate(s, expected);
      ours = RobustLoss{RobustLoss::Kind::kCauchy, scale}.evaluate(s);
      for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(ours[i], expected[i], 1e-9 * std::abs(expected[i]) + 1e-15 * scale * scale);
      EXPECT_EQ(RobustLoss{}.evaluate(s), (std::array<double, 3>{s, 1, 0}));
    }
  }
}

// Squares to the corner, Huber's line to twice of it, Cauchy's logarithm beyond.
TEST(RobustLoss, CauchysTailTakesGoodOnesForWhatTheyAreAndForgetsGrossOnes) {
  const RobustLoss loss{RobustLoss::Kind::kCauchyTail, 3}, huber{RobustLoss::Kind::kHuber, 3};
  for (const double s : {0.0, 0.1, 4.0, 9.0}) EXPECT_EQ(loss.evaluate(s), (std::array<double, 3>{s, 1, 0}));
  for (const double s : {9.0 + 1e-9, 12.0, 36.0}) EXPECT_EQ(loss.evaluate(s), huber.evaluate(s));
  for (const double s : {10.0, 30.0, 36.0 + 1e-9, 40.0, 100.0, 1e6}) {
    const double h = 1e-4 * s;
    const auto [value, first, second] = loss.evaluate(s);
    const double slope = (loss.evaluate(s + h)[0] - loss.evaluate(s - h)[0]) / (2 * h);
    EXPECT_NEAR(slope, first, 1e-4 * first) << s;
    if (std::abs(s - 36) < 1) continue;  // the second derivative has a step there
    EXPECT_NEAR(slope, first, 1e-7 * first) << s;
    EXPECT_NEAR((loss.evaluate(s + h)[1] - loss.evaluate(s - h)[1]) / (2 * h), second, -1e-7 * second) << s;
  }
  // The pull rho' r falls with the distance r: 3 sigmas' at the end of the line, none from very far.
  const auto pull = [&](double r) { return loss.evaluate(r * r)[1] * r; };
  EXPECT_NEAR(pull(6), 3, 1e-14);
  EXPECT_NEAR(pull(60), 0.3, 1e-14);
  EXPECT_GT(loss.evaluate(std::numeric_limits<double>::max())[1], 0);
}

}  // namespace
}  // namespace megablock
