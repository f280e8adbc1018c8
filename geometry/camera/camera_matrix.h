// Splits a camera matrix P ~ K R [I | -C] into calibration, rotation and centre (A. Barrier and S. Martin, "Bundle
// adjustment with known positions", report, ENS Paris-Saclay, appendix A; R. Hartley and A. Zisserman, "Multiple view
// geometry", 2004, section 6.2.4).
//
// The rows of R come from the left 3 x 3 block, last row first: r3 along its third row, r2 along the part of its second
// row that is perpendicular to r3, and r1 = r2 x r3, which makes det R = +1 for every matrix. K is upper triangular
// with K33 = 1 and K11 > 0. Two signs remain, that of P and that of K22, and one of them is free. A matrix for an image
// with y upwards has K22 < 0; multiplied by -1 it has K22 > 0 and everything behind the camera. A point that the camera
// sees decides.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "geometry/transform/pose.h"

namespace megablock {

using CameraMatrix = Eigen::Matrix<double, 3, 4>;

struct CameraMatrixParts {
  Eigen::Matrix3d calibration;  // K, pixels
  Pose pose;                    // ground -> camera, looking along +z
};

// `visible` is a point in front of the camera; without one, K22 > 0 is assumed. Empty for a camera without a centre,
// for rows that are multiples of one another, and for input that is not finite.
std::optional<CameraMatrixParts> decompose_camera_matrix(const CameraMatrix& matrix,
                                                         const std::optional<Eigen::Vector3d>& visible = {});

// The matrix K R [I | -C].
CameraMatrix camera_matrix(const CameraMatrixParts& parts);

}  // namespace megablock
