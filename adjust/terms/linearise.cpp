// Derivatives of what is no image observation (those are in the header):
//
//   C + R' l:                   by w: [R' l]x (as Exp(-w) R' l),  by d: I
//   Log(R Exp(w) R_0') = Log(E Exp(R_0 w)),  E = R R_0':  by w: J_r^-1(Log E) R_0
//   E = R_to R_from' R_m':      by w_to: J_r^-1(Log E) R_m R_from,  by w_from: the negative of it
#include "adjust/terms/linearise.h"

#include <limits>

namespace megablock {

namespace {

Eigen::Matrix3d skew3(const Eigen::Vector3d& v) { return skew<double>(v); }

// Log(R R_0') and its derivative by the right perturbation of R.
struct RotationDifference {
  Eigen::Vector3d value;
  Eigen::Matrix3d by_rotation;
};
RotationDifference rotation_difference(const Eigen::Quaterniond& rotation, const Eigen::Quaterniond& reference) {
  const Eigen::Vector3d value = rotation_log<double>(rotation * reference.conjugate());
  return {value, right_jacobian_inverse(value) * reference.toRotationMatrix()};
}

}  // namespace

std::vector<ImageView> image_views(const TileProblem& problem, const TileState& state) {
  std::vector<ImageView> views;
  views.reserve(problem.images.size());
  for (const TileImage& image : problem.images)
    views.emplace_back(state.frames[image.frame.value], state.mounts[image.mount], state.cameras[image.camera.value]);
  return views;
}

ImageResidual linearise_image(const Pose& frame, const Pose& mount, const Intrinsics& intrinsics,
                              const Eigen::Vector3d& point, const Eigen::Vector2d& measured, double inverse_sigma) {
  const ImageView view(frame, mount, intrinsics);
  CameraResidual r;
  ImageResidual result;
  result.in_front = linearise_in_camera(view, point, measured, inverse_sigma, true, r);
  if (!result.in_front) return result;
  result.residual = r.residual;
  result.by_point = r.by_camera * view.rotation;
  result.by_frame = by_pose(result.by_point, r.from_frame);
  result.by_mount = by_mount(view, r);
  result.by_intrinsics = r.by_intrinsics;
  return result;
}

FrameResidual3 linearise_position(const Pose& frame, const PositionPrior& prior) {
  const Eigen::Vector3d arm = frame.rotation.conjugate() * prior.lever_arm;
  const Eigen::Vector3d weight = prior.sigma.cwiseInverse();
  FrameResidual3 result;
  result.residual = weight.cwiseProduct(frame.centre - prior.position + arm);
  result.by_frame << weight.asDiagonal() * skew3(arm), Eigen::Matrix3d(weight.asDiagonal());
  return result;
}

FrameResidual3 linearise_attitude(const Pose& frame, const AttitudePrior& prior) {
  const Eigen::Vector3d weight = prior.sigma_rad.cwiseInverse();
  const RotationDifference difference = rotation_difference(frame.rotation, prior.rotation_cw);
  FrameResidual3 result;
  result.residual = weight.cwiseProduct(difference.value);
  result.by_frame << weight.asDiagonal() * difference.by_rotation, Eigen::Matrix3d::Zero();
  return result;
}

RelativeResidual linearise_relative(const Pose& from, const Pose& to, const TileProblem::RelativeTerm& term) {
  const Eigen::Matrix3d from_rotation = from.rotation.toRotationMatrix();
  const double rotation_weight = 1 / term.rotation_sigma_rad, position_weight = 1 / term.position_sigma_m;
  const Eigen::Vector3d base = to.centre - from.centre;
  const Eigen::Vector3d rotation = rotation_log<double>(to.rotation * (term.pose.rotation * from.rotation).conjugate());
  const Eigen::Matrix3d by_rotation =
      rotation_weight * right_jacobian_inverse(rotation) * term.pose.rotation.toRotationMatrix() * from_rotation;

  RelativeResidual result;
  result.residual << rotation_weight * rotation, position_weight * (from_rotation * base - term.pose.centre);
  result.by_from.setZero();
  result.by_to.setZero();
  result.by_to.topLeftCorner<3, 3>() = by_rotation;
  result.by_from.topLeftCorner<3, 3>() = -by_rotation;
  result.by_to.bottomRightCorner<3, 3>() = position_weight * from_rotation;
  result.by_from.bottomLeftCorner<3, 3>() = -position_weight * from_rotation * skew3(base);
  result.by_from.bottomRightCorner<3, 3>() = -position_weight * from_rotation;
  return result;
}

MountResidual linearise_mount(const Pose& mount, const TileProblem::MountTerm& term) {
  const double rotation_weight = 1 / term.rotation_sigma_rad, position_weight = 1 / term.position_sigma_m;
  const RotationDifference difference = rotation_difference(mount.rotation, term.value.rotation);
  MountResidual result;
  result.residual << rotation_weight * difference.value, position_weight * (mount.centre - term.value.centre);
  result.by_mount.setZero();
  result.by_mount.topLeftCorner<3, 3>() = rotation_weight * difference.by_rotation;
  result.by_mount.bottomRightCorner<3, 3>() = position_weight * Eigen::Matrix3d::Identity();
  return result;
}

Eigen::Vector2d image_difference_px(const TileProblem& problem, const TileState& state, std::int64_t point,
                                    std::int64_t row) {
  const TileImage& image = problem.images[problem.image[row].value];
  return reprojection(state.cameras[image.camera.value],
                      to_camera(state.frames[image.frame.value], state.mounts[image.mount], state.points[point]),
                      {problem.x[row], problem.y[row]});
}

}  // namespace megablock
