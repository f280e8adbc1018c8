// Finds the parts of a block whose size the rest of the block does not determine.
//
// Two images tell the direction of their base, and not its length. The length follows from other bases: a frame that
// two frames of known place are linked with has a known place too, at the intersection of two directions, or, on a
// straight line, by the points that three frames see. So the links of a block make bodies, each of one scale:
//
// A body begins with a link, and takes every frame that has links to two of its frames, until there is none. Known
// lengths make frames a body from the start: observed positions, given poses, relative poses, rigs of several cameras,
// and two control points in one frame.
//
// Frames of several bodies are joints. A body may change its scale by u and move by s t, with its size s and its
// centroid m, as far as the joints let it; at the joint of the bodies a and b with the projection centre c
//
//     u_a (c - m_a) + s_a t_a = u_b (c - m_b) + s_b t_b,   with an error of a thousandth of the smaller size.
//
// Two bodies are one where the variance of u_a - u_b that follows from all joints is below 0.1^2; u has the prior sigma
// 1, and the largest body does not move. This takes two joints of two bodies, or a triangle of three. A body that
// shares a single frame with the others may grow and shrink about it, and no observation changes: the corner of a
// building of which each other image sees one side only. In practice some points are seen past the joint and still give
// a scale, but often they are wrong matches.
//
// Such networks of directions are called parallel rigid where all lengths follow (O. Ozyesil and A. Singer, "Robust
// camera location estimation by convex programming", CVPR 2015).
#pragma once

#include "io/block/block_diagnostics.h"
#include "partition/links/link_weights.h"

namespace megablock {

// Fills in loose_parts of the diagnostics, for frames with a pose and links of requested.min_link_points. Time and
// memory are linear in the number of links. Nothing depends on the order of the frames but the order of the parts.
void find_loose_parts(const Block& block, const BlockState& state, const LinkWeights& links,
                      BlockDiagnostics& diagnostics);

}  // namespace megablock
