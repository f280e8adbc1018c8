// Eliminates a chain of n frames, in the notation of given_trajectories.h. With y_k the right side and x_k the step of
// frame k (six numbers), frame k is eliminated when the equations of the frames before it have been added:
//
//     carried:     S_k and y_k                           (`normal`, `right`)
//     eliminated:  s_k = S_k^-1 y_k,  B_k = S_k^-1 C_k   (`solved`, `by_next`)
//     next:        S_k+1 = D_k+1 - C_k' B_k,  y_k+1 = b_k+1 - C_k' s_k
//     back:        x_k = s_k - B_k x_k+1
//
// s_k and B_k take 42 numbers a frame. They are kept for one piece of 256 frames only; on the way back each piece is
// eliminated again from the equations carried to its beginning. The price is one more elimination.
#include "adjust/orientation/given_trajectories.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <optional>
#include <vector>

#include "adjust/terms/linearise.h"
#include "io/block/observed_poses.h"

namespace megablock {

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Cauchy's loss with the scale of the other losses: three sigmas.
constexpr RobustLoss kForgetting{RobustLoss::Kind::kCauchy, 3};
constexpr std::ptrdiff_t kNone = -1;

// Frames in their order, and the rows of Block::relative_poses between them.
struct Trajectory {
  std::vector<FrameIndex> frames;
  std::vector<std::size_t> ties;  // [frames - 1]
};

// The rows that tie a frame to its neighbours in its trajectory: none, one (an end) or two.
struct Neighbours {
  std::array<std::ptrdiff_t, 2> row{kNone, kNone};
  bool full() const { return row[1] != kNone; }
  void add(std::size_t tie) { row[row[0] == kNone ? 0 : 1] = static_cast<std::ptrdiff_t>(tie); }
  std::ptrdiff_t other_than(std::ptrdiff_t tie) const { return row[0] == tie ? row[1] : row[0]; }
};

IndexedVector<FrameIndex, Neighbours> neighbours_of(const Block& block, const BlockState& state) {
  std::vector<std::size_t> order(block.relative_poses.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto apart = [&](std::size_t row) {
    return std::abs(block.relative_poses[row].to.value - block.relative_poses[row].from.value);
  };
  // Frames of one pass are neighbours in the block's order. Ties to a nearer frame are therefore the odometry, and ties
  // to a frame far away are closures, which the chain cannot hold.
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return apart(a) < apart(b); });
  IndexedVector<FrameIndex, Neighbours> neighbours(block.frames.size(), Neighbours());
  for (const std::size_t row : order) {
    const RelativePose& tie = block.relative_poses[row];
    if (tie.from == tie.to || !state.oriented[tie.from] || !state.oriented[tie.to]) continue;
    Neighbours &from = neighbours[tie.from], &to = neighbours[tie.to];
    if (from.full() || to.full()) continue;
    from.add(row);
    to.add(row);
  }
  return neighbours;
}

// The trajectory from its end `first` to the other end, or once around a ring that contains `first`.
Trajectory follow(const Block& block, const IndexedVector<FrameIndex, Neighbours>& neighbours, FrameIndex first) {
  Trajectory trajectory;
  trajectory.frames.push_back(first);
  for (std::ptrdiff_t row = neighbours[first].row[0]; row != kNone;) {
    const RelativePose& tie = block.relative_poses[static_cast<std::size_t>(row)];
    const FrameIndex next = tie.from == trajectory.frames.back() ? tie.to : tie.from;
    if (next == first) break;
    trajectory.ties.push_back(static_cast<std::size_t>(row));
    trajectory.frames.push_back(next);
    row = neighbours[next].other_than(row);
  }
  return trajectory;
}

// How well a trajectory agrees with one kind of observation.
struct Agreement {
  double squares = 0;
  std::int64_t components = 0;
  void add(double squared_norm, int count) {
    // The loss damps outliers: a few wrong positions do not make a good trajectory worth adjusting.
    squares += kForgetting.evaluate(squared_norm)[0];
    components += count;
  }
  double mean() const { return components > 0 ? squares / static_cast<double>(components) : 0; }
};

class TrajectoryAdjuster {
 public:
  TrajectoryAdjuster(const Block& block, const ObservationOptions& use, const Trajectory& trajectory,
                     std::vector<Pose> poses)
      : block_(block), use_(use), trajectory_(trajectory), poses_(std::move(poses)), trial_(poses_) {}

  const std::vector<Pose>& poses() const { return poses_; }
  bool observed() const {
    return std::ranges::any_of(trajectory_.frames, [&](FrameIndex f) { return position(f) || attitude(f); });
  }
  // The mean square of the kind of observation that agrees worst.
  double mean_square() const {
    Agreement of_position, of_attitude, of_tie;
    for (std::size_t k = 0; k < poses_.size(); ++k) {
      const FrameIndex frame = trajectory_.frames[k];
      if (const auto prior = position(frame))
        of_position.add(linearise_position(poses_[k], *prior).residual.squaredNorm(), 3);
      if (const auto prior = attitude(frame))
        of_attitude.add(linearise_attitude(poses_[k], *prior).residual.squaredNorm(), 3);
      if (k + 1 < poses_.size()) of_tie.add(tie_at(k).residual.squaredNorm(), 6);
    }
    return std::max({of_position.mean(), of_attitude.mean(), of_tie.mean()});
  }

  // Iterates with least squares until the cost no longer falls, then with the loss. The loss alone would treat the
  // drift of the given poses as outliers.
  void run() {
    constexpr int kMostSteps = 8;  // of each
    for (const RobustLoss& loss : {RobustLoss(), kForgetting}) {
      double cost = cost_of(poses_, loss);
      for (int step = 0; step < kMostSteps; ++step) {
        solve(loss);
        const double next = cost_of(trial_, loss);
        // A step that does not lower the cost is not taken. The poses stay as they are.
        if (!(next < cost)) break;
        std::swap(poses_, trial_);
        if (next > 0.999 * cost) break;
        cost = next;
      }
    }
  }

 private:
  // Normal equations that the eliminated frames leave on the next one.
  struct Carried {
    Matrix6 normal = Matrix6::Zero();
    Vector6 right = Vector6::Zero();
  };
  // An eliminated frame. Its step is solved - by_next * (step of the next frame).
  struct Eliminated {
    Vector6 solved;
    Matrix6 by_next;
  };
  static constexpr std::size_t kPiece = 256;  // frames

  std::optional<PositionPrior> position(FrameIndex frame) const {
    const auto& prior = block_.frames[frame].position_prior;
    if (!use_.use_position_priors || !prior) return std::nullopt;
    return loosened(*prior, block_, block_.frames[frame].rig);
  }
  std::optional<AttitudePrior> attitude(FrameIndex frame) const {
    const auto& prior = block_.frames[frame].attitude_prior;
    if (!use_.use_attitude_priors || !prior) return std::nullopt;
    return loosened(*prior, block_, block_.frames[frame].rig);
  }

  struct Tie {
    Vector6 residual;
    Matrix6 by_this, by_next;
  };
  Tie tie_between(std::size_t k, const Pose& here, const Pose& next) const {
    const RelativePose& tie = block_.relative_poses[trajectory_.ties[k]];
    const TileProblem::RelativeTerm term{LocalFrame(0), LocalFrame(1), tie.pose, tie.rotation_sigma_rad,
                                         tie.position_sigma_m};
    // The chain may run against the direction of a tie.
    const bool forward = tie.from == trajectory_.frames[k];
    const RelativeResidual r = linearise_relative(forward ? here : next, forward ? next : here, term);
    return {r.residual, forward ? r.by_from : r.by_to, forward ? r.by_to : r.by_from};
  }
  Tie tie_at(std::size_t k) const { return tie_between(k, poses_[k], poses_[k + 1]); }

  double cost_of(const std::vector<Pose>& poses, const RobustLoss& loss) const {
    double sum = 0;
    const auto add = [&](const auto& residual) { sum += loss.evaluate(residual.squaredNorm())[0]; };
    for (std::size_t k = 0; k < poses.size(); ++k) {
      if (const auto prior = position(trajectory_.frames[k])) add(linearise_position(poses[k], *prior).residual);
      if (const auto prior = attitude(trajectory_.frames[k])) add(linearise_attitude(poses[k], *prior).residual);
      if (k + 1 < poses.size()) add(tie_between(k, poses[k], poses[k + 1]).residual);
    }
    return sum;
  }

  // N += w J'J, y -= w J'r.
  static void add_prior(const FrameResidual3& r, const RobustLoss& loss, Carried& sum) {
    const double weight = loss.evaluate(r.residual.squaredNorm())[1];
    sum.normal.noalias() += weight * r.by_frame.transpose() * r.by_frame;
    sum.right.noalias() -= weight * r.by_frame.transpose() * r.residual;
  }

  // Eliminates frame k with the equations `carried` from the frames before it, and replaces these by the equations for
  // frame k + 1.
  Eliminated eliminate(std::size_t k, const RobustLoss& loss, Carried& carried) const {
    constexpr double kDamping = 1e-8;  // keeps the matrix regular where nothing observes a component
    const FrameIndex frame = trajectory_.frames[k];
    if (const auto prior = position(frame)) add_prior(linearise_position(poses_[k], *prior), loss, carried);
    if (const auto prior = attitude(frame)) add_prior(linearise_attitude(poses_[k], *prior), loss, carried);
    Carried next;
    Matrix6 coupling = Matrix6::Zero();
    if (k + 1 < poses_.size()) {
      const Tie tie = tie_at(k);
      // The weight of iterative reweighting, rho' of the squared residual.
      const double weight = loss.evaluate(tie.residual.squaredNorm())[1];
      carried.normal.noalias() += weight * tie.by_this.transpose() * tie.by_this;
      carried.right.noalias() -= weight * tie.by_this.transpose() * tie.residual;
      coupling.noalias() = weight * tie.by_this.transpose() * tie.by_next;
      next.normal.noalias() = weight * tie.by_next.transpose() * tie.by_next;
      next.right.noalias() = -weight * tie.by_next.transpose() * tie.residual;
    }
    carried.normal.diagonal() *= 1 + kDamping;
    // S_k of the head, with the observations of frame k and its tie to the next one in it.
    const Eigen::LDLT<Matrix6> factor(carried.normal);
    const Eliminated result{factor.solve(carried.right), factor.solve(coupling)};
    next.normal.noalias() -= coupling.transpose() * result.by_next;
    next.right.noalias() -= coupling.transpose() * result.solved;
    carried = next;
    return result;
  }

  // Computes one step of all frames and stores the moved poses in trial_.
  void solve(const RobustLoss& loss) {
    std::vector<Carried> beginning;  // of each piece
    Carried carried;
    for (std::size_t k = 0; k < poses_.size(); ++k) {
      if (k % kPiece == 0) beginning.push_back(carried);
      eliminate(k, loss, carried);
    }
    Vector6 next = Vector6::Zero();
    std::vector<Eliminated> piece;
    for (std::size_t p = beginning.size(); p-- > 0;) {
      piece.clear();
      for (std::size_t k = p * kPiece; k < std::min((p + 1) * kPiece, poses_.size()); ++k)
        piece.push_back(eliminate(k, loss, beginning[p]));
      for (std::size_t i = piece.size(); i-- > 0;) {
        // x_k = s_k - B_k x_k+1.
        next = piece[i].solved - piece[i].by_next * next;
        trial_[p * kPiece + i] = pose_update(poses_[p * kPiece + i], next);
      }
    }
  }

  const Block& block_;
  const ObservationOptions& use_;
  const Trajectory& trajectory_;
  std::vector<Pose> poses_, trial_;  // [frames of the trajectory]
};

void adjust_trajectory(const Block& block, const ObservationOptions& use, const Trajectory& trajectory, double limit,
                       BlockState& state, GivenTrajectoryChange& change) {
  std::vector<Pose> given;
  for (const FrameIndex frame : trajectory.frames) given.push_back(state.frames[frame]);
  TrajectoryAdjuster adjuster(block, use, trajectory, std::move(given));
  // Relative poses alone have no datum, and nothing to be compared with.
  if (!adjuster.observed()) return;
  const double before = adjuster.mean_square();
  if (before <= limit) return;
  adjuster.run();
  if (!(adjuster.mean_square() < before)) return;
  ++change.trajectories;
  for (std::size_t k = 0; k < trajectory.frames.size(); ++k) {
    Pose& pose = state.frames[trajectory.frames[k]];
    const double moved = (adjuster.poses()[k].centre - pose.centre).norm();
    change.largest_m = std::max(change.largest_m, moved);
    change.rms_m += moved * moved;  // a sum of squares until adjust_trajectories() takes the root
    pose = adjuster.poses()[k];
    ++change.frames;
  }
}

}  // namespace

GivenTrajectoryChange adjust_trajectories(const Block& block, const ObservationOptions& use, BlockState& state,
                                          const GivenTrajectoryOptions& options) {
  GivenTrajectoryChange change;
  const IndexedVector<FrameIndex, Neighbours> neighbours = neighbours_of(block, state);
  IndexedVector<FrameIndex, std::uint8_t> done(block.frames.size(), 0);
  const auto adjust_from = [&](FrameIndex first) {
    const Trajectory trajectory = follow(block, neighbours, first);
    for (const FrameIndex frame : trajectory.frames) done[frame] = 1;
    adjust_trajectory(block, use, trajectory, options.max_mean_square, state, change);
  };
  // A chain starts at its end. A ring has none and is cut at its lowest frame, so that one of its ties does not count.
  for (const bool rings : {false, true})  // chains with ends first, then rings
    for (FrameIndex f(0); neighbours.contains(f); ++f.value) {
      const Neighbours& own = neighbours[f];
      if (!done[f] && own.row[0] != kNone && own.full() == rings) adjust_from(f);
    }
  if (change.frames > 0) change.rms_m = std::sqrt(change.rms_m / static_cast<double>(change.frames));
  return change;
}

}  // namespace megablock
