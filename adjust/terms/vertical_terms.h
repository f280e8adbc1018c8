// Gives the residual of a vertical that an image shows: an observation of two angles of its attitude, of its mount and
// of its camera (Kalantari 2009, chapter 10: verticals as observations).
//
// With g down at the frame (unit, ground axes), v = R_m R_f g is where the image sees it; d is where it was seen. The
// difference of two directions, across d, that grows with the angle a between them to the opposite side is Lambert's
// equal-area projection about d, of length 2 sin(a/2):
//
//     e = s B'v,   s = sqrt(2 / (1 + d'v)),   B the tangent plane of d (two columns).
//
// What d owes to the camera's parameters k, an error that all images of the camera share, is no error of measuring: d
// was found with k_0 and follows them by G = dd/dk. With L L' the covariance of measuring in B,
//
//     r = W s v - W G (k - k_0),   W = L^-1 B'.
//
// Derivatives by the right perturbations of R_f and R_m (geometry/transform/rotation.h), u = R_f g:
//
//     dv by w: -R_m R_f [g]x,  by w_m: -R_m [u]x;   dr by v: s W - s / (2 (1 + d'v)) (W v) d'
//
// "Down" is the ellipsoid's normal at the frame, which 10 km from the origin is 0.09 degrees off the ground's axis.
#pragma once

#include <optional>

#include "adjust/problem/tile_problem.h"
#include "io/block/crs.h"

namespace megablock {

// Down in the block's ground axes.
class GroundVertical {
 public:
  explicit GroundVertical(const GroundFrame& ground);
  // Unit; at a place in the ground frame.
  Eigen::Vector3d down(const Eigen::Vector3d& place) const;

 private:
  std::optional<Georeference> georeference_;
};

// The term of an observation, but for the image's row; `centre`: of its frame, metres.
TileProblem::VerticalTerm vertical_term(const SeenVertical& seen, const GroundVertical& ground,
                                        const Eigen::Vector3d& centre);

// Takes "down" of the problem's verticals and "up" of its lines from where their frames are in `places`. A merge moves
// the frames; its problem, made anew when it is resumed, may not depend on how far they have come.
void take_plumb_lines(const Block& block, const BlockState& places, TileProblem& problem);

struct VerticalResidual {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 6> by_frame, by_mount;  // zero by the centres; by parameters of the camera: -by_camera
};
// Where the image looks the wrong way round the derivative is that of a constant s; the residual is right.
VerticalResidual linearise_vertical(const Pose& frame, const Pose& mount, const Intrinsics& camera,
                                    const TileProblem::VerticalTerm& term);
VerticalResidual linearise_vertical(const TileProblem& problem, const TileState& state,
                                    const TileProblem::VerticalTerm& term);

}  // namespace megablock
