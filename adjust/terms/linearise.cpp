// Puts the derivatives of linearise.h together for a single observation. The kernels of adjust/lanes compute the same
// for many observations at once, with the same formulas.
#include "adjust/terms/linearise.h"

namespace megablock {

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

Eigen::Vector2d image_difference_px(const TileProblem& problem, const TileState& state, std::int64_t point,
                                    std::int64_t row) {
  const TileImage& image = problem.images[problem.image[row].value];
  return reprojection(state.cameras[image.camera.value],
                      to_camera(state.frames[image.frame.value], state.mounts[image.mount], state.points[point]),
                      {problem.x[row], problem.y[row]});
}

}  // namespace megablock
