// Forms one point's part of the normal equations. Condensation, back-substitution and covariances use it. Each of them
// linearises the observations again, because that is cheaper than storing the linearisation.
//
// Residuals r are those of an image observation divided by its sigma (no unit), and J are their derivatives; both carry
// the weights of the loss (tile_linearisation.h). X is the point and C the centre of the frame, in metres.
//
// With u = X - C, the Jacobian J_p of a residual by the point gives the one by the frame, J_f = J_p G, G = -[[u]x I].
// The observations k of the point in one frame therefore enter by V_f = sum J_pk'J_pk and b_f = -sum J_pk'r_k alone:
//
//     V = sum V_f,  b = sum b_f,  W_f = J_f'J_p = G'V_f,  J_f'J_f = W_f G,  -J_f'r = G'b_f.
//
// Shared unknowns s (intrinsics, free mounts) have Jacobians of their own: W_sk = J_sk'J_pk, W_s = sum W_sk, J_s'J_f =
// sum W_sk G. With V + lambda D + priors = C C': Y_i = W_i C^-T, z = C^-1 b, and the point's step is
//
//     x_p = C^-T (z - sum Y_i'x_i) = C^-T C^-1 (b - sum W_i'x_i),   W_f'x_f = V_f G x_f.
//
// A prior of the point is added to V and b.
//
// Many points are processed at once, by kernels over observations, over groups of observations, and over points
// (point_kernels.h). A group holds the observations of a point in one frame: in one image, or in
// several cameras of a rig. It has one V_f, one b_f and one u, which no mount changes.
#pragma once

#include <span>

#include "adjust/lanes/observation_lanes.h"
#include "merge/tile/condense.h"
#include "merge/tile/point_kernels.h"
#include "merge/tile/tile_linearisation.h"

namespace megablock {

// The unknowns in the residuals of an image: positions in TilePlan::unknowns, -1: held.
struct ImageUnknowns {
  std::int64_t frame = -1, camera = -1, mount = -1;
  ParameterMask free = 0;  // of the camera
  int camera_width = 0;
  int shared_width = 0;           // of camera and mount, in this order
  std::int64_t calibration = -1;  // number of this (camera, mount) among the pairs with shared unknowns
  bool plain = false;             // the kernels have the model of its camera, and it has no shared unknowns
};
std::vector<ImageUnknowns> image_unknowns(const TileProblem& problem, const TilePlan& plan,
                                          const std::vector<LaneView>& views);  // [images]

// The row of the point's prior in TileProblem::point_priors, -1: none. [points]
std::vector<std::int64_t> prior_rows(const TileProblem& problem);

// The sums over the observations of a frame, by point_kernels::FrameValue.
struct alignas(64) FrameSum {
  std::array<double, point_kernels::kFrameSize> values{};
};

// A step of plan.unknowns in the layout that the steps of the points read.
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

// Tables of one state of a tile. They are made once for all points and only read afterwards, so the threads of the tile
// share them.
struct PointTables {
  SeenImages images;
  std::vector<ImageUnknowns> unknowns;  // [images]
  std::vector<std::int32_t> frames;     // [images] ImageUnknowns::frame, which is read most often
  std::vector<std::int64_t> prior;      // [points] (prior_rows)
  PointTables(const TileProblem& problem, const TilePlan& plan, const TileState& state);
};

// The equations of one batch of points after the other. An object belongs to one thread. linearise() begins a batch;
// what the other functions return belongs to this batch, and pointers are valid until the next one. The order of the
// calls is
//
//     linearise, reduce, then y, blocks, shared, jacobians       sweep up and covariances
//     linearise, steps, then squares_of                          sweep down
class PointEquations {
 public:
  using Rows3 = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 3>>;
  // One of the present points. Its observations are the lanes [first, last), its groups [first_group, last_group).
  struct Point {
    std::int64_t point = -1;
    std::int64_t first = 0, last = 0;
    std::int64_t first_group = 0, last_group = 0;
    std::int64_t shared_begin = 0, shared_end = 0;
    double rho = 0, weighted_squares = 0;
    std::int64_t residual_count = 0;
    std::int64_t observation_count() const { return last - first; }
    std::int64_t group_count() const { return last_group - first_group; }
  };
  // An unknown in the residuals of the point.
  struct Block {
    std::int64_t unknown = -1;
    int dimension = 0;
    const double* y = nullptr;  // Y, [dimension x 3] column by column
    Rows3 matrix() const { return {y, dimension, 3}; }
  };
  // The shared unknowns in the residual of an observation.
  struct SharedRows {
    const double* jacobian = nullptr;  // J_s, [2 x shared_width] row by row, weighted
    const double* by_point = nullptr;  // W_sk, [shared_width x 3] column by column
  };

  // All three arguments outlive the object.
  PointEquations(const TileProblem& problem, const TileState& state, const PointTables& tables);

  // Linearises the kept observations of the first of these points, of as many as there is room for, and factorises
  // their matrices V. Returns the number of points. Throws ComputeError when an observation lies behind its camera.
  std::size_t linearise(std::span<const std::int32_t> points, const Sweep& sweep);
  const std::vector<Point>& points() const { return points_; }  // the present points, those of the last linearise()

  // After linearise(): computes Y of all unknowns in the residuals of the points, and adds the contributions of the
  // frames to `sums` [plan.unknowns].
  void reduce(std::vector<FrameSum>& sums);
  // After linearise(), once: writes the steps of the points to `out` [problem.points].
  void steps(const UnknownMotions& motions, std::vector<Eigen::Vector3d>& out);

  // The squared residuals |r|^2 of the lanes in another state, with these images and points; not finite where the
  // camera cannot project the point. Only linearise() may follow.
  std::span<const double> squares_of(const SeenImages& images, const std::vector<Eigen::Vector3d>& points);

  const ImageUnknowns& unknowns_of(std::int64_t lane) const { return *lane_unknowns_[at(lane)]; }
  Eigen::Vector2d residual(std::int64_t lane) const { return lanes_.residual(lane); }      // weighted, as the Jacobians
  Eigen::Vector3d from_frame(std::int64_t lane) const { return lanes_.from_frame(lane); }  // u
  Eigen::Matrix<double, 2, 3> by_point(std::int64_t lane) const { return lanes_.by_point(lane); }  // J_p
  std::int64_t row_of(std::int64_t lane) const { return rows_[at(lane)]; }                         // row in the problem
  const SharedRows& shared(std::int64_t lane) const { return shared_rows_[at(lane)]; }
  const double* y(std::int64_t group) const { return y_.data() + group * point_kernels::kYSize; }
  const std::int64_t* begin() const { return begin_.data(); }  // [points() + 1] first group of each point
  std::int64_t group_count() const { return groups_; }
  std::int64_t frame_of(std::int64_t group) const { return group_frames_[at(group)]; }  // position in plan.unknowns
  const point_kernels::Kernels& kernels() const { return *kernels_; }

  // These three take the number i of a point in points().
  Eigen::Matrix3d inverse_factor(std::size_t i) const;  // C^-1, zero rows where held
  Eigen::Vector3d z(std::size_t i) const {
    return {point_value(point_kernels::kPointZ, i), point_value(point_kernels::kPointZ + 1, i),
            point_value(point_kernels::kPointZ + 2, i)};
  }
  Eigen::Vector3d diagonal(std::size_t i) const;  // diagonal of V with the prior
  int held(std::size_t i) const { return static_cast<int>(point_value(point_kernels::kPointHeld, i)); }
  // After reduce(): the frames, one for each group of the point, then the shared unknowns.
  void blocks(std::size_t i, std::vector<Block>& list) const;
  // The row of the point's prior in TileProblem::point_priors, or -1.
  std::int64_t prior_row(std::int64_t point) const { return prior_[at(point)]; }
  // The Jacobians of an observation by its unknowns. Returns their number.
  int jacobians(std::int64_t lane, std::array<JacobianBlock<IntrinsicJacobian>, 3>& blocks) const;

 private:
  // A shared unknown of a point, with the sums over its observations of the point.
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
  void sum_up(bool curvature);
  void add_prior(std::size_t i, bool curvature);
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
  double usual_squares_;  // the loss leaves squared residuals up to this value unchanged
  bool all_plain_;        // all images are `plain`
  const std::vector<ImageView>& views_;
  const std::vector<LaneView>& lane_views_;
  const std::vector<ImageUnknowns>& unknowns_;
  const std::vector<std::int32_t>& frames_;
  const std::vector<std::int64_t>& prior_;
  // These belong to the present points.
  std::vector<Point> points_;
  ObservationLanes lanes_;
  std::vector<std::int64_t> rows_;                   // [lanes] row in the problem
  std::vector<const ImageUnknowns*> lane_unknowns_;  // [lanes]
  std::vector<SharedRows> shared_rows_;              // [lanes]
  std::vector<double> squares_;                      // [lanes]
  std::vector<std::int64_t> group_of_lane_;          // [lanes] number of the group
  std::int64_t groups_ = 0;
  std::vector<std::int32_t> group_frames_;    // [groups] positions in plan.unknowns
  std::vector<const double*> step_of_group_;  // [groups] records in steps_
  std::vector<double*> frame_sums_;           // [groups]
  std::vector<const double*> motions_;        // [groups]
  AlignedValues records_;                     // [lanes, then groups x kRecordSize]
  AlignedValues y_, moved_;                   // [groups x kYSize]; [3 x groups]
  std::vector<std::int64_t> begin_;           // [points + 1] first group of each point
  AlignedValues point_values_;                // by PointValue
  AlignedValues sums_, steps_;                // [points x kRecordSize] each
  std::vector<SharedPart> shared_;
  std::vector<double> store_;  // memory of the pointers in shared_ and shared_rows_
  std::size_t taken_ = 0;
};

}  // namespace megablock
