// With E = R_to (R_m R_from)' the angle |Log E| says how far a relative pose is contradicted. Frames that fulfilled
// relative poses join form groups. A contradicted relative pose between two groups predicts the pose of its frame in
// the smaller group from the larger one, and the movement of the ground
//
//     X -> C_after + T (X - C_before),   T = R_after' R_before,   R -> R T',
//
// brings the whole group along.
#include "adjust/orientation/turned_stretches.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "geometry/transform/rotation.h"

namespace megablock {

namespace {

std::size_t row_of(FrameIndex frame) { return static_cast<std::size_t>(frame.value); }

// The pose of `to` that fulfils the relative pose with the given pose of `from`, and the reverse: R_to = R_m R_from,
// C_to = C_from + R_from'T.
Pose predicted_to(const RelativePose& relative, const Pose& from) {
  return {relative.pose.rotation * from.rotation, from.centre + from.rotation.conjugate() * relative.pose.centre};
}
Pose predicted_from(const RelativePose& relative, const Pose& to) {
  const Eigen::Quaterniond rotation = relative.pose.rotation.conjugate() * to.rotation;
  return {rotation, to.centre - rotation.conjugate() * relative.pose.centre};
}

double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return rotation_log<double>(a * b.conjugate()).norm();
}

// The movement of the ground that brings a frame from one pose to another.
struct Movement {
  Eigen::Quaterniond turn;
  Eigen::Vector3d from, to;
  Movement(const Pose& before, const Pose& after)
      : turn(after.rotation.conjugate() * before.rotation), from(before.centre), to(after.centre) {}
  Pose operator()(const Pose& pose) const {
    return {(pose.rotation * turn.conjugate()).normalized(), to + turn * (pose.centre - from)};
  }
};

class StretchTurner {
 public:
  StretchTurner(const Block& block, const BlockState& initial, BlockState& state, const StretchOptions& options)
      : block_(block), initial_(initial), state_(state), options_(options), group_(block.frames.size()) {}

  std::int64_t run() {
    join_agreeing();
    // The relative poses are visited in their order. A group that was moved joins the one to which it was moved, so
    // that others may follow.
    std::int64_t moved = 0;
    for (bool again = true; again;) {
      again = false;
      for (const RelativePose& relative : block_.relative_poses)
        if (const std::int64_t frames = try_to_move(relative); frames > 0) {
          moved += frames;
          again = true;
        }
    }
    return moved;
  }

 private:
  bool both_oriented(const RelativePose& relative) const {
    return state_.oriented[relative.from] && state_.oriented[relative.to];
  }

  // Both limits must be exceeded: many sigmas, and an angle that no adjustment leaves by noise.
  bool contradicted(const RelativePose& relative) const {
    const double angle = angle_between(state_.frames[relative.to].rotation,
                                       relative.pose.rotation * state_.frames[relative.from].rotation);
    return angle > options_.max_rotation_rad && angle > options_.max_sigmas * relative.rotation_sigma_rad;
  }

  std::size_t find(std::size_t frame) {
    while (group_[frame] != frame) frame = group_[frame] = group_[group_[frame]];
    return frame;
  }
  void join(std::size_t a, std::size_t b) {
    a = find(a), b = find(b);
    if (a == b) return;
    // The smaller list is appended to the larger one, so that every frame is copied at most log2(n) times.
    if (members_[a].size() < members_[b].size()) std::swap(a, b);
    group_[b] = a;
    members_[a].insert(members_[a].end(), members_[b].begin(), members_[b].end());
    members_[b] = {};
  }

  void join_agreeing() {
    std::iota(group_.begin(), group_.end(), std::size_t{0});
    for (std::size_t f = 0; f < group_.size(); ++f) members_.push_back({FrameIndex(static_cast<std::int64_t>(f))});
    for (const RelativePose& relative : block_.relative_poses)
      if (both_oriented(relative) && !contradicted(relative)) join(row_of(relative.from), row_of(relative.to));
  }

  // Median angle between a group, moved or not, and its initial orientation.
  template <typename Move>
  double distance(const std::vector<FrameIndex>& frames, Move&& move) const {
    std::vector<double> angles;
    for (const FrameIndex frame : frames)
      angles.push_back(angle_between(move(state_.frames[frame]).rotation, initial_.frames[frame].rotation));
    const auto middle = angles.begin() + static_cast<std::ptrdiff_t>(angles.size() / 2);
    std::nth_element(angles.begin(), middle, angles.end());
    return *middle;
  }

  // Whether a group has observed positions and stays at them: its median distance is within their sigmas, or grows by
  // no more than half.
  bool keeps_positions(const std::vector<FrameIndex>& frames, const Movement& movement) const {
    constexpr double kAllowed = 3;  // sigmas, median
    std::vector<double> before, after;
    for (const FrameIndex frame : frames) {
      const auto& prior = block_.frames[frame].position_prior;
      if (!prior) continue;
      const auto sigmas = [&](const Pose& pose) {
        const Eigen::Vector3d antenna = pose.centre + pose.rotation.conjugate() * prior->lever_arm;
        return (antenna - prior->position).cwiseQuotient(prior->sigma).norm();
      };
      before.push_back(sigmas(state_.frames[frame]));
      after.push_back(sigmas(movement(state_.frames[frame])));
    }
    if (before.empty()) return false;
    const auto median = [](std::vector<double>& values) {
      const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
      std::nth_element(values.begin(), middle, values.end());
      return *middle;
    };
    return median(after) <= std::max(kAllowed, 1.5 * median(before));
  }

  // Moves the smaller group so that the relative pose is fulfilled, and returns the number of frames moved. It is 0 if
  // the relative pose is fulfilled already, if the move would not halve the angle to the initial orientation, or if it
  // would take the group away from its positions.
  std::int64_t try_to_move(const RelativePose& relative) {
    if (!both_oriented(relative) || find(row_of(relative.from)) == find(row_of(relative.to)) || !contradicted(relative))
      return 0;
    // The larger group is more likely right: most frames are not turned.
    const bool move_to = members_[find(row_of(relative.to))].size() <= members_[find(row_of(relative.from))].size();
    const FrameIndex frame = move_to ? relative.to : relative.from;
    const Pose& before = state_.frames[frame];
    const Pose after = move_to ? predicted_to(relative, state_.frames[relative.from])
                               : predicted_from(relative, state_.frames[relative.to]);
    const Movement movement(before, after);
    const std::vector<FrameIndex>& frames = members_[find(row_of(frame))];
    const auto stay = [](const Pose& pose) { return pose; };
    // The initial orientation knows nothing of the adjustment that turned the stretch, and is good to some degrees. It
    // confirms a true turn by tens of degrees, and does not confirm a wrong relative pose.
    if (distance(frames, movement) > 0.5 * distance(frames, stay) || !keeps_positions(frames, movement)) return 0;
    for (const FrameIndex member : frames) state_.frames[member] = movement(state_.frames[member]);
    const auto count = static_cast<std::int64_t>(frames.size());
    join(row_of(relative.from), row_of(relative.to));
    return count;
  }

  const Block& block_;
  const BlockState& initial_;
  BlockState& state_;
  const StretchOptions& options_;
  std::vector<std::size_t> group_;                // [frames] towards the group's representative
  std::vector<std::vector<FrameIndex>> members_;  // of representatives
};

}  // namespace

std::int64_t turn_back_stretches(const Block& block, const BlockState& initial, BlockState& state,
                                 const StretchOptions& options) {
  if (block.relative_poses.empty()) return 0;
  return StretchTurner(block, initial, state, options).run();
}

}  // namespace megablock
