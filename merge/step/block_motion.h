// Applies a step of the adjustment. The part of the step that moves a whole component of the block is applied as a
// similarity, the rest along straight lines.
//
// Where priors of metres alone fix the datum of a small block, they fix its attitude to fractions of a degree. A step
// that turns the block by phi moves frames and points along tangents, C + phi x (C - c): across the axis everything
// grows by 1 + phi^2 / 2, along it nothing grows. The images show this when phi^2 / 2 of their width exceeds the noise
// (phi = 0.3 degrees: 0.02 px). Damping then holds every step down to this size, and the adjustment needs many
// iterations. The similarity (phi, t, s) nearest to the step of a component,
//
//     min  sum over frames  |w + phi|^2 + |d - t - phi x (C - c) - s (C - c)|^2 / L^2,
//
// with c the centroid of the frames and L their root mean square distance from it, is therefore split off. (w, d) is
// the step of a frame: rotation (radians, on the right) and centre (metres). The similarity is applied as X -> c + t +
// (1 + s) Exp(phi) (X' - c), where X' has been moved by the rest of the step; attitudes become R' Exp(-phi), so that
// the images see a moved point as before. To first order this is the step itself, so that the normal equations are
// unchanged.
//
// The sums over the frames that a tile owns are formed for each tile, and added in tile order.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "merge/datum/gauge.h"

namespace megablock {

// The sums of a tile over the steps of its own frames, one row for each component of the block that it touches.
struct MotionSums {
  // The number of frames, and the sums of C, C C' (row by row), d, w, C x d and C . d, about the ground origin.
  static constexpr int kSize = 1 + 3 + 9 + 3 + 3 + 3 + 1;
  using Row = Eigen::Matrix<double, kSize, 1>;
  std::vector<std::int64_t> components;  // ascending
  std::vector<Row> rows;
  Bytes to_bytes() const;
  static MotionSums from_bytes(const Bytes& bytes);
};
// `step` is that of the tile's unknowns (TileStep::unknowns). The outline of the tile suffices (tile_store.h).
MotionSums motion_sums(const BlockGauge& gauge, std::int64_t tile, const TileProblem& problem, const TilePlan& plan,
                       const TileState& state, const Step& step);

// A similarity of the ground near the identity.
struct BlockMotion {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();  // phi, rad
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();     // m
  double scale = 0;                                    // s

  // The movement of a position to first order, metres.
  Eigen::Vector3d tangent(const Eigen::Vector3d& position) const {
    const Eigen::Vector3d arm = position - centre;
    return shift + rotation.cross(arm) + scale * arm;
  }
};
// The motion of every component of the block, from the sums of all tiles in tile order. One entry for each of
// gauge.components.
std::vector<BlockMotion> block_motions(const BlockGauge& gauge, const std::vector<MotionSums>& tiles);

// Applies a step to a tile, with the motions of the components to which its parts belong. All tiles that hold a frame
// compute the same bits for it. Without motions everything moves along straight lines.
class TileMotion {
 public:
  // Problem and plan outlive the object.
  TileMotion(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
             const TileProblem& problem, const TilePlan& plan);
  // Moves everything except the points.
  TileState unknowns(const TileState& state, const Step& step) const;
  // The new position of a point from its step.
  Eigen::Vector3d point(const TileState& state, std::int64_t point, const Eigen::Vector3d& step) const {
    const Mover& mover = movers_.size() == 1 ? movers_.front() : mover_of(point);
    const Eigen::Vector3d& before = state.points[static_cast<std::size_t>(point)];
    return mover.moved(before + (step - mover.motion.tangent(before)));
  }

 private:
  struct Mover {  // the motion of a component, prepared for use
    BlockMotion motion;
    Eigen::Quaterniond turn;
    Eigen::Vector3d moved(const Eigen::Vector3d& position) const {
      return motion.centre + motion.shift + (1 + motion.scale) * (turn * (position - motion.centre));
    }
    Pose pose(const Pose& before, PoseIncrement increment) const;
  };
  const Mover& mover_of(std::int64_t point) const;
  const TileProblem& problem_;
  const TilePlan& plan_;
  std::vector<Mover> movers_;  // of the tile's parts
};

// The state after the step.
TileState apply_step(const BlockGauge& gauge, const std::vector<BlockMotion>& motions, std::int64_t tile,
                     const TileProblem& problem, const TilePlan& plan, const TileState& state, const TileStep& step);

}  // namespace megablock
