// Gives the rotations of all nodes of a graph from relative rotations, priors and verticals, robustly.
//
// The unknowns are R_i (world -> i), the observations R_ij ~ R_j R_i'. With the increments w of rotation.h (about the
// world axes) and the residual e = Log(R_j' R_ij R_i) in world axes, one iteration solves  w_j - w_i = e  in weighted
// least squares. The matrix is a graph Laplacian times the 3x3 identity, factorised by sparse Cholesky. The start is
// the spanning tree of the most trusted edges (inliers times the share of triangles that close). The weights are first
// 1/|e| (L1), then those of Geman and McClure (A. Chatterjee and V. Govindu, "Efficient and robust large-scale rotation
// averaging", ICCV 2013). They are divided by the variance of the edge: that of the noise of its matches, plus a part
// for calibration and wrong matches that falls with their number. The width of the loss is 2 degrees and three sigmas
// of the edge, added in squares.
//
// Relative rotations leave a common rotation of the world free, and their errors add up along chains. A node with a
// vertical fixes two of its three angles. With d the direction of down in the node and g that in the world (the axis
// -z, to a degree) it observes w = g x R_i'd about the axes x and y; the heading about z stays free. An edge and the
// verticals at its ends disagree from 5 degrees on. A vertical that most edges of its node contradict is then left out,
// and an edge that the remaining verticals contradict counts a tenth.
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
  double inliers = 0;           // a rotation from 100 inliers has a sigma of 0.5 deg
  double sigma_rad = 0;         // by the noise of its matches, per angle, added to the above; 0: not known
};
// The variance of a relative rotation, per angle, in rad^2.
double variance_of(const RelativeRotation& edge);

// A rotation known from attitude priors or given poses.
struct RotationPrior {
  Eigen::Quaterniond rotation;
  double sigma_rad = 0;  // 0: held
};

// The direction of down in a node (Kalantari 2009, chapter 8: verticals of images).
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

// `priors` [nodes]. With held rotations the nodes connected to them are averaged, else those of the largest connected
// part (of equal ones that with the lowest node). Without any prior its lowest node gets the identity. With `verticals`
// alone the z axis of the world is up and the heading arbitrary.
AveragedRotations average_rotations(std::int32_t nodes, const std::vector<RelativeRotation>& edges,
                                    const std::vector<std::optional<RotationPrior>>& priors, double max_error_rad,
                                    const std::vector<KnownVertical>& verticals = {});

}  // namespace megablock
