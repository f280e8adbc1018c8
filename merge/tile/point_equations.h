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
//
// Points are worked on many at once, by kernels over their observations, their sights and the points
// (point_kernels.h). A sight is what a frame observes of a point, in one image or in several of its cameras: V_f, b_f
// and u, which no mount changes.
#pragma once

#include <span>

#include "adjust/lanes/observation_lanes.h"
#include "merge/tile/condense.h"
#include "merge/tile/point_kernels.h"
#include "merge/tile/tile_linearisation.h"

namespace megablock {

// The unknowns of an image's residuals: positions in TilePlan::unknowns, -1: held.
struct ImageUnknowns {
  std::int64_t frame = -1, camera = -1, mount = -1;
  ParameterMask free = 0;  // of the camera
  int camera_width = 0;
  int shared_width = 0;           // of camera and mount, in this order
  std::int64_t calibration = -1;  // number of this (camera, mount) among those with shared unknowns
  bool plain = false;             // a camera that the kernels know, without shared unknowns
};
std::vector<ImageUnknowns> image_unknowns(const TileProblem& problem, const TilePlan& plan,
                                          const std::vector<LaneView>& views);  // [images]

// Row of the point's prior in TileProblem::point_priors, -1: none. [points]
std::vector<std::int64_t> prior_rows(const TileProblem& problem);

// Sums over observations of a frame, by point_kernels::FrameValue.
struct alignas(64) FrameSum {
  std::array<double, point_kernels::kFrameSize> values{};
};

// A step of plan.unknowns, as the points' steps read it.
class UnknownMotions {
 public:
  UnknownMotions(const TilePlan& plan, const double* x);  // x outlives it
  const double* of_frame(std::int64_t unknown) const { return frames_[static_cast<std::size_t>(unknown)].data(); }
  const double* of(std::int64_t unknown) const { return x_ + offsets_[static_cast<std::size_t>(unknown)]; }

 private:
  const double* x_;
  std::vector<std::int64_t> offsets_;
  std::vector<std::array<double, 8>> frames_;
};

// What the threads of a tile share, of one state.
struct PointTables {
  SeenImages images;
  std::vector<ImageUnknowns> unknowns;  // [images]
  std::vector<std::int32_t> frames;     // [images] of these, what is asked most
  std::vector<std::int64_t> prior;      // [points] (prior_rows)
  PointTables(const TileProblem& problem, const TilePlan& plan, const TileState& state);
};

class PointEquations {
 public:
  using Rows3 = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3>>;
  // One of the points at hand, with its observations, lanes [first, last), and sights [first_sight, last_sight).
  struct Point {
    std::int64_t point = -1;
    std::int64_t first = 0, last = 0;
    std::int64_t first_sight = 0, last_sight = 0;
    std::int64_t shared_begin = 0, shared_end = 0;
    double rho = 0, weighted_squares = 0;
    std::int64_t residual_count = 0;
    std::int64_t observation_count() const { return last - first; }
    std::int64_t sight_count() const { return last_sight - first_sight; }
  };
  // An unknown that sees the point.
  struct Block {
    std::int64_t unknown = -1;
    int dimension = 0;
    const double* y = nullptr;  // Y, [dimension x 3] column by column
    Rows3 matrix() const { return {y, dimension, 3}; }
  };
  // Shared unknowns of an observation.
  struct SharedRows {
    const double* jacobian = nullptr;  // J_s, [2 x shared_width] row by row, weighted
    const double* by_point = nullptr;  // W_sk, [shared_width x 3] column by column
  };

  // All three outlive it.
  PointEquations(const TileProblem& problem, const TileState& state, const PointTables& tables);

  // Linearises all kept observations of the first of the points, as many as there is room for, and factorises their own
  // blocks. Returns how many. Throws ComputeError behind a camera.
  std::size_t linearise(std::span<const std::int32_t> points, const Pass& pass);
  const std::vector<Point>& points() const { return points_; }  // those

  // After linearise(): Y of all unknowns that see the points; the frames' sums grow by theirs. [plan.unknowns]
  void reduce(std::vector<FrameSum>& sums);
  // After linearise(), once: the points' steps into `out` [problem.points].
  void steps(const UnknownMotions& motions, std::vector<Eigen::Vector3d>& out);

  // Squared residuals |r|^2 of the lanes in another state, of these images and points; not finite where the camera
  // cannot project the point. Behind it comes the next linearise().
  std::span<const double> squares_of(const SeenImages& images, const std::vector<Eigen::Vector3d>& points);

  const ImageUnknowns& unknowns_of(std::int64_t lane) const { return *lane_unknowns_[at(lane)]; }
  Eigen::Vector2d residual(std::int64_t lane) const { return lanes_.residual(lane); }      // weighted, as the Jacobians
  Eigen::Vector3d from_frame(std::int64_t lane) const { return lanes_.from_frame(lane); }  // u
  Eigen::Matrix<double, 2, 3> by_point(std::int64_t lane) const { return lanes_.by_point(lane); }  // J_p
  std::int64_t row_of(std::int64_t lane) const { return rows_[at(lane)]; }                         // in the problem
  const SharedRows& shared(std::int64_t lane) const { return shared_rows_[at(lane)]; }
  const double* y(std::int64_t sight) const { return y_.data() + sight * point_kernels::kYSize; }
  const std::int64_t* begin() const { return begin_.data(); }  // [points() + 1] sights
  std::int64_t sight_count() const { return sights_; }
  std::int64_t frame_of(std::int64_t sight) const { return sight_frames_[at(sight)]; }  // position in plan.unknowns
  const point_kernels::Kernels& kernels() const { return *kernels_; }

  // Of point number i of points().
  Eigen::Matrix3d inverse_factor(std::size_t i) const;  // C^-1, zero rows where held
  Eigen::Vector3d z(std::size_t i) const {
    return {point_value(point_kernels::kPointZ, i), point_value(point_kernels::kPointZ + 1, i),
            point_value(point_kernels::kPointZ + 2, i)};
  }
  Eigen::Vector3d diagonal(std::size_t i) const;  // of V with the prior
  int held(std::size_t i) const { return static_cast<int>(point_value(point_kernels::kPointHeld, i)); }
  // After reduce(): the frames, one of each sight, then the shared unknowns.
  void blocks(std::size_t i, std::vector<Block>& list) const;
  // The point's prior in TileProblem::point_priors (-1).
  std::int64_t prior_row(std::int64_t point) const { return prior_[at(point)]; }
  // Jacobians of an observation by its unknowns; how many.
  int jacobians(std::int64_t lane, std::array<JacobianBlock<IntrinsicJacobian>, 3>& blocks) const;

 private:
  struct SharedPart {
    std::int64_t unknown = -1;
    int dimension = 0;
    double* w = nullptr;  // W_s
    double* y = nullptr;
  };

  void clear();
  void fetch_ahead(std::int64_t point) const;
  double* take(int count);
  void add_observations(std::int64_t point);
  bool add_lanes(std::int64_t first, std::int64_t count, const Eigen::Vector3d& point);
  void weigh(Point& point, bool curvature);
  void weigh_each(Point& point, bool curvature);
  void weigh_lane(Point& point, std::int64_t lane, bool curvature);
  void linearise_lane(Point& point, std::int64_t lane, bool curvature);
  void add_shared(const ImageUnknowns& unknowns, const ImageView& view, const CameraResidual& r, std::int64_t lane,
                  Point& point);
  void add_to_shared(std::int64_t unknown, int dimension, const double* w, int rows, Point& point);
  void sum_up();
  void add_prior(std::size_t i);
  std::int64_t padded_points() const { return lane_kernels::padded(std::ssize(points_)); }
  double& point_value(int v, std::size_t i) {
    return point_values_.data()[v * lanes_.capacity() + static_cast<std::int64_t>(i)];
  }
  double point_value(int v, std::size_t i) const {
    return point_values_.data()[v * lanes_.capacity() + static_cast<std::int64_t>(i)];
  }

  const TileProblem& problem_;
  const TileState& state_;
  const point_kernels::Kernels* kernels_;
  double usual_squares_;  // squared residuals up to there cost what they are
  bool all_plain_;        // all images
  const std::vector<ImageView>& views_;
  const std::vector<LaneView>& lane_views_;
  const std::vector<ImageUnknowns>& unknowns_;
  const std::vector<std::int32_t>& frames_;
  const std::vector<std::int64_t>& prior_;
  // Of the points at hand.
  std::vector<Point> points_;
  ObservationLanes lanes_;
  std::vector<std::int64_t> rows_;                   // [lanes] of the problem
  std::vector<const ImageUnknowns*> lane_unknowns_;  // [lanes]
  std::vector<SharedRows> shared_rows_;              // [lanes]
  std::vector<double> squares_;                      // [lanes]
  std::vector<std::int64_t> sight_of_lane_;          // [lanes]
  std::int64_t sights_ = 0;
  std::vector<std::int32_t> sight_frames_;    // [sights] positions in plan.unknowns
  std::vector<const double*> step_of_sight_;  // [sights] in steps_
  std::vector<double*> frame_sums_;           // [sights]
  std::vector<const double*> motions_;        // [sights]
  AlignedValues records_;                     // [lanes, then sights x kRecordSize]
  AlignedValues y_, moved_;                   // [sights x kYSize]; [3 x sights]
  std::vector<std::int64_t> begin_;           // [points + 1] sights
  AlignedValues point_values_;                // by PointValue
  AlignedValues sums_, steps_;                // [points x kRecordSize] each
  std::vector<SharedPart> shared_;
  std::vector<double> store_;  // what the pointers of shared_ and shared_rows_ point to
  std::size_t taken_ = 0;
};

}  // namespace megablock
