// Condenses a tile: eliminates its points and its inner unknowns, so that the normal equations of its separator
// unknowns remain. On the way down it gives the step and the covariances of everything in the tile.
//
// Inside the tile the bisection goes on to cells of about 16 frames (32 in a tile that is a block of its own). A point
// belongs to one cell (adjust/problem/owner.h) and is eliminated there. A point occurs in its own observations alone,
// so the part of the normal matrix that belongs to the points has 3 x 3 blocks V on its diagonal and nothing else. Each
// point is therefore eliminated on its own, before everything else (Triggs et al. 2000, "Bundle adjustment", 6.1). With
// V = sum J_p'J_p + lambda D_p = C C', W_i = J_i'J_p of an unknown i that observes the point, and Y_i = W_i C^-T,
//
//     K_ij -= Y_i Y_j',   b_i -= Y_i C^-1 b_p,   x_p = C^-T (C^-1 b_p - sum Y_i' x_i).
//
// The fronts of the cells are then eliminated depth-first, as the nodes of the merge tree are. The block of the
// separator unknowns is never factorised, because it is singular in a tile without a datum. Robust weights are those of
// Ceres (sqrt(rho') without the second-order term), unless the sweep asks for the curvature of the losses
// (tile_linearisation.h). D is the diagonal of J'J.
#pragma once

#include <map>
#include <memory>

#include "adjust/problem/tile_problem.h"
#include "io/block/observation_statistics.h"
#include "merge/front/front.h"
#include "merge/plan/tile_plan.h"

namespace megablock {

// The factors of the cells of a tile, by node of TilePlan::cells. When it is empty, they are computed again.
struct TileFactor {
  std::vector<FrontFactor> nodes;
  // For damping_norm of TileStep. D of a separator unknown is the sum of these of all tiles that touch it, and so is
  // its part of the norm.
  std::vector<double> diagonal;  // diagonal of J'J over the scalar unknowns of the plan, from the tile's own residuals
  bool empty() const { return nodes.empty(); }
  std::int64_t byte_count() const;
  void write(ByteWriter& out) const;
  static TileFactor read(ByteReader& in);
};

struct TileCondensation {
  UpdateMatrix update;
  TileFactor factor;
};

// How far errors are correlated within whole images (cluster_scores.h). Sums are added in the order of cells and tiles.
struct ImageSpread {
  struct Sum {
    double squares = 0, expected = 0;  // sum s'C s, and its mean for independent errors
    void add(const Sum& other);
    double ratio() const { return expected > 0 && squares > 0 ? squares / expected : 1; }
  };
  Sum images;
  double trace = 0;                     // sum tr P of the images
  std::map<std::int64_t, Sum> cameras;  // of the parameters of each camera of the block
  void add(const ImageSpread& other);
  double ratio() const;     // rho of cluster_scores.h
  double unshrunk() const;  // g of cluster_scores.h
  // The factor of a camera's empirical covariance that has `reached` times the formal one in the mean.
  double camera_inflation(std::int64_t camera, double reached) const;
  Bytes to_bytes() const;
  static ImageSpread from_bytes(const Bytes& bytes);
};
// What the clusters of a tile's points need besides its problem (cluster_scores.h): g and rho there.
struct ClusterWeights {
  double unshrunk = 1, ratio = 1;
};

// What a sweep adds to a tile besides its observations: the constraints and right-hand sides of the datum of a free
// block (gauge.h), and the scores of its clusters (cluster_scores.h). Empty when priors fix the datum.
struct TileDatum {
  struct Hold {
    UnknownId frame;
    Eigen::Matrix<double, 6, Eigen::Dynamic> directions;  // along which the frame is held
    double weight = 1;
  };
  std::vector<Hold> holds;
  Step columns{{}, 0, {}};                   // further right-hand sides
  double spread = 0;                         // share of the images from which TileCovariance::spread comes; 0: none
  const ClusterWeights* clusters = nullptr;  // of a sweep for the empirical covariances; else nullptr
};

// The directions that a block holds although priors determine them, but hardly.
struct HeldAgainstPriors {
  std::int32_t rotations = 0;  // of the component with most
  bool scale = false;
  bool any() const { return rotations > 0 || scale; }
};

// The linearisation and the damping of a sweep. A plain number stands for a sweep with this lambda and without
// curvature.
struct Sweep {
  double lambda = 0;
  bool curvature = false;         // with the second-order term of the robust losses
  HeldAgainstPriors held_before;  // by earlier sweeps (gauge.h)
  Sweep(double damping, bool with_curvature = false, const HeldAgainstPriors& held = {})
      : lambda(damping), curvature(with_curvature), held_before(held) {}
};

// Linearises at `state`, and eliminates the points and inner unknowns of the tile. Throws ComputeError when a kept
// observation is behind its camera.
TileCondensation condense_tile(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const Sweep& sweep, const TileDatum& datum = {});

// The same in portions, for threads that may work on other tiles as well (geometry/threads/rounds.h).
class TileCondenser {
 public:
  // Problem, plan and state outlive the object.
  TileCondenser(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep,
                TileDatum datum = {});
  ~TileCondenser();
  std::int64_t cells() const;
  // Condenses a cell and the fronts above it that this completes. Call it once for every cell, on any thread. An error
  // is kept until take() throws it.
  void condense(std::int64_t cell);
  TileCondensation take();  // after the last cell

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

// The step of everything in the tile. With all x of the block, the predicted decrease of the cost (global_adjustment.h)
// needs sum D_k x_k^2, D the diagonal of J'J. A tile gives its part of D, so that the sum over all tiles counts every
// residual once, also where an unknown belongs to several tiles.
struct TileStep {
  Step unknowns;                        // step of plan.unknowns, with as many columns as that of the separator
  std::vector<Eigen::Vector3d> points;  // [points], zero for points that take no part
  double damping_norm = 0;              // sum of D x^2 over the tile's own residuals; the predicted decrease of the
                                        // block is 1/2 (decrement^2 + lambda * sum of these)
};
// The step of the unknowns from that of the separator unknowns, by the factors of the tile (tile_trial.h goes on).
TileStep solve_tile_unknowns(const TilePlan& plan, const TileFactor& factor, const Step& boundary);
// The step of unknowns and points; the points are linearised again. Without `factor` the tile is condensed again, with
// the same bits. For tests, and for callers that need the steps of the points themselves; an iteration takes try_step
// (tile_trial.h).
TileStep solve_tile_down(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Sweep& sweep,
                         const TileFactor& factor, const Step& boundary, const TileDatum& datum = {});

// The posterior covariances of a tile, from the factors of a sweep with lambda = 0. The variance factor is one, a
// priori. Frames and mounts: of PoseIncrement (radians, metres). Points: metres. Cameras: in the units of the camera
// model.
struct TileCovariance {
  CovarianceMatrix boundary;                        // as given
  std::vector<Eigen::Matrix<double, 6, 6>> frames;  // [frames]; zero where untouched
  // [frames] where the datum is free: after the best-fit similarity of all positions of the part
  // (inner_constraints.h). NaN where this does not exist.
  std::vector<Eigen::Matrix<double, 6, 6>> aligned_frames;
  std::vector<Eigen::MatrixXd> cameras;  // [cameras] covariance of the model's parameters; zero for held ones
  std::vector<Eigen::Matrix<double, 6, 6>> mounts;  // [mounts]
  // [positions], [positions_aside] of the problem: their residuals, in sigmas squared (position_covariances.h); zero
  // where nothing is known
  std::vector<Eigen::Matrix3d> positions, positions_aside;
  // [points]; zero for points that take no part, and for tie points where TileDatum::clusters are given
  std::vector<Eigen::Matrix3d> points;
  ObservationTable observations;  // statistics of all observations of the tile, of those points
  // Redundancy numbers of the image observations along the image's x and y (no unit, 0 to 1;
  // io/evaluation/reliability.h), for residuals as the loss weights them: 1 - diag(J C J') / sigma^2. NaN for
  // observations that take no part. [observations]
  std::vector<float> redundancy_x, redundancy_y;
  ImageSpread spread;  // where TileDatum::spread asks for it
  // [points] The further columns (3 x columns), where they were asked for.
  std::vector<Eigen::Matrix<double, 3, Eigen::Dynamic>> point_columns;
};
// `columns`: step of plan.unknowns whose columns 1 and up are used; empty for blocks whose datum is fixed.
TileCovariance covariance_tile(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const TileFactor& factor, CovarianceMatrix boundary, const TileDatum& datum = {},
                               const Step& columns = {});

}  // namespace megablock
