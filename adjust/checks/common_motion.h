// Finds the part of the attitudes that comes from the attitude priors alone, in blocks with known positions.
//
// Let the ground move by a similarity m = (phi, t, s) about a centre c (rotation, shift L t, scale 1 + s; L a length of
// the block), and let every frame respond so that its residuals grow least. The information about m is then, summed
// over the frames f,
//
//     G = M - sum W_f' R_f^-1 W_f.
//
// R_f holds the normal equations of the frame (6 x 6: its images, position, lines and verticals), W_f their coupling
// with m, and M those of m. Observations have the weights of their robust losses. G is a sum over tiles, whatever the
// size of the block. A frame that two tiles see responds in each of them independently, which errs on the safe side.
// With the attitude priors in R_f the sum is G_a. The share of m that images, positions and control points determine is
// the eigenvalue mu of G v = mu G_a v: near 1 where the priors do not matter, and 0 where nothing else gives
// information. Two cases are distinguished:
//
//   * all positions lie on one straight line: the ground turns about it, and the frames with it;
//   * a common rotation, as of satellites or of any small field of view from afar: the frames turn in place and the
//     ground follows. For K frames its sigma is that of the mean of K priors, sigma / sqrt(K), however many points.
//
// A control point or a cross strip repairs the first case, control points the second. Cameras and mounts are taken as
// known.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

// The centre and the unit of length of the similarities, the same for all tiles of a connected part of the block.
struct MotionReference {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // mean of the positions, ground frame, m
  double length = 1;                                 // their rms distance from it, m
};
// One for every connected part (Tiles::component). A part without two known positions or without attitude priors keeps
// a length of 0: there is nothing to judge.
std::vector<MotionReference> motion_references(const Block& block, const Tiles& tiles);

// Sums over the frames of a tile, which all belong to one connected part.
struct CommonMotion {
  using Matrix7 = Eigen::Matrix<double, 7, 7>;
  Matrix7 known = Matrix7::Zero(), all = Matrix7::Zero();  // G, G_a
  // The sum of the rotations of the frames in response to m, rad.
  Eigen::Matrix<double, 3, 7> answer = Eigen::Matrix<double, 3, 7>::Zero();
  double frames = 0;
  Eigen::Vector3d places = Eigen::Vector3d::Zero();          // sum of C - c over the frames, m
  Eigen::Matrix3d squared_places = Eigen::Matrix3d::Zero();  // sum of (C - c)(C - c)', m^2

  void add(const CommonMotion& other);
  std::vector<double> to_values() const;
  static CommonMotion from_values(const std::vector<double>& values);  // as many as to_values() gives
};
CommonMotion common_motion(const TileProblem& problem, const TileState& state, const MotionReference& reference);

struct MotionVerdict {
  int weak = 0;            // dimensions of m about which the attitude priors give more than everything else
  bool collinear = false;  // the positions lie on one straight line, and the rotation about it is weak
  // The sigmas of the common rotation of the frames in the weakest dimension, and about the line; rad. 0: not weak.
  double common_sigma_rad = 0, line_sigma_rad = 0;
  Eigen::Vector3d line = Eigen::Vector3d::Zero();  // unit direction, when collinear
  bool sound() const { return weak == 0; }
  bool weak_common_rotation() const { return weak > (collinear ? 1 : 0); }
};
MotionVerdict judge(const CommonMotion& motion, const MotionReference& reference);

// The lines for the report, one for each case; empty when the motion is sound.
std::vector<std::string> describe(const MotionVerdict& verdict);

}  // namespace megablock
