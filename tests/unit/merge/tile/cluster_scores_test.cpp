// The empirical covariances equal H^-1 B H^-1 of the dense system, with B from clusters that the test forms itself.
#include "merge/tile/cluster_scores.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <map>

#include "geometry/numbers/decompositions.h"
#include "merge/checks/monolithic.h"
#include "tests/support/merge/tiled_block.h"

namespace megablock {
namespace {

// The reduced system of one point: rows of J without the point, residuals of the scores.
struct ReducedPoint {
  Eigen::MatrixXd jacobian;
  Eigen::VectorXd score;
  std::int64_t redundancy = 0;
};

class DenseSystem {
 public:
  DenseSystem(const TileProblem& problem, const TileState& state)
      : system_(monolithic_system(problem, state)), jacobian_(system_.jacobian), points_(problem.points.size()) {
    const Eigen::Index u = system_.reduced_dimension;
    std::vector<std::vector<Eigen::Index>> rows(points_.size());
    std::vector<Eigen::Index> others;
    for (Eigen::Index row = 0; row < jacobian_.rows(); ++row) {
      bool found = false;
      for (std::size_t p = 0; p < points_.size() && !found; ++p) {
        const std::int64_t column = system_.point_column[p];
        found = column >= 0 && (jacobian_.row(row).segment<3>(column).array() != 0).any();
        if (found) rows[p].push_back(row);
      }
      if (!found) others.push_back(row);
    }
    normal_ = formal_ = jacobian_(others, Eigen::seqN(0, u)).transpose() * jacobian_(others, Eigen::seqN(0, u));
    for (std::size_t p = 0; p < points_.size(); ++p) {
      if (rows[p].empty()) continue;
      const Eigen::MatrixXd by_point = jacobian_(rows[p], Eigen::seqN(system_.point_column[p], 3));
      const Eigen::MatrixXd all = jacobian_(rows[p], Eigen::seqN(0, u));
      const Eigen::MatrixXd projected =
          all - by_point * solve_symmetric(by_point.transpose() * by_point, by_point.transpose() * all);
      points_[p] = {projected, projected.transpose() * system_.residual(rows[p]), std::ssize(rows[p]) - 3};
      normal_ += projected.transpose() * projected;
    }
    covariance_ = inverse(normal_);
  }
  const MonolithicSystem& system() const { return system_; }
  const std::vector<ReducedPoint>& points() const { return points_; }
  const Eigen::MatrixXd& covariance() const { return covariance_; }
  const Eigen::MatrixXd& formal() const { return formal_; }  // of observations without a point

 private:
  MonolithicSystem system_;
  Eigen::MatrixXd jacobian_;
  std::vector<ReducedPoint> points_;
  Eigen::MatrixXd normal_, formal_, covariance_;
};

TEST(ClusterScores, GiveTheSandwichOfTheDenseSystem) {
  SimulationOptions options;
  options.frames = 10;
  options.points_per_frame = 80;
  options.control_points = 3;
  const TiledBlock block(simulate_block(options), 20, {}, 0);
  ASSERT_EQ(block.tiles.tile_count, 1);
  MergeInMemory runner(block.tiles.tree, block.problems, block.states);
  GlobalState state = start_global({});
  adjust_globally(runner, {}, state);
  runner.final_up();
  runner.final_scores();
  const TileProblem& problem = runner.problems().front();
  ASSERT_EQ(runner.tile_plans().front().points.size(), 1u) << "one cell";
  const DenseSystem dense(problem, runner.states().front());

  Eigen::MatrixXd meat = dense.formal(), normal_of_ties = Eigen::MatrixXd::Zero(meat.rows(), meat.cols());
  struct Image {
    Eigen::VectorXd score;
    Eigen::MatrixXd normal;
  };
  std::map<int, Image> images;
  for (std::size_t p = 0; p < problem.points.size(); ++p) {
    const ReducedPoint& point = dense.points()[p];
    if (point.redundancy <= 0) continue;
    const Eigen::MatrixXd normal = point.jacobian.transpose() * point.jacobian;
    if (problem.points[p].role != PointRole::kTie) {
      meat += normal;
      continue;
    }
    const std::int64_t middle = (problem.begin[p] + problem.begin[p + 1]) / 2;  // all are kept
    Image& image = images[problem.image[static_cast<std::size_t>(middle)].value];
    if (image.score.size() == 0) image = {Eigen::VectorXd::Zero(point.score.size()), 0 * normal};
    image.score += point.score;
    image.normal += normal;
    normal_of_ties += normal;
  }
  const ImageSpread& spread = runner.covariances().front().spread;
  ImageSpread::Sum of_images, of_camera;
  double trace = 0;
  Eigen::MatrixXd of_ties = 0 * meat;
  const Eigen::MatrixXd& c = dense.covariance();
  ASSERT_EQ(spread.cameras.size(), 1u);
  const auto camera =
      Eigen::seqN(dense.system().camera_column.at(0), runner.tile_plans().front().unknowns.back().dimension);
  for (const auto& [number, image] : images) {
    const Eigen::MatrixXd p = c * image.normal;
    of_images.add({image.score.dot(c * image.score), p.trace() - (p * p).trace()});
    trace += p.trace();
    of_ties += image.score * image.score.transpose();
    const Eigen::MatrixXd own = inverse(c(camera, camera));
    const Eigen::VectorXd change = (c * image.score)(camera);
    of_camera.add({change.dot(own * change), (own * ((p - p * p) * c)(camera, camera)).trace()});
  }
  EXPECT_EQ(images.size(), 9u);  // no track has the first image in its middle
  EXPECT_NEAR(spread.images.squares, of_images.squares, 1e-6 * of_images.squares);
  EXPECT_NEAR(spread.images.expected, of_images.expected, 1e-6 * of_images.expected);
  EXPECT_NEAR(spread.trace, trace, 1e-6 * trace);
  EXPECT_NEAR(spread.cameras.begin()->second.squares, of_camera.squares, 1e-6 * of_camera.squares);
  EXPECT_NEAR(spread.cameras.begin()->second.expected, of_camera.expected, 1e-6 * of_camera.expected);
  const double ratio = (of_images.squares + 2) / (of_images.expected + 2);
  const double for_few_images = 1 + (trace - of_images.expected) / (2 * trace);
  meat += 0.5 * for_few_images * (trace / of_images.expected * of_ties + ratio * normal_of_ties);
  const Eigen::MatrixXd expected = dense.covariance() * meat * dense.covariance();
  const TileCovariance& ours = runner.empirical_covariances().front();
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const Eigen::Index column = dense.system().frame_column[f];
    const Eigen::MatrixXd own = expected.block<6, 6>(column, column);
    const Eigen::VectorXd unit = own.diagonal().cwiseSqrt().cwiseInverse();
    EXPECT_LE((unit.asDiagonal() * (ours.frames[f] - own) * unit.asDiagonal()).cwiseAbs().maxCoeff(), 1e-3) << f;
  }
}

// C and C(w) of an unknown that is hardly determined differ by their errors. Its sigma is that of the mean then.
TEST(ClusterScores, LostDigitsDoNotMakeNegativeSigmas) {
  constexpr double kRatio = 3;
  const Eigen::Matrix3d formal = Eigen::Vector3d(1, 4, 0).asDiagonal();  // the third is held
  const Eigen::Matrix3d twice = formal - 2 * kScoreWeight * formal;
  EXPECT_TRUE(empirical_covariance(formal, twice, kRatio).isApprox(2 * formal, 1e-9));
  for (const double error : {1e-3, -1e-3}) {
    Eigen::Matrix3d lost = twice;
    lost(0, 1) = lost(1, 0) = error;  // a correlation of more than one
    EXPECT_TRUE(empirical_covariance(formal, lost, kRatio).isApprox(kRatio * formal, 1e-12));
  }
  Eigen::Matrix3d larger = twice;
  larger(1, 1) = formal(1, 1) * (1 + 1e-3);
  EXPECT_TRUE(empirical_covariance(formal, larger, kRatio).isApprox(kRatio * formal, 1e-12));
}

}  // namespace
}  // namespace megablock
