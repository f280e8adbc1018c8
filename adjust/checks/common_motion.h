// Finds the part of the attitudes that comes from the attitude priors alone, in blocks with known positions.
//
// Let the ground move by a similarity m = (phi, t, s) about a centre c (rotation, shift L t, scale 1 + s; L a length of
// the block), and every frame answer as it fits best. The information on m is then, summed over the frames f,
//
//     G = M - sum W_f' R_f^-1 W_f,
//
// R_f the normal equations of the frame (6 x 6: its images, position, lines and verticals), W_f their coupling with m,
// M those of m; observations have the weights that their robust losses leave them. It is a sum over tiles (a frame that
// two tiles see answers in each by itself, which errs to the careful side), whatever the size of the block. With the
// attitude priors in R_f it is G_a. The share of m that the images, positions and control points determine is the
// eigenvalue mu of G v = mu G_a v: near 1 where the priors do not matter, 0 where nothing else is known. Two cases are
// told apart:
//
//   * all positions on one straight line: the ground turns about it, and the frames with it;
//   * a common rotation: satellites, or any small field of view from afar, where the frames turn in place and the
//     ground follows; of K frames its sigma is that of the mean of K priors, sigma / sqrt(K), however many points.
//
// A control point or a cross strip repairs the first, control points the second. Cameras and mounts are taken as known.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Centre and length unit of the similarities, the same for all tiles of a connected part of the block.
struct MotionReference {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  // mean of the positions, ground frame, m
  double length = 1;                                 // their rms distance from it, m
};
// Of every connected part (Tiles::component); a part without two known positions or without attitude priors keeps a
// length of 0: there is nothing to judge.
std::vector<MotionReference> motion_references(const Block& block, const Tiles& tiles);

// Sums over a tile; its frames hang together.
struct CommonMotion {
  using Matrix7 = Eigen::Matrix<double, 7, 7>;
  Matrix7 known = Matrix7::Zero(), all = Matrix7::Zero();                    // G, G_a
  Eigen::Matrix<double, 3, 7> answer = Eigen::Matrix<double, 3, 7>::Zero();  // sum of the frames' rotations by m, rad
  double frames = 0;
  Eigen::Vector3d places = Eigen::Vector3d::Zero();          // sum of C - c over the frames, m
  Eigen::Matrix3d squared_places = Eigen::Matrix3d::Zero();  // sum of (C - c)(C - c)', m^2

  void add(const CommonMotion& other);
  std::vector<double> to_values() const;
  static CommonMotion from_values(const std::vector<double>& values);  // as many as to_values() gives
};
CommonMotion common_motion(const TileProblem& problem, const TileState& state, const MotionReference& reference);

struct MotionVerdict {
  int weak = 0;            // dimensions of m of which the attitude priors tell more than everything else
  bool collinear = false;  // positions on one straight line, and the rotation about it among them
  // Sigma of the common rotation of the frames in the weakest dimension, and about the line; rad. 0: not weak.
  double common_sigma_rad = 0, line_sigma_rad = 0;
  Eigen::Vector3d line = Eigen::Vector3d::Zero();  // direction, unit, where collinear
  bool sound() const { return weak == 0; }
  bool weak_common_rotation() const { return weak > (collinear ? 1 : 0); }
};
MotionVerdict judge(const CommonMotion& motion, const MotionReference& reference);

// The lines of the report, one per case; empty when sound.
std::vector<std::string> describe(const MotionVerdict& verdict);

}  // namespace megablock
