// How vehicles drive over the grid of streets.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

namespace megablock {

inline constexpr double kLane = 1.75;      // a drive keeps to the right of the axis by this, metres
inline constexpr double kRigHeight = 2.5;  // of the rig's origin above the road, metres

// The corners of a drive over streets 0 .. streets - 1 of both directions: in serpentines, first the streets along x,
// then those along y.
std::vector<Eigen::Vector2d> drive_corners(std::int64_t streets, double spacing);

// Polyline addressed by arc length.
class Drive {
 public:
  explicit Drive(std::vector<Eigen::Vector2d> corners);
  double length() const { return length_.back(); }
  // Of a corner, by its number.
  double length_to(std::size_t corner) const { return length_[corner]; }
  const std::vector<Eigen::Vector2d>& corners() const { return corners_; }
  Eigen::Vector2d at(double s) const;
  // Unit direction, the corners rounded off over ten metres.
  Eigen::Vector2d forward(double s) const { return (at(s + 5) - at(s - 5)).normalized(); }

 private:
  std::vector<Eigen::Vector2d> corners_;
  std::vector<double> length_;
};

// Level rig (x right, y down, z forward) heading along `forward`, ground -> rig.
Eigen::Quaterniond level_rotation(const Eigen::Vector2d& forward);

}  // namespace megablock
