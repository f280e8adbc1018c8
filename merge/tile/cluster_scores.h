// Adds to the normal equations of a cell the squares of the scores of its clusters of tie points. Their covariances
// then show the empirical sigmas, those that residuals show when errors are correlated within a cluster.
//
// With the reduced normal equations H x = s, s = sum s_t over the points, the errors of the unknowns are H^-1 s. The
// formal covariance H^-1 takes the observations as independent with their sigmas, so that E ss' = H. If errors are
// correlated along a track and between neighbouring tracks, but not between clusters of them, then E ss' = sum E
// s_c s_c' with the score s_c of a cluster, and residuals give an estimate of each (Liang and Zeger 1986, Biometrika
// 73(1); White 1980 for single observations; Cameron and Miller 2015 for the practice):
//
//     C_e = H^-1 B H^-1,   B = g sum s_c s_c'.
//
// The tree has only inverses of matrices with the structure of H. But C_e is a derivative of one:
//
//     C(w) = (H + w B)^-1 = H^-1 - w H^-1 B H^-1 + ...,   C_e = (C(0) - C(w)) / w  up to the share w of C_e.
//
// s_c has rows for the unknowns that see points of the cluster. All of them are in the front of the cell that owns the
// points, so B adds no entries to the structure of H, and any block is adjusted by the same tree. One further sweep up
// and down gives the blocks of C(w). Observations that are no tie points, and are few, enter B by their formal part.
//
// A cluster holds the tracks of a cell that have one image as their middle one, of those that keep them: errors are
// correlated along a track, between neighbouring tracks, and, on photographs, across a whole image by lens, shutter and
// the shape of the film or sensor. By the first image the clusters of a small block would be of very different sizes.
//
// Residuals are smaller than errors, because the unknowns follow them. With C = H^-1 and S_c the normal matrix of the
// cluster after elimination of the points, the score of independent errors has E s_c s_c' = S_c - S_c C S_c. With P = C
// S_c, its share of S_c is 1 - tr P^2 / tr P in the mean of the directions that C measures. One number is taken for all
// (as CR2 of Bell and McCaffrey 2002, in the mean):
//
//     g = sum tr P / sum (tr P - tr P^2).
//
// A pose that hangs on a handful of clusters follows their errors, and so do their scores: C_e of such a pose is far
// too small. But the mean over all directions of the unknowns is known well, tr B C = sum s_c'C s_c over its mean for
// independent errors:
//
//     rho = sum s_c'C s_c / sum (tr P - tr P^2),
//
// to which two squares of the ratio one are added, for blocks of a few images. So B is drawn half the way to it (Ledoit
// and Wolf 2004, Journal of Multivariate Analysis 88), with S the normal matrix of the tie points:
//
//     B' = f (g sum s_c s_c' / 2 + rho S / 2).
//
// Where m clusters of equal weight determine an unknown, its part x of the first sum, over its mean, scatters with the
// variance 2 / m, and errors over sigmas have the mean square E 1 / (x / 2 + 1 / 2) = 1 + 1 / (2 m) to first order, as
// those of Student's t exceed normal ones. P has the eigenvalues 1 / m then. So f makes up for the few images that
// determine a pose:
//
//     f = 1 + sum tr P^2 / (2 sum tr P).
//
// g and rho come from a sample of the images of a large block (spread_share). Cameras belong to all images, and a
// camera has a ratio of its own for its few parameters, from their part of C s_c.
#pragma once

#include <Eigen/Cholesky>
#include <algorithm>
#include <functional>
#include <map>
#include <utility>

#include "merge/front/front.h"
#include "merge/tile/point_equations.h"

namespace megablock {

// w: C(0) and C(w) agree to 1e-9 of themselves or better, so that their difference is right to 1e-5; the share that is
// neglected is w times the ratio of B and H.
inline constexpr double kScoreWeight = 1e-4;

// The share of the mean ratio in B'.
inline constexpr double kMeanShare = 0.5;

// f g and f rho, of the sums over the block.
ClusterWeights cluster_weights(const ImageSpread& spread);

// C_e from C(0) and C(w), without the check of empirical_covariance().
template <typename Matrix>
Matrix empirical_difference(const Matrix& formal, const Matrix& with_scores) {
  return (formal - with_scores) / kScoreWeight;
}

// C_e of some unknowns from C(0) and C(w). Where the observations hardly determine a direction, as the focal length of
// images of a plane, C has too few right digits for the difference. This shows, because B' is not less than f rho / 2
// times H in any direction, nor than H where that is less, and so is C_e of C. `ratio`: f rho; ratio C is taken then.
// Rows of held unknowns are zero.
template <typename Matrix>
Matrix empirical_covariance(const Matrix& formal, const Matrix& with_scores, double ratio) {
  constexpr double kOfBound = 0.5, kRounding = 1e-3;
  Matrix empirical = empirical_difference(formal, with_scores);
  Matrix above = empirical - kOfBound * std::min(1.0, kMeanShare * ratio) * formal;
  for (Eigen::Index k = 0; k < above.rows(); ++k) above(k, k) += formal(k, k) > 0 ? kRounding * formal(k, k) : 1;
  if (Eigen::LLT<Matrix>(above).info() != Eigen::Success) empirical = ratio * formal;
  return empirical;
}

// The share of the images of a block that tell of errors in whole images: all of a small block, at least 50 in the mean
// for each camera.
double spread_share(std::int64_t images, std::int64_t cameras);

// Sums of the clusters of one cell for g and rho. They need the formal covariances, and go with the sweep down that
// computes them. A cell keeps a matrix for each of its images, over the unknowns in the tracks of its cluster.
class ImageClusters {
 public:
  // The covariance of two unknowns of the cell, positions in plan.unknowns, and their dimensions.
  using CovarianceOf =
      std::function<Eigen::MatrixXd(std::int64_t a, std::int64_t rows, std::int64_t b, std::int64_t columns)>;
  // All arguments outlive the object. `share`: of the images, chosen by their numbers in the block.
  ImageClusters(const TileProblem& problem, const TilePlan& plan, double share);
  void add_point(const PointEquations& equations, std::size_t i);       // after reduce()
  void finish(const CovarianceOf& covariance_of, ImageSpread& spread);  // of the cell; begins the next one

 private:
  struct Rows {
    Eigen::Index first = 0, count = 0;
  };
  struct Cluster {
    std::map<std::int64_t, Rows> rows;  // of each unknown
    Eigen::MatrixXd normal;
    Eigen::VectorXd score;
    Eigen::Index row_of(std::int64_t unknown, Eigen::Index dimension);
  };
  const TileProblem& problem_;
  const TilePlan& plan_;
  std::vector<bool> in_sample_;               // [images]
  std::map<std::int32_t, Cluster> clusters_;  // by image
};

// The scores of one cell.
class ClusterScores {
 public:
  // All arguments outlive the object.
  ClusterScores(const TileProblem& problem, const TilePlan& plan, const ClusterWeights& weights, Front& front);
  void add_points(const PointEquations& equations);  // after reduce()
  void finish();                                     // adds kScoreWeight B to the front
  // An observation without a point, whose part of B is that of H: its square is that of both.
  static TermResidual with_formal(TermResidual term);

 private:
  Eigen::VectorXd& score_of(std::int64_t point);

  const TileProblem& problem_;
  const TilePlan& plan_;
  const ClusterWeights& weights_;
  Front& front_;
  std::vector<std::int64_t> rows_;                    // [plan.unknowns] first row in the front
  std::map<std::int32_t, Eigen::VectorXd> clusters_;  // by image; over the front
};

}  // namespace megablock
