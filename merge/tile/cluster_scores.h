// Adds to the normal equations of a cell the squares of the scores of its clusters of tie points. Their covariances
// then show the empirical sigmas, those that residuals show when errors are correlated within a cluster.
//
// With the reduced normal equations H x = s, s = sum s_t over the points, the errors of the unknowns are H^-1 s. The
// formal covariance H^-1 takes the observations as independent with their sigmas, so that E ss' = H. If errors are
// correlated along a track and between neighbouring tracks, but not between clusters of them, then E ss' = sum E
// s_c s_c' with the score s_c of a cluster, and residuals give an estimate of each (Liang and Zeger 1986, Biometrika
// 73(1); White 1980 for single observations; Cameron and Miller 2015 for the practice):
//
//     C_e = H^-1 B H^-1,   B = sum g_c s_c s_c'.
//
// The tree has only inverses of matrices with the structure of H. But C_e is a derivative of one:
//
//     C(w) = (H + w B)^-1 = H^-1 - w H^-1 B H^-1 + ...,   C_e = (C(0) - C(w)) / w  up to the share w of C_e.
//
// s_c has rows for the unknowns that see points of the cluster. All of them are in the front of the cell that owns the
// points, so B adds no entries to the structure of H, and any block is adjusted by the same tree. One further sweep up
// and down gives the blocks of C(w). Observations that are no tie points, and are few, enter B by their formal part.
//
// Residuals are smaller than errors, because the unknowns follow them. With C = H^-1 and J_c the Jacobian of the
// cluster after elimination of the points, S_c = J_c'J_c, P = J_c C J_c', a score of independent errors has E s_c s_c'
// = S_c - S_c C S_c. Measured by C, its share of S_c is 1 - tr P^2 / tr P. g_c is the inverse of this share (as CR2 of
// Bell and McCaffrey 2002, in the mean of the directions). P of a single point has the rank r = 2 observations - 3, and
// tr P^2 = k (tr P)^2 / r with a concentration k, which a sample of the points gives. Neighbouring points have nearly
// the same Jacobian, so a cluster has the rank of one of its points, and h = tr P is the sum over them.
//
// A cluster holds the tracks of a cell that begin in one field of one image; an image has 12 fields along its longer
// side of the part of the image that has observations. A track begins in the first of its images that keeps it.
//
// On photographs errors are correlated beyond a field, too: the lens, the shutter and the shape of the film or sensor
// are those of a whole image. Clusters of whole images would show it, but there are few of them, the unknowns follow
// half of their errors, and C_e of each unknown by itself would be a poor estimate. One number of the block is a good
// one: the mean over all directions of the unknowns, tr B C = sum s_c'C s_c, over its mean for independent errors,
// sum tr P - tr P^2. The quotient of this ratio for images and that for fields, if above 1, multiplies B. It is 1
// within a tenth for independent errors in 12 images, so that a sample of the images is enough (spread_share). Cameras
// belong to all images, and a camera has a quotient of its own for its few parameters, from their part of C s_c.
//
// A pose that hangs on a handful of clusters follows their errors, and so do their scores: C_e of such a pose is far
// too small. The mean ratio of the block, rho, is known well. So B is drawn half the way to it (Ledoit and Wolf 2004,
// Journal of Multivariate Analysis 88), with S the normal matrix of the tie points:
//
//     B' = B / 2 + rho S / 2.
#pragma once

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

// C_e from C(0) and C(w).
template <typename Matrix>
Matrix empirical_covariance(const Matrix& formal, const Matrix& with_scores) {
  return (formal - with_scores) / kScoreWeight;
}

// The share of the images of a block that tell of errors in whole images: all of a small block, at least 50 in the mean
// for each camera.
double spread_share(std::int64_t images, std::int64_t cameras);

// From the formal covariances of the tile, whose redundancy numbers give h.
ClusterWeights cluster_weights(const TileProblem& problem, const TileCovariance& covariance);

// [cameras] The extent of the part of the images that has observations, px.
std::vector<double> observed_extents(const TileProblem& problem);

// The clusters of whole images of one cell. They need the formal covariances, and go with the sweep down that computes
// them. A cell keeps a matrix for each of its images, over the unknowns in the tracks that begin there.
class ImageClusters {
 public:
  // The covariance of two unknowns of the cell, positions in plan.unknowns, and their dimensions.
  using CovarianceOf =
      std::function<Eigen::MatrixXd(std::int64_t a, std::int64_t rows, std::int64_t b, std::int64_t columns)>;
  // All arguments outlive the object. `share`: of the images, chosen by their numbers in the block.
  ImageClusters(const TileProblem& problem, const TilePlan& plan, const std::vector<double>& extents, double share);
  // After reduce(). `leverage`: tr P of the point, without its own three parameters.
  void add_point(const PointEquations& equations, std::size_t i, double leverage);
  void finish(const CovarianceOf& covariance_of, CellSpread& spread);  // of the cell; begins the next one

 private:
  struct Field {
    Eigen::VectorXd score;
    double leverage = 0, rank = 0;
    std::int64_t points = 0;
  };
  struct Rows {
    Eigen::Index first = 0, count = 0;
  };
  struct Cluster {
    std::map<std::int64_t, Rows> rows;  // of each unknown
    Eigen::MatrixXd normal;
    Eigen::VectorXd score;
    std::map<std::int32_t, Field> fields;
    Eigen::Index row_of(std::int64_t unknown, Eigen::Index dimension);
  };
  const TileProblem& problem_;
  const TilePlan& plan_;
  const std::vector<double>& extents_;
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
  struct Cluster {
    std::int64_t column = -1;  // of scores_
    double leverage = 0;
    std::int64_t rank = 0;  // sum of the points
    std::int64_t points = 0;
  };
  Cluster& cluster_of(std::int64_t point);

  const TileProblem& problem_;
  const TilePlan& plan_;
  const ClusterWeights& weights_;
  Front& front_;
  std::vector<std::int64_t> rows_;                                     // [plan.unknowns] first row in the front
  std::map<std::pair<std::int32_t, std::int32_t>, Cluster> clusters_;  // by image and field
  std::vector<Eigen::VectorXd> scores_;                                // [clusters] over the front
};

}  // namespace megablock
