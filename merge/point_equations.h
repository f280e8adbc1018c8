// One point's part of the normal equations: shared by condensation, back-substitution and covariances, which all
// linearise again (cheaper than keeping it).
//
// With u = X - C, a residual's Jacobian J_p by the point gives that by the frame, J_f = J_p G, G = -[[u]x I]. So all
// that a frame's observations k of the point say is in V_f = sum J_pk'J_pk and b_f = -sum J_pk'r_k:
//
//     V = sum V_f,  b = sum b_f,  W_f = J_f'J_p = G'V_f,  J_f'J_f = W_f G,  -J_f'r = G'b_f.
//
// Shared unknowns s (intrinsics, free mounts) have Jacobians of their own: W_sk = J_sk'J_pk, W_s = sum W_sk,
// J_s'J_f = sum W_sk G. With V + lambda D + priors = C C': Y_i = W_i C^-T, z = C^-1 b, and the point's step is
//
//     x_p = C^-T (z - sum Y_i'x_i) = C^-T C^-1 (b - sum W_i'x_i),   W_f'x_f = V_f G x_f.
//
// A prior of the point joins V and b.
#pragma once

#include <span>

#include "adjust/linearise.h"
#include "merge/condense.h"
#include "merge/tile_linearisation.h"

namespace megablock {

// The unknowns of an image's residuals: positions in TilePlan::unknowns, -1: held.
struct ImageUnknowns {
  std::int64_t frame = -1, camera = -1, mount = -1;
  ParameterMask free = 0;  // of the camera
  int camera_width = 0;
  int shared_width = 0;           // of camera and mount, in this order
  std::int64_t calibration = -1;  // number of this (camera, mount) among those with shared unknowns
};
std::vector<ImageUnknowns> image_unknowns(const TileProblem& problem, const TilePlan& plan);  // [images]

// Row of the point's prior in TileProblem::point_priors, -1: none. [points]
std::vector<std::int64_t> prior_rows(const TileProblem& problem);

class PointEquations {
 public:
  using Rows3 = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3>>;
  // A frame that sees the point.
  struct FramePart {
    std::int64_t unknown = -1;
    Eigen::Vector3d from_frame;  // u
    Eigen::Matrix3d v;
    Eigen::Vector3d b;
    Eigen::Matrix3d t;  // V_f C^-T, after reduce()
    FramePart() {}      // not defaulted: the vector must not fill it with zeros
  };
  // An unknown that sees the point, after reduce().
  struct Block {
    std::int64_t unknown = -1;
    int dimension = 0;
    const double* y = nullptr;  // Y, [dimension x 3] column by column
    Rows3 matrix() const { return {y, dimension, 3}; }
  };
  struct Observation {
    std::int64_t image = -1;
    std::int32_t frame = -1;               // in frames()
    Eigen::Vector2d residual;              // weighted, as the Jacobians
    Eigen::Matrix<double, 2, 3> by_point;  // J_p
    const double* shared = nullptr;        // J_s, [2 x shared_width] row by row
    const double* shared_point = nullptr;  // W_sk, [shared_width x 3] column by column
    Observation() {}                       // as FramePart
  };

  PointEquations(const TileProblem& problem, const TilePlan& plan, const TileState& state);

  // Linearises all kept observations of the point and factorises its own block. Throws ComputeError behind a camera.
  void linearise(std::int64_t point, const Pass& pass);
  // After linearise(): Y of all unknowns that see the point.
  void reduce();
  // After linearise(): the point's step from that of plan.unknowns (first rows `offsets`).
  Eigen::Vector3d step(const double* x, const std::vector<std::int64_t>& offsets) const;

  std::span<const Observation> observations() const { return observations_; }
  std::span<const FramePart> frames() const { return frames_; }
  std::span<const Block> blocks() const { return blocks_; }  // the frames, then the shared unknowns
  const ImageUnknowns& unknowns_of(const Observation& o) const { return unknowns_[static_cast<std::size_t>(o.image)]; }
  const Eigen::Matrix3d& inverse_factor() const { return inverse_; }  // C^-1, zero rows where held
  const Eigen::Vector3d& z() const { return z_; }
  const Eigen::Vector3d& diagonal() const { return diagonal_; }  // of V with the prior
  double rho() const { return rho_; }
  double weighted_squares() const { return weighted_squares_; }
  std::int64_t residual_count() const { return residual_count_; }
  std::int64_t observation_count() const { return static_cast<std::int64_t>(observations_.size()); }
  int held() const { return held_; }
  // Place of an unknown that sees the point in blocks(), and of the point's prior in TileProblem::point_priors (-1).
  std::int64_t slot(std::int64_t unknown) const { return slot_[static_cast<std::size_t>(unknown)]; }
  std::int64_t prior_row(std::int64_t point) const { return prior_[static_cast<std::size_t>(point)]; }
  // Jacobians of an observation by its unknowns; how many.
  int jacobians(const Observation& observation, std::array<JacobianBlock<IntrinsicJacobian>, 3>& blocks) const;

 private:
  struct SharedPart {
    std::int64_t unknown = -1;
    int dimension = 0;
    double* w = nullptr;  // W_s
  };

  void clear(std::int64_t point);
  double* take(int count);
  void add_observation(std::int64_t point, std::int64_t row, bool curvature);
  void add_shared(const ImageUnknowns& unknowns, const ImageView& view, const CameraResidual& r,
                  Observation& observation);
  void add_to_shared(std::int64_t unknown, int dimension, const double* w, int rows);
  void add_prior(std::int64_t point);
  void factorise(double lambda);

  const TileProblem& problem_;
  const TileState& state_;
  std::vector<ImageView> views_;
  std::vector<ImageUnknowns> unknowns_;
  int widest_ = 0;  // shared_width
  std::vector<std::int64_t> prior_;
  std::vector<std::int32_t> slot_;  // of an unknown in frames_ or shared_, then in blocks_
  std::vector<Observation> observations_;
  std::vector<FramePart> frames_;
  std::vector<SharedPart> shared_;
  std::vector<Block> blocks_;
  std::vector<double> store_;  // what the pointers of one point point to
  std::size_t taken_ = 0;
  Eigen::Matrix3d v_, inverse_;
  Eigen::Vector3d b_, z_, diagonal_;
  double rho_ = 0, weighted_squares_ = 0;
  std::int64_t residual_count_ = 0;
  int held_ = 0;
};

}  // namespace megablock
