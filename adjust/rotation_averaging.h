// Robust averaging of relative rotations over a graph.
//
// Unknown R_i (world -> i), measured R_ij ~ R_j R_i'. With the increments w of rotation.h (about the world axes) and
// the world-axes residual e = Log(R_j' R_ij R_i), one iteration solves  w_j - w_i = e  in weighted least squares, a
// graph Laplacian times the 3x3 identity, by sparse Cholesky factorisation. Start: the spanning tree of the most
// trusted edges (inliers times the share of triangles that close). Weights: first 1/|e| (L1), then Geman-McClure, after
// Chatterjee and Govindu, "Efficient and robust large-scale rotation averaging", ICCV 2013.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "geometry/rotation.h"

namespace megablock {

struct RelativeRotation {
  std::int32_t a = -1, b = -1;
  Eigen::Quaterniond rotation;  // R_b R_a'
  double inliers = 0;           // trust; a rotation from 100 inliers counts as 0.5 deg
};

// What is known of a rotation from elsewhere.
struct RotationPrior {
  Eigen::Quaterniond rotation;
  double sigma_rad = 0;  // 0: held
};

struct AveragedRotations {
  std::vector<std::optional<Eigen::Quaterniond>> rotation;  // [nodes] empty: not connected
  std::vector<std::uint8_t> kept;                           // [edges] 0: farther from the average than allowed
};

// `priors` [nodes]. With held rotations the nodes connected to them are averaged, else the largest connected part
// (ties: the lowest node); without any prior its lowest node gets the identity.
AveragedRotations average_rotations(std::int32_t nodes, const std::vector<RelativeRotation>& edges,
                                    const std::vector<std::optional<RotationPrior>>& priors, double max_error_rad);

}  // namespace megablock
