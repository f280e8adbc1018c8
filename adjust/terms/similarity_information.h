// Tells how far the observations determine the similarities of a part of the block: its place, direction and scale.
//
// A similarity of the ground has the rotation phi (radians) about the centroid c of the part, the shift L t and the
// scale 1 + s, where L is the extent of the part in metres. It moves
//
//     points   dX = phi x (X - c) + L t + s (X - c)
//     frames   dw = -phi,  dC = phi x (C - c) + L t + s (C + R'C_0 - c)
//     mounts   dC_m = s (C_m - C_0),   C_0 that of the rig's first mount, which is held and so moves with the frame
//
// and changes no image residual; the scale only where two held mounts of a rig do not fix it. The frame's centre C does
// not grow about c itself: the camera of the first mount is at the reference place C + R'C_0, it must move as a point
// does, and C_0 keeps its length. The other cameras of the rig follow because their mounts grow about C_0.
//
// Let N be the matrix of these movements, with the columns (phi, t, s), and J the Jacobian of all residuals. Images
// give J N = 0, so only the other observations tell the similarity, by the 7 x 7 matrix sum (J N)'(J N) of their
// residuals. All seven columns are numbers without unit (rad, parts of L, parts of the scale), so that the eigenvalues
// of the matrix can be compared. The tile on its own (adjust/tile/datum.h) and the block (merge/datum/gauge.h) find
// their free directions from it.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

using Matrix37 = Eigen::Matrix<double, 3, 7>;
using Matrix67 = Eigen::Matrix<double, 6, 7>;
using Matrix77 = Eigen::Matrix<double, 7, 7>;

// The reference place C + R'C_0 of a frame row.
Eigen::Vector3d reference_place(const TileProblem& problem, const TileState& state, std::size_t frame);

// The movement by a similarity about `centre`, with columns (phi, t, s): rows of N, radians and metres. `reference` is
// the reference place of the frame. That of a mount has only the column of the scale.
Matrix67 similarity_of_frame(const Eigen::Vector3d& position, const Eigen::Vector3d& reference,
                             const Eigen::Vector3d& centre, double extent);
Matrix37 similarity_of_point(const Eigen::Vector3d& position, const Eigen::Vector3d& centre, double extent);
Matrix67 similarity_of_mount(const TileProblem& problem, const TileState& state, std::size_t mount);

// A part of the block that moves as a whole, with what the observations tell of its similarity.
struct SimilarityInformation {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // c
  double extent = 1;                                 // L, metres
  Matrix77 normal = Matrix77::Zero();                // sum (J N)'(J N) over the residuals
  Matrix77 held = Matrix77::Zero();  // sum N_C'N_C over held positions; N_C: the rows of N of a position
};

// Adds all observations but those of tie points in images, at this state and without their robust losses. A mount
// counts in every part that has images of it. `part_of_frame` [frames]: row of `parts`; -1: the frame takes no part,
// and none of its observations may.
void add_similarity_information(const TileProblem& problem, const TileState& state,
                                const std::vector<std::int64_t>& part_of_frame,
                                const std::vector<SimilarityInformation*>& parts);

}  // namespace megablock
