// Gives the residual of a vertical that an image shows: an observation of two angles of its attitude, of its mount and
// of its camera (Kalantari 2009, chapter 10: verticals as observations).
//
// With g down at the frame (unit, ground axes), v = R_m R_f g is the direction in which the image should see it, and d
// is the direction in which it was seen. The residual is the difference of the two directions across d. It must grow
// with the angle a between them up to the opposite direction. Lambert's equal-area projection about d does so, with the
// length 2 sin(a/2):
//
//     e = s B'v,   s = sqrt(2 / (1 + d'v)),   B the tangent plane of d (two columns).
//
// d depends on the parameters k of the camera. This dependence is no error of the measurement, because all images of
// the camera share it: d was found with k_0 and follows the parameters by G = dd/dk. With L L' the covariance of the
// measurement in B,
//
//     r = W s v - W G (k - k_0),   W = L^-1 B'.
//
// The derivatives by the right perturbations of R_f and R_m (geometry/transform/rotation.h), with u = R_f g, are
//
//     dv by w: -R_m R_f [g]x,  by w_m: -R_m [u]x;   dr by v: s W - s / (2 (1 + d'v)) (W v) d'
//
// "Down" is the normal of the ellipsoid at the frame. 10 km from the origin it is 0.09 degrees off the axis of the
// ground frame.
#pragma once

#include <optional>

#include "adjust/problem/tile_problem.h"
#include "io/block/crs.h"

namespace megablock {

// The direction of down in the block's ground axes.
class GroundVertical {
 public:
  explicit GroundVertical(const GroundFrame& ground);
  // The unit vector at a place in the ground frame.
  Eigen::Vector3d down(const Eigen::Vector3d& place) const;

 private:
  std::optional<Georeference> georeference_;
};

// The observation without the row of its image. `centre` is that of its frame, metres.
TileProblem::VerticalTerm vertical_term(const SeenVertical& seen, const GroundVertical& ground,
                                        const Eigen::Vector3d& centre);

// Takes "down" of the problem's verticals, and "up" of its lines, at the places that their frames have in `places`. A
// merge moves the frames, but a resumed merge makes its problem anew, and the problem must not depend on the progress
// so far.
void take_plumb_lines(const Block& block, const BlockState& places, TileProblem& problem);

struct VerticalResidual {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 6> by_frame, by_mount;  // zero by the centres; by camera parameters it is -by_camera
};
// Where the image looks in the opposite direction, the derivative is that of a constant s; the residual is correct.
VerticalResidual linearise_vertical(const Pose& frame, const Pose& mount, const Intrinsics& camera,
                                    const TileProblem::VerticalTerm& term);
VerticalResidual linearise_vertical(const TileProblem& problem, const TileState& state,
                                    const TileProblem::VerticalTerm& term);

}  // namespace megablock
