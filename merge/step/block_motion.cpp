// With a = C - c the minimum of block_motion.h has separate equations for t, s and phi, because the sum of the a is
// zero:
//
//     t = mean d,    s = sum a.d / sum |a|^2,
//     (n I + sum (|a|^2 I - a a') / L^2) phi = sum a x d / L^2 - sum w.
//
// With L^2 = sum |a|^2 / n, rotations and positions have the same weight in phi. The tiles sum the moments about the
// ground origin, since the centroid of the block is not known before, and the sums are moved to it afterwards:
//
//     sum a a' = sum C C' - n c c',    sum a x d = sum C x d - n c x t,    sum a.d = sum C.d - n c.t.
#include "merge/step/block_motion.h"

#include <algorithm>

#include "geometry/numbers/decompositions.h"
#include "geometry/transform/rotation.h"
#include "merge/plan/unknowns.h"

namespace megablock {

namespace {

// The terms of one frame at C with the step x = (w, d), in the order of MotionSums::kSize.
MotionSums::Row row_of(const Eigen::Vector3d& c, const PoseIncrement& x) {
  const Eigen::Vector3d w = x.head<3>(), d = x.tail<3>();
  const Eigen::Matrix3d square = c * c.transpose();
  MotionSums::Row row;
  row << 1, c, Eigen::Map<const Eigen::Matrix<double, 9, 1>>(square.data()), d, w, c.cross(d), c.dot(d);
  return row;
}

// Finds the nearest similarity from the sums of all frames of a component.
BlockMotion motion_of(const MotionSums::Row& sums) {
  BlockMotion motion;
  const double frames = sums[0];
  if (frames == 0) return motion;
  motion.centre = sums.segment<3>(1) / frames;
  motion.shift = sums.segment<3>(13) / frames;
  const Eigen::Matrix3d scatter =
      Eigen::Map<const Eigen::Matrix3d>(sums.data() + 4) - frames * motion.centre * motion.centre.transpose();
  const Eigen::Vector3d moment = sums.segment<3>(19) - frames * motion.centre.cross(motion.shift);
  const double growth = sums[22] - frames * motion.centre.dot(motion.shift);
  const double spread = scatter.trace();
  // A single frame, or frames at one place, have no extent: the rotation then follows from the attitudes, and the scale
  // stays.
  const double squared_extent = spread > 0 ? spread / frames : 1;
  const Eigen::Matrix3d normal =
      (frames + spread / squared_extent) * Eigen::Matrix3d::Identity() - scatter / squared_extent;
  motion.rotation = solve_symmetric3(normal, moment / squared_extent - sums.segment<3>(16));
  if (spread > 0) motion.scale = growth / spread;
  return motion;
}

// Removes the components of the motion that would move held positions, and turns the rest about the pivot. The
// iterations themselves make the removed part of the motion. `movable` belongs to (phi, t, s) about the component's own
// centre, in extents; the motion is expressed so first.
BlockMotion allowed(const BlockComponent& component, const BlockMotion& motion) {
  if (component.movable == Matrix77::Identity()) return motion;
  Eigen::Matrix<double, 7, 1> parameters;
  parameters << motion.rotation, motion.tangent(component.centre) / component.extent, motion.scale;
  parameters = component.movable * parameters;
  BlockMotion result{component.centre, parameters.head<3>(), component.extent * parameters.segment<3>(3),
                     parameters[6]};
  result.shift = result.tangent(component.pivot);
  result.centre = component.pivot;
  return result;
}

void move_shared_parameters(const TileProblem& problem, const TilePlan& plan, const Step& step, TileState& next) {
  for (std::size_t row = 0; row < problem.cameras.size(); ++row) {
    const double* x = step.find({UnknownKind::kCamera, 0, problem.cameras[row].value});
    for (int k = 0; x != nullptr && k < next.cameras[row].size(); ++k)
      if (contains(plan.camera_free[row], k)) next.cameras[row][static_cast<std::size_t>(k)] += *x++;
  }
  for (std::size_t row = 0; row < problem.mounts.size(); ++row) {
    const MountId& id = problem.mounts[row];
    if (const double* x = step.find({UnknownKind::kMount, id.mount, id.rig.value}))
      next.mounts[row] = pose_update(next.mounts[row], Eigen::Map<const PoseIncrement>(x));
  }
}

}  // namespace

Bytes MotionSums::to_bytes() const {
  ByteWriter out;
  out.values(components);
  for (const Row& row : rows)
    for (double value : row) out.value(value);
  return out.take();
}

MotionSums MotionSums::from_bytes(const Bytes& bytes) {
  ByteReader in(bytes);
  MotionSums sums;
  sums.components = in.values<std::int64_t>();
  sums.rows.resize(sums.components.size());
  for (Row& row : sums.rows)
    for (double& value : row) value = in.value<double>();
  if (!in.at_end()) throw StoreError("merge: sums of a step have the wrong size");
  return sums;
}

MotionSums motion_sums(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                       const TileState& state, const Step& step) {
  MotionSums sums;
  sums.components = gauge.part_component[at(tile)];
  std::sort(sums.components.begin(), sums.components.end());
  sums.components.erase(std::unique(sums.components.begin(), sums.components.end()), sums.components.end());
  sums.rows.assign(sums.components.size(), MotionSums::Row::Zero());
  for (std::size_t f = 0; f < problem.frames.size(); ++f) {
    const UnknownId id{UnknownKind::kFrame, 0, problem.frames[f].value};
    if (plan.part_of_frame[f] < 0 || find_unknown(plan.owned, id) < 0) continue;
    const std::int64_t component = gauge.part_component[at(tile)][at(plan.part_of_frame[f])];
    const auto row = std::lower_bound(sums.components.begin(), sums.components.end(), component);
    sums.rows[at(row - sums.components.begin())] +=
        row_of(state.frames[f].centre, Eigen::Map<const PoseIncrement>(step.find(id)));
  }
  return sums;
}

std::vector<BlockMotion> block_motions(const BlockGauge& gauge, const std::vector<MotionSums>& tiles) {
  std::vector<MotionSums::Row> rows(gauge.components.size(), MotionSums::Row::Zero());
  for (const MotionSums& tile : tiles)
    for (std::size_t i = 0; i < tile.rows.size(); ++i) rows[at(tile.components[i])] += tile.rows[i];
  std::vector<BlockMotion> motions;
  for (std::size_t c = 0; c < rows.size(); ++c) motions.push_back(allowed(gauge.components[c], motion_of(rows[c])));
  return motions;
}

TileMotion::TileMotion(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                       const TileProblem& problem, const TilePlan& plan)
    : problem_(problem), plan_(plan) {
  for (std::int64_t component : gauge.part_component[at(tile)]) {
    const BlockMotion motion = motions.empty() ? BlockMotion() : motions[at(component)];
    movers_.push_back({motion, rotation_exp<double>(motion.rotation)});
  }
}

Pose TileMotion::Mover::pose(const Pose& before, PoseIncrement increment) const {
  // The rest of the step: a motion of the whole component has w = -phi.
  increment.head<3>() += motion.rotation;
  increment.tail<3>() -= motion.tangent(before.centre);
  Pose after = pose_update(before, increment);
  after.rotation = (after.rotation * turn.conjugate()).normalized();
  after.centre = moved(after.centre);
  return after;
}

TileState TileMotion::unknowns(const TileState& state, const Step& step) const {
  TileState next = state;
  for (std::size_t f = 0; f < problem_.frames.size(); ++f)
    if (plan_.part_of_frame[f] >= 0)
      next.frames[f] = movers_[at(plan_.part_of_frame[f])].pose(
          state.frames[f],
          Eigen::Map<const PoseIncrement>(step.find({UnknownKind::kFrame, 0, problem_.frames[f].value})));
  move_shared_parameters(problem_, plan_, step, next);
  return next;
}

const TileMotion::Mover& TileMotion::mover_of(std::int64_t point) const {
  return movers_[at(plan_.part_of_frame[at(frame_of_point(problem_, point))])];
}

TileState apply_step(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                     const TileProblem& problem, const TilePlan& plan, const TileState& state, const TileStep& step) {
  const TileMotion motion(gauge, motions, tile, problem, plan);
  TileState next = motion.unknowns(state, step.unknowns);
  for (const RowList& cell : plan.points)
    for (const std::int64_t p : cell.rows()) next.points[at(p)] = motion.point(state, p, step.points[at(p)]);
  return next;
}

}  // namespace megablock
