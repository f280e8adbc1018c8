#include "geometry/camera/camera_matrix.h"

#include <Eigen/LU>

namespace megablock {

std::optional<CameraMatrixParts> decompose_camera_matrix(const CameraMatrix& matrix,
                                                         const std::optional<Eigen::Vector3d>& visible) {
  // Scale P so that the third row of K R has length one; K33 is then one.
  CameraMatrix p = matrix / matrix.row(2).head<3>().norm();
  const auto behind = [&] { return p.row(2).dot(visible->homogeneous()) < 0; };
  if (visible ? behind() : p.leftCols<3>().determinant() < 0) p = -p;
  const Eigen::Vector3d p1 = p.row(0).head<3>(), p2 = p.row(1).head<3>(), r3 = p.row(2).head<3>();
  Eigen::Vector3d r2 = (p2 - p2.dot(r3) * r3).normalized(), r1 = r2.cross(r3);
  if (p1.dot(r1) < 0) {
    r1 = -r1;
    r2 = -r2;
  }
  CameraMatrixParts parts;
  parts.calibration << p1.dot(r1), p1.dot(r2), p1.dot(r3), 0, p2.dot(r2), p2.dot(r3), 0, 0, 1;
  // Rows of equal length make the pivots of the solution for C comparable.
  Eigen::Matrix<double, 3, 4> system = p;
  for (int i = 0; i < 2; ++i) system.row(i) /= p.row(i).head<3>().norm();
  const Eigen::FullPivLU<Eigen::Matrix3d> lu(Eigen::Matrix3d(system.leftCols<3>()));
  if (!system.allFinite() || !lu.isInvertible()) return std::nullopt;
  Eigen::Matrix3d rotation;
  rotation << r1.transpose(), r2.transpose(), r3.transpose();
  parts.pose = {Eigen::Quaterniond(rotation).normalized(), -lu.solve(system.col(3))};
  if (!parts.calibration.allFinite() || !parts.pose.centre.allFinite() || !rotation.allFinite()) return std::nullopt;
  return parts;
}

CameraMatrix camera_matrix(const CameraMatrixParts& parts) {
  CameraMatrix p;
  p.leftCols<3>() = parts.calibration * parts.pose.rotation.toRotationMatrix();
  p.col(3) = -(p.leftCols<3>() * parts.pose.centre);
  return p;
}

}  // namespace megablock
