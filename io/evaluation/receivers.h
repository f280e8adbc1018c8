// Tells what a block found out about its receivers: lever arms, boresights and shifts that were estimated, and lever
// arms and boresights that were taken as given but contradict the images.
//
// The difference y_f of an observed position or attitude from the adjusted pose of frame f, in axes of the rig (metres,
// radians), is
//
//     y_f = c + R_f g + noise,
//
// with c the error of the lever arm or boresight, which moves with the rig, and g a shift or turn of the datum, which
// stays with the ground. Both are estimated in least squares over the frames of a rig; differences of more than 3.5
// times the usual are left out and the rest is solved again, twice. Where all frames look the same way, c and g cannot
// be told apart, and c is not known; of cameras that all look down, this is true along their axis. An error is named
// where it is larger than five of its sigmas, than the stated sigma, and than what remains of the differences.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "io/evaluation/figures.h"
#include "io/result/result.h"

namespace megablock {

// Of a rig whose project leaves lever arm or boresight free. Sigmas of 0: held as given.
struct ReceiverFigures {
  RigIndex rig;
  Eigen::Vector3d lever_arm = Eigen::Vector3d::Zero(), lever_arm_sigma = Eigen::Vector3d::Zero();  // metres, rig axes
  Eigen::Vector3d lever_arm_change = Eigen::Vector3d::Zero();  // adjusted minus given, metres
  // Rotation vector from the axes of the rig to those of the observed attitudes, degrees.
  Eigen::Vector3d boresight = Eigen::Vector3d::Zero(), boresight_sigma = Eigen::Vector3d::Zero();
};
std::vector<ReceiverFigures> receivers_of(const BlockResult& result);

// The shift of a group of positions (io/block/observed_poses.h), metres. Axes along which it is not shifted are 0.
struct ShiftFigures {
  RigIndex group;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero(), sigma = Eigen::Vector3d::Zero();  // sigma: empirical where known
  PositionScale scale;     // sigmas of its positions, used over stated
  bool own_scale = false;  // not that of all positions
};
std::vector<ShiftFigures> shifts_of(const BlockResult& result);
// "in the adjusted block the positions of a.jpg and 8 more lie 29.81 m above their places (sigma 0.12 m)", and by how
// much their own sigmas were multiplied.
std::string shift_text(const BlockResult& result, const ShiftFigures& figures);

// One line for each rig whose antenna or attitudes are off by one vector of the rig, with the option that estimates it.
std::vector<std::string> receiver_remarks(const BlockResult& result, const report::Figures& figures);

}  // namespace megablock
