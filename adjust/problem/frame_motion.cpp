#include "adjust/problem/frame_motion.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace megablock {

namespace {

constexpr double kLongestLegS = 30;       // frames farther apart in time say little of the motion
constexpr double kLongPathS = 20;         // of whole seconds, half on each side: timed to some per cent
constexpr double kSharpestTurnCos = 0.5;  // of 60 degrees

bool same_line(const Frame& a, const Frame& b) { return a.rig == b.rig && a.pass == b.pass; }

Eigen::Vector3d smaller_of(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  Eigen::Vector3d result;
  for (int i = 0; i < 3; ++i) result[i] = a[i] * b[i] <= 0 ? 0 : std::abs(a[i]) < std::abs(b[i]) ? a[i] : b[i];
  return result;
}

}  // namespace

// A straight way between two frames that follow one another.
struct FramePaths::Leg {
  FrameIndex other;     // the farther of the two frames
  Eigen::Vector3d way;  // forward in time, metres
  double time_s;        // positive
  double length() const { return way.norm(); }
};

FramePaths::FramePaths(const Block& block)
    : block_(&block), row_(block.frames.size(), -1), in_seconds_(block.rigs.size(), std::uint8_t{1}) {
  for (FrameIndex f(0); block.frames.contains(f); ++f.value) {
    const Frame& frame = block.frames[f];
    if (!std::isfinite(frame.time_s)) continue;
    order_.push_back(f);
    if (frame.time_s != std::floor(frame.time_s)) in_seconds_[frame.rig] = 0;
  }
  const auto key = [&](FrameIndex f) {
    const Frame& frame = block.frames[f];
    return std::tuple(frame.rig, frame.pass, frame.time_s, f);
  };
  std::sort(order_.begin(), order_.end(), [&](FrameIndex a, FrameIndex b) { return key(a) < key(b); });
  for (std::size_t r = 0; r < order_.size(); ++r) row_[order_[r]] = static_cast<std::int64_t>(r);
}

// The ways from the frame along its path in one direction of time (-1, +1), as far as it goes on without a gap or a
// sharp turn: one leg where times are exact, half of a long path where they are whole seconds.
std::vector<FramePaths::Leg> FramePaths::legs(FrameIndex frame, int direction, const PoseOf& pose_of) const {
  std::vector<Leg> path;
  const double wanted_s = in_seconds_[block_->frames[frame].rig] ? kLongPathS / 2 : 0;
  double time_s = 0;
  FrameIndex from = frame;
  for (std::int64_t row = row_[frame] + direction; row >= 0 && row < std::ssize(order_); row += direction) {
    const FrameIndex to = order_[static_cast<std::size_t>(row)];
    const double leg_s = std::abs(block_->frames[to].time_s - block_->frames[from].time_s);
    if (!same_line(block_->frames[frame], block_->frames[to]) || leg_s > kLongestLegS) break;
    if (leg_s == 0 || pose_of(to) == nullptr) continue;
    const Eigen::Vector3d way = direction * (pose_of(to)->centre - pose_of(from)->centre);
    if (!path.empty() && way.dot(path.back().way) < kSharpestTurnCos * way.norm() * path.back().length()) break;
    path.push_back({to, way, leg_s});
    from = to;
    if ((time_s += leg_s) >= wanted_s) break;
  }
  return path;
}

std::optional<Motion> FramePaths::motion(FrameIndex frame, const PoseOf& pose_of) const {
  if (row_[frame] < 0 || pose_of(frame) == nullptr) return std::nullopt;
  std::vector<Leg> before = legs(frame, -1, pose_of), after = legs(frame, 1, pose_of);
  if (before.empty() && after.empty()) return std::nullopt;
  if (!before.empty() && !after.empty()) {
    const Leg &b = before.front(), &a = after.front();
    if (b.way.dot(a.way) < kSharpestTurnCos * b.length() * a.length()) (a.time_s < b.time_s ? before : after).clear();
  }
  if (in_seconds_[block_->frames[frame].rig]) {
    double length = 0, time_s = 0;
    for (const auto* path : {&before, &after})
      for (const Leg& leg : *path) length += leg.length(), time_s += leg.time_s;
    if (length == 0) return Motion();
    for (auto* path : {&before, &after})
      for (Leg& leg : *path) leg.time_s = std::max(leg.length(), 1e-9 * length) * time_s / length;
  }
  const auto velocity = [](const Leg& leg) -> Eigen::Vector3d { return leg.way / leg.time_s; };
  if (before.empty()) return Motion{velocity(after.front()), Eigen::Vector3d::Zero()};
  if (after.empty()) return Motion{velocity(before.front()), Eigen::Vector3d::Zero()};

  const Leg &b = before.front(), &a = after.front();
  const double both_s = b.time_s + a.time_s;
  Motion motion;
  motion.velocity = (a.time_s * velocity(b) + b.time_s * velocity(a)) / both_s;
  if (b.length() == 0 || a.length() == 0) return motion;
  // The directions of the legs are those in their middles, half of both times apart.
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(b.way, a.way);
  const Eigen::Vector3d of_path = rotation_log<double>(turn) / (0.5 * both_s);
  const auto turned = [&](FrameIndex from, FrameIndex to, double time_s) -> Eigen::Vector3d {
    return -rotation_log<double>(pose_of(from)->rotation.conjugate() * pose_of(to)->rotation) / time_s;
  };
  motion.turn = smaller_of(of_path, smaller_of(turned(b.other, frame, b.time_s), turned(frame, a.other, a.time_s)));
  return motion;
}

std::optional<FramePaths> paths_for_rolling_shutters(const Block& block) {
  const bool any =
      std::any_of(block.cameras.begin(), block.cameras.end(), [](const Camera& c) { return c.readout_s != 0; });
  return any ? std::optional<FramePaths>(block) : std::nullopt;
}

}  // namespace megablock
