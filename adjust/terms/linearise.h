// Linearises single residuals analytically. merge/ condenses them, and tests compare them with automatic
// differentiation. All residuals and Jacobians are divided by sigma; the caller applies the robust weights.
//
// Derivatives by the right perturbation R Exp(w) (geometry/transform/rotation.h), C + d:
//
//   X_rig = R (X - C):          by w: -R [X - C]x,   by d: -R,          by X: R
//   X_cam = R_m (X_rig - C_m):  by w_m: -R_m [X_rig - C_m]x,  by d_m: -R_m,  by X_rig: R_m
//
// The derivative of a residual by X_cam therefore gives all those by poses and point.
#pragma once

#include "adjust/problem/tile_problem.h"
#include "geometry/camera/camera.h"

namespace megablock {

// The values that all observations of an image share: X_cam = R (X - C) - t with R = R_m R_f, t = R_m C_m. The struct
// is aligned, so that an observation with a held mount reads two cache lines.
struct alignas(64) ImageView {
  Eigen::Matrix3d rotation;        // ground -> camera
  Eigen::Vector3d centre;          // of the frame
  Eigen::Vector3d shift;           // t
  const Intrinsics* intrinsics;    // outlives the view
  Eigen::Matrix3d mount_rotation;  // rig -> camera
  ImageView(const Pose& frame, const Pose& mount, const Intrinsics& camera)
      : centre(frame.centre), intrinsics(&camera), mount_rotation(mount.rotation.toRotationMatrix()) {
    rotation = mount_rotation * frame.rotation.toRotationMatrix();
    shift = mount_rotation * mount.centre;
  }
  Eigen::Vector3d in_camera(const Eigen::Vector3d& from_frame) const { return rotation * from_frame - shift; }
  // Adjusted minus measured position, pixels; NaN where the camera cannot project the point.
  Eigen::Vector2d difference_px(const Eigen::Vector3d& point, const Eigen::Vector2d& measured) const {
    return reprojection(*intrinsics, in_camera(point - centre), measured);
  }
};
// One view for each image of the problem, [images]. The views refer to the cameras of `state`.
std::vector<ImageView> image_views(const TileProblem& problem, const TileState& state);  // [images]

// The residual of an image observation, with the derivatives from which all others follow.
struct CameraResidual {
  Eigen::Vector3d from_frame, in_camera;  // X - C, X_cam
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 3> by_camera;  // by X_cam
  IntrinsicJacobian by_intrinsics;        // if asked for
};
// Returns false where the camera cannot project the point; the result is then undefined.
inline bool linearise_in_camera(const ImageView& view, const Eigen::Vector3d& point, const Eigen::Vector2d& measured,
                                double inverse_sigma, bool with_intrinsics, CameraResidual& result) {
  const Intrinsics& k = *view.intrinsics;
  result.from_frame = point - view.centre;
  result.in_camera = view.in_camera(result.from_frame);
  const auto take = [&](const ProjectionJacobian& projection) {
    result.residual = inverse_sigma * pixel_difference(k, projection.pixel, measured);
    result.by_camera = inverse_sigma * projection.by_point;
    if (with_intrinsics) result.by_intrinsics = inverse_sigma * projection.by_intrinsics;
  };
  // Brown's model has by far the most observations. Its own function is inlined here; the table of the models is asked
  // for the others only.
  if (k.model().kind == CameraModelKind::kBrown) {
    ProjectionJacobian projection;
    if (!BrownModel::linearise(k.data(), result.in_camera, with_intrinsics, projection)) return false;
    take(projection);
  } else {
    const ProjectionJacobian projection = project_with_jacobian(k, result.in_camera);
    if (!projection.valid) return false;
    take(projection);
  }
  return true;
}
// The derivative by a pose (rotation, centre) from that by X, with u = X - C: -J [u]x = (u x rows of J), -J.
inline Eigen::Matrix<double, 2, 6> by_pose(const Eigen::Matrix<double, 2, 3>& by_point, const Eigen::Vector3d& u) {
  Eigen::Matrix<double, 2, 6> result;
  for (int i = 0; i < 2; ++i) result.row(i) << u.cross(by_point.row(i).transpose()).transpose(), -by_point.row(i);
  return result;
}
// The mount sees the point of the rig from its own centre: u = X_rig - C_m = R_m' X_cam, and the derivative by X_rig is
// J R_m with J that by X_cam.
inline Eigen::Matrix<double, 2, 6> by_mount(const ImageView& view, const CameraResidual& r) {
  return by_pose(r.by_camera * view.mount_rotation, view.mount_rotation.transpose() * r.in_camera);
}

struct ImageResidual {
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 6> by_frame;
  Eigen::Matrix<double, 2, 6> by_mount;
  IntrinsicJacobian by_intrinsics;
  Eigen::Matrix<double, 2, 3> by_point;
  // Whether the camera can project the point. Otherwise the rest is undefined, and the observation must not take part.
  bool in_front = false;
};
ImageResidual linearise_image(const Pose& frame, const Pose& mount, const Intrinsics& intrinsics,
                              const Eigen::Vector3d& point, const Eigen::Vector2d& measured, double inverse_sigma);

// Adjusted minus measured position of an observation (a row of the problem) of a point, pixels; NaN where the camera
// cannot project the point.
Eigen::Vector2d image_difference_px(const TileProblem& problem, const TileState& state, std::int64_t point,
                                    std::int64_t row);

struct FrameResidual3 {
  Eigen::Vector3d residual;
  Eigen::Matrix<double, 3, 6> by_frame;
};
// The residuals of observed positions and attitudes, with the derivatives by (w, d) of the frame: position_terms.cpp
// and attitude_terms.cpp.
FrameResidual3 linearise_position(const Pose& frame, const PositionPrior& prior);
FrameResidual3 linearise_attitude(const Pose& frame, const AttitudePrior& prior);
// The prior of a term as the receiver corrects it (io/block/observed_poses.h).
PositionPrior prior_of(const TileProblem::PositionTerm& term, const TileState& state);
AttitudePrior prior_of(const TileProblem::AttitudeTerm& term, const TileState& state);

struct RelativeResidual {
  Eigen::Matrix<double, 6, 1> residual;
  Eigen::Matrix<double, 6, 6> by_from, by_to;
};
// Rotation (3), then base (3): relative_terms.cpp.
RelativeResidual linearise_relative(const Pose& from, const Pose& to, const TileProblem::RelativeTerm& term);

struct MountResidual {
  Eigen::Matrix<double, 6, 1> residual;
  Eigen::Matrix<double, 6, 6> by_mount;
};
// Rotation (3), then centre (3): mount_priors.cpp.
MountResidual linearise_mount(const Pose& mount, const TileProblem::MountTerm& term);

// The residuals of priors that are linear in their unknowns; their derivative is the inverse sigma. Axes with infinite
// sigma and parameters without a finite positive sigma give zero.
inline Eigen::Vector3d point_prior_residual(const Eigen::Vector3d& point, const TileProblem::PointTerm& term) {
  return (point - term.position).cwiseQuotient(term.sigma);
}
inline double intrinsic_prior_residual(const Intrinsics& value, const TileProblem::IntrinsicTerm& term, int parameter) {
  const auto k = static_cast<std::size_t>(parameter);
  return intrinsic_prior_weight(term, parameter) * (value[k] - term.value[k]);
}

}  // namespace megablock
