#include "adjust/terms/vertical_terms.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "geometry/camera/camera.h"

namespace megablock {

GroundVertical::GroundVertical(const GroundFrame& ground) {
  if (ground.georeferenced) georeference_.emplace(ground);
}

Eigen::Vector3d GroundVertical::down(const Eigen::Vector3d& place) const {
  const Eigen::Vector3d own = -Eigen::Vector3d::UnitZ();
  if (!georeference_) return own;
  return georeference_->own_from_block(georeference_->to_geodetic(place)).conjugate() * own;
}

TileProblem::VerticalTerm vertical_term(const SeenVertical& seen, const GroundVertical& ground,
                                        const Eigen::Vector3d& centre) {
  TileProblem::VerticalTerm term;
  term.ground = ground.down(centre);
  term.seen = seen.down;
  const Eigen::Matrix<double, 3, 2> plane = tangent_plane(seen.down);
  const Eigen::LLT<Eigen::Matrix2d> cholesky(plane.transpose() * seen.covariance * plane);
  term.weight = cholesky.matrixL().solve(plane.transpose());
  term.camera = seen.camera;
  term.by_camera = term.weight * seen.by_camera;
  return term;
}

void take_plumb_lines(const Block& block, const BlockState& places, TileProblem& problem) {
  if (problem.verticals.empty() && problem.lines.empty()) return;
  const GroundVertical ground(block.ground);
  const auto down = [&](LocalFrame frame) {
    return ground.down(places.frames[problem.frames[static_cast<std::size_t>(frame.value)]].centre);
  };
  for (TileProblem::VerticalTerm& term : problem.verticals)
    term.ground = down(problem.images[static_cast<std::size_t>(term.image.value)].frame);
  for (TileProblem::LineTerm& term : problem.lines) term.up = -down(term.frame);
}

VerticalResidual linearise_vertical(const Pose& frame, const Pose& mount, const Intrinsics& camera,
                                    const TileProblem::VerticalTerm& term) {
  constexpr double kOpposite = 1e-9;
  const Eigen::Matrix3d mount_rotation = mount.rotation.toRotationMatrix();
  const Eigen::Vector3d in_rig = frame.rotation * term.ground, down = mount_rotation * in_rig;
  const double sum = 1 + term.seen.dot(down), bounded = std::max(sum, kOpposite);
  const double stretch = std::sqrt(2 / bounded);
  const Eigen::Vector2d across = term.weight * down;
  VerticalResidual result;
  result.residual = stretch * across;
  if (term.camera.size() > 0)
    result.residual -=
        term.by_camera * (Eigen::Map<const Eigen::VectorXd>(camera.data(), term.camera.size()) - term.camera);
  Eigen::Matrix<double, 2, 3> by_down = stretch * term.weight;
  if (sum > kOpposite) by_down -= stretch / (2 * bounded) * across * term.seen.transpose();
  const Eigen::Matrix3d turned = mount_rotation * frame.rotation.toRotationMatrix();
  result.by_frame << -by_down * turned * skew(term.ground), Eigen::Matrix<double, 2, 3>::Zero();
  result.by_mount << -by_down * mount_rotation * skew(in_rig), Eigen::Matrix<double, 2, 3>::Zero();
  return result;
}

VerticalResidual linearise_vertical(const TileProblem& problem, const TileState& state,
                                    const TileProblem::VerticalTerm& term) {
  const TileImage& image = problem.images[static_cast<std::size_t>(term.image.value)];
  return linearise_vertical(state.frames[static_cast<std::size_t>(image.frame.value)],
                            state.mounts[static_cast<std::size_t>(image.mount)],
                            state.cameras[static_cast<std::size_t>(image.camera.value)], term);
}

}  // namespace megablock
