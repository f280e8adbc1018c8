// Robust averaging of relative rotations over a graph.
//
// Unknown R_i (world -> i), measured R_ij ~ R_j R_i'. With the increments w of rotation.h (about the world axes) and
// the world-axes residual e = Log(R_j' R_ij R_i), one iteration solves  w_j - w_i = e  in weighted least squares, a
// graph Laplacian times the 3x3 identity, by sparse Cholesky factorisation. Start: the spanning tree of the most
// trusted edges (inliers times the share of triangles that close). Weights: first 1/|e| (L1), then Geman-McClure, after
// Chatterjee and Govindu, "Efficient and robust large-scale rotation averaging", ICCV 2013; over the variance of what
// the matches say and of what they do not (calibration, wrong matches), which falls with their number. The loss turns
// at 2 degrees and three sigmas of the edge, added in squares.
//
// The average is free by a rotation of the world, and its errors add up along chains. A node that sees the vertical
// fixes two angles of three: with d where it sees down and g down in the world (the axis -z, to a degree) it measures
// w = g x R_i'd about the axes x and y. Where edge and verticals at its ends
// disagree by more than 5 degrees, a vertical that most edges of its node contradict is left out, and an edge that
// others contradict counts a tenth. The heading, about z, stays free.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "geometry/transform/rotation.h"

namespace megablock {

struct RelativeRotation {
  std::int32_t a = -1, b = -1;
  Eigen::Quaterniond rotation;  // R_b R_a'
  double inliers = 0;           // trust; a rotation from 100 inliers counts as 0.5 deg
  double sigma_rad = 0;         // of its matches' errors, per angle: it counts by both; 0: not known
};
// Of such a rotation, per angle, radians^2.
double variance_of(const RelativeRotation& edge);

// What is known of a rotation from elsewhere.
struct RotationPrior {
  Eigen::Quaterniond rotation;
  double sigma_rad = 0;  // 0: held
};

// Where a node sees down (Kalantari 2009, M45).
struct KnownVertical {
  std::int32_t node = -1;
  Eigen::Vector3d seen = Eigen::Vector3d::UnitY();     // unit, the node's axes
  Eigen::Vector3d ground = -Eigen::Vector3d::UnitZ();  // unit, world axes
  double sigma_rad = 0;                                // per angle, greater than 0
};

struct AveragedRotations {
  std::vector<std::optional<Eigen::Quaterniond>> rotation;  // [nodes] empty: not connected
  std::vector<std::uint8_t> kept;                           // [edges] 0: farther from the average than allowed
};

// `priors` [nodes]. With held rotations the nodes connected to them are averaged, else the largest connected part
// (ties: the lowest node); without any prior its lowest node gets the identity. With `verticals` alone the world's z is
// up, and the heading any.
AveragedRotations average_rotations(std::int32_t nodes, const std::vector<RelativeRotation>& edges,
                                    const std::vector<std::optional<RotationPrior>>& priors, double max_error_rad,
                                    const std::vector<KnownVertical>& verticals = {});

}  // namespace megablock
