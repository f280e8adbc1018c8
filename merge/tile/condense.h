// A tile: its condensed normal equations on the boundary unknowns, and the way back down.
//
// Inside the tile the bisection goes on to cells of about 16 frames (32 of a lone tile). A point belongs to one of them
// (adjust/problem/owner.h) and is eliminated there: with V = sum J_p'J_p + lambda D_p = C C', W_i = J_i'J_p and Y_i =
// W_i C^-T,
//
//     K_ij -= Y_i Y_j',   b_i -= Y_i C^-1 b_p,   x_p = C^-T (C^-1 b_p - sum Y_i' x_i).
//
// The cells' fronts are then eliminated depth-first like the nodes of the merge tree. The boundary block is never
// factorised: in a tile without a datum it is singular.
// Robust weights as Ceres (sqrt(rho'), no second-order term) unless the pass asks for the losses' curvature
// (tile_linearisation.h); D = diagonal of J'J.
#pragma once

#include <memory>

#include "adjust/problem/tile_problem.h"
#include "io/block/observation_statistics.h"
#include "merge/front/front.h"
#include "merge/plan/tile_plan.h"

namespace megablock {

// Factors of a tile's cells, by node of TilePlan::cells. Empty: recompute.
struct TileFactor {
  std::vector<FrontFactor> nodes;
  std::vector<double> diagonal;  // of J'J over the scalar unknowns of the plan: the tile's own residuals
  bool empty() const { return nodes.empty(); }
  std::int64_t byte_count() const;
  void write(ByteWriter& out) const;
  static TileFactor read(ByteReader& in);
};

struct TileCondensation {
  UpdateMatrix update;
  TileFactor factor;
};

// What the datum of a free block adds to a tile (gauge.h); empty when priors fix it.
struct TileDatum {
  struct Hold {
    UnknownId frame;
    Eigen::Matrix<double, 6, Eigen::Dynamic> directions;  // along which the frame is held
  };
  std::vector<Hold> holds;
  Step columns{{}, 0, {}};  // further right-hand sides
};

// How a pass linearises and damps.
struct Pass {
  double lambda = 0;
  bool curvature = false;  // with the second-order term of the robust losses
  Pass(double damping, bool with_curvature = false) : lambda(damping), curvature(with_curvature) {}
};

// Linearises at `state`, eliminates the tile's points and interior unknowns.
// Throws ComputeError when a kept observation is behind its camera.
TileCondensation condense_tile(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const Pass& pass, const TileDatum& datum = {});

// The same in parts, by threads that may be at work on other tiles, too (geometry/threads/rounds.h).
class TileCondenser {
 public:
  // Problem, plan and state outlive it.
  TileCondenser(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
                TileDatum datum = {});
  ~TileCondenser();
  std::int64_t cells() const;
  // A cell, and the fronts above it that it completes; every cell once.
  void condense(std::int64_t cell);
  TileCondensation take();  // once all are done

 private:
  class Work;
  std::unique_ptr<Work> work_;
};

// Step of everything in the tile.
struct TileStep {
  Step unknowns;                        // of plan.unknowns, with the columns of the boundary's step
  std::vector<Eigen::Vector3d> points;  // [points], zero for points that take no part
  double damping_norm = 0;              // sum of D x^2 over the tile's own residuals; the predicted decrease of the
                                        // block is 1/2 (decrement^2 + lambda * sum of these)
};
// From the boundary's step, the unknowns alone, which the factor gives (tile_trial.h goes on).
TileStep solve_tile_unknowns(const TilePlan& plan, const TileFactor& factor, const Step& boundary);
// And the points, which are linearised again. `factor` empty: condensed again (same bits).
TileStep solve_tile_down(const TileProblem& problem, const TilePlan& plan, const TileState& state, const Pass& pass,
                         const TileFactor& factor, const Step& boundary, const TileDatum& datum = {});

// Posterior covariances of a tile, from factors of a pass with lambda = 0.
struct TileCovariance {
  CovarianceMatrix boundary;                        // as given
  std::vector<Eigen::Matrix<double, 6, 6>> frames;  // [frames]; zero where untouched
  std::vector<Eigen::MatrixXd> cameras;             // [cameras] of the model's parameters; held ones zero
  std::vector<Eigen::Matrix<double, 6, 6>> mounts;  // [mounts]
  std::vector<Eigen::Matrix3d> points;              // [points]; zero for points that take no part
  ObservationTable observations;                    // of everything the tile observes
  // Redundancy numbers of the image observations, along the image's x and y (no unit, 0 to 1;
  // io/evaluation/reliability.h), of the residual as its loss weights it: 1 - diag(J C J') / sigma^2. NaN for
  // observations that take no part. [observations]
  std::vector<float> redundancy_x, redundancy_y;
  // [points] of the further columns (3 x columns), where they were asked for.
  std::vector<Eigen::Matrix<double, 3, Eigen::Dynamic>> point_columns;
};
// `columns`: of plan.unknowns, column 0 is not used; empty for blocks with a datum.
TileCovariance covariance_tile(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                               const TileFactor& factor, CovarianceMatrix boundary, const TileDatum& datum = {},
                               const Step& columns = {});

}  // namespace megablock
