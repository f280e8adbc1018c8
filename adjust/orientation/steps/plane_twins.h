// Chooses between the two relative orientations that explain the matches of a plane (twins), by the planes that other
// pairs see.
//
// Let H ~ R + m t n' be a homography, n the plane's normal in the first image and m the base over the distance of the
// plane. It has two decompositions that put no point behind an image,
//
//     R + m t n' = S + m u v',        p'u = 0, p't = 1:   m n = (S - R)'p,
//
// with p in the plane of t and u, and likewise v. The normal n is that of the ground for all pairs of an image. The
// normal v has about the direction of the base and differs from pair to pair (H. Longuet-Higgins, "The reconstruction
// of a plane surface from two perspective projections", Proc. R. Soc. B 227, 1986). So the correct orientations are
// those whose normals agree. Rotations alone do not tell. Those of twins differ by about n x m t, which adds up around
// a triangle as the bases do, so that in narrow fields of view triangles of wrong twins close as well as those of
// correct ones.
// Internal to adjust/: it is not installed.
#pragma once

#include "adjust/orientation/steps/orientation_graph.h"

namespace megablock {

// The pairs of an image are compared with this many pairs of the same image, those with most inliers. More witnesses
// add nothing, and comparing all with all would be quadratic in the pairs of an image.
inline constexpr std::size_t kTwinWitnesses = 64;

// Swaps orientation and twin of an edge where the normals of the twin agree clearly better with those of other pairs.
// The result does not depend on the order of the pairs.
void choose_twins_by_planes(OrientationGraph& graph, std::size_t witnesses = kTwinWitnesses);

}  // namespace megablock
