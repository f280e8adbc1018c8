// Camera matrix P ~ K R [I | -C] into calibration, rotation and centre (KP-02; A. Barrier and S. Martin, "Bundle
// adjustment with known positions", appendix A; R. Hartley and A. Zisserman, "Multiple view geometry", 2004, 6.2.4).
//
// The rows of the left block are taken from the last to the first: r3 along the third, r2 along what the second has
// across r3, r1 = r2 x r3, so that det R = +1 whatever the matrix. K is upper triangular with K33 = 1 and K11 > 0. Two
// signs are left, of P and of K22, of which one is free: a matrix whose image has its y reversed has K22 < 0, or, times
// -1, K22 > 0 and everything behind the camera. A point that the camera sees decides.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "geometry/transform/pose.h"

namespace megablock {

using CameraMatrix = Eigen::Matrix<double, 3, 4>;

struct CameraMatrixParts {
  Eigen::Matrix3d calibration;  // K, pixels
  Pose pose;                    // looking along +z
};

// `visible`: a point in front of the camera; without one K22 > 0 is taken. Empty for a camera without centre or with
// rows that are multiples of one another, and where something is not a number.
std::optional<CameraMatrixParts> decompose_camera_matrix(const CameraMatrix& matrix,
                                                         const std::optional<Eigen::Vector3d>& visible = {});

CameraMatrix camera_matrix(const CameraMatrixParts& parts);

}  // namespace megablock
