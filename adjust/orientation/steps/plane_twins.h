// Which of the two orientations that explain a plane (twins) is the right one, by the planes that others see.
//
// A homography H ~ R + m t n', with n the plane's normal in the first image and m the base over the distance of the
// plane, has two decompositions of which neither puts points behind an image,
//
//     R + m t n' = S + m u v',        p'u = 0, p't = 1:   m n = (S - R)'p,
//
// p in the plane of t and u, and likewise v. The normal n is that of the ground for all pairs of an image, while v has
// about the direction of the base (H. Longuet-Higgins, "The reconstruction of a plane surface from two perspective
// projections", Proc. R. Soc. B 227, 1986) and is another for each: the right orientations are those whose normals
// agree. Rotations alone do not tell. They differ by n x m t or so, which adds up around a triangle as the bases do: in
// narrow views triangles of wrong twins close as well as those of right ones.
#pragma once

#include "adjust/orientation/steps/orientation_graph.h"

namespace megablock {

// Pairs of an image that the others of this image are held against: those of the most inliers. More of them say the
// same again, and each with all others would be quadratic in the pairs of an image.
inline constexpr std::size_t kTwinWitnesses = 64;

// Puts the orientation whose normals agree with those of other pairs first, where it clearly does so better than its
// twin; the other becomes its twin. Deterministic, whatever the order of the pairs.
void choose_twins_by_planes(OrientationGraph& graph, std::size_t witnesses = kTwinWitnesses);

}  // namespace megablock
