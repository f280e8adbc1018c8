#include "cluster/stages/common/problem_hash.h"

#include "cluster/stages/common/block_hash.h"

namespace megablock {

namespace {

void add_tables(Hasher& hasher, const TileProblem& p) {
  hasher.add(p.frames).add(p.cameras).add(p.camera_free).add(p.mount_free).add(p.mounts.size());
  for (const MountId& mount : p.mounts) hasher.add(mount.rig.value).add(mount.mount);
  hasher.add(p.images.size());
  for (const TileImage& image : p.images)
    hasher.add(image.image.value).add(image.frame.value).add(image.camera.value).add(image.mount);
  for (const TilePoint& point : p.points) hasher.add(point.role);
  hasher.add(p.begin).add(p.image).add(p.x).add(p.y).add(p.inverse_sigma).add(p.kept).add(p.image_sigma_px);
}

void add_frame_terms(Hasher& hasher, const TileProblem& p) {
  hasher.add(p.positions.size()).add(p.attitudes.size()).add(p.relatives.size());
  const auto add_prior = [&](const auto& term) {
    add_to_hash(hasher.add(term.frame.value), term.prior);
    if (term.receiver >= 0) hasher.add(term.receiver);
  };
  for (const auto& term : p.positions) add_prior(term);
  for (const auto& term : p.attitudes) add_prior(term);
  for (const auto& term : p.relatives) {
    hasher.add(term.from.value).add(term.to.value).add(term.rotation_sigma_rad).add(term.position_sigma_m);
    add_to_hash(hasher, term.pose);
  }
}

void add_other_terms(Hasher& hasher, const TileProblem& p) {
  hasher.add(p.point_priors.size()).add(p.intrinsic_priors.size()).add(p.mount_priors.size());
  for (const auto& term : p.point_priors) {
    add_to_hash(hasher.add(term.point.value), term.position);
    add_to_hash(hasher, term.sigma);
  }
  for (const auto& term : p.intrinsic_priors) {
    hasher.add(term.camera.value);
    add_to_hash(hasher, term.value);
    for (const double value : term.sigma) hasher.add(value);
  }
  for (const auto& term : p.mount_priors) {
    hasher.add(term.mount).add(term.rotation_sigma_rad).add(term.position_sigma_m);
    add_to_hash(hasher, term.value);
  }
  hasher.add(p.lines.size());
  for (const auto& term : p.lines) {
    hasher.add(term.frame.value).add(term.other.value).add(term.weight);
    for (const Eigen::Vector3d& v : {term.middle, term.across, term.other_normal, term.up}) add_to_hash(hasher, v);
  }
  hasher.add(p.verticals.size());
  for (const auto& term : p.verticals) {
    hasher.add(term.image.value);
    for (const Eigen::Vector3d& v : {term.ground, term.seen}) add_to_hash(hasher, v);
    for (const double value : term.weight.reshaped()) hasher.add(value);
    hasher.add(term.camera.size());
    for (const double value : term.camera) hasher.add(value);
    for (const double value : term.by_camera.reshaped()) hasher.add(value);
  }
  for (const auto& [key, rows] : p.measured) {
    hasher.add(key).add(rows.size());
    for (const auto& term : rows) hasher.add(term.from.value).add(term.to.value).add(term.value).add(term.sigma);
  }
  for (const RobustLoss& loss :
       {p.image_loss, p.position_loss, p.control_loss, p.attitude_loss, p.relative_loss, p.line_loss, p.vertical_loss})
    hasher.add(loss.kind).add(loss.scale);
}

}  // namespace

void add_to_hash(Hasher& hasher, const TileProblem& problem, const TileState& start) {
  add_tables(hasher, problem);
  add_frame_terms(hasher, problem);
  add_other_terms(hasher, problem);
  for (const Pose& pose : start.frames) add_to_hash(hasher, pose);
  for (const Intrinsics& camera : start.cameras) add_to_hash(hasher, camera);
  for (const Pose& pose : start.mounts) add_to_hash(hasher, pose);
}

}  // namespace megablock
