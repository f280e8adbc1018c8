// Gives the paths of vehicles over the grid of streets.
// Internal to io/: it is not installed.
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

namespace megablock {

inline constexpr double kLane = 1.75;      // distance of a drive to the right of the street axis, metres
inline constexpr double kRigHeight = 2.5;  // of the rig's origin above the road, metres

// The corners of a drive over the streets 0 to streets - 1 of both directions. It goes in serpentines first over the
// streets along x, then over those along y.
std::vector<Eigen::Vector2d> drive_corners(std::int64_t streets, double spacing);

// A polyline whose points are given by their arc length.
class Drive {
 public:
  explicit Drive(std::vector<Eigen::Vector2d> corners);
  double length() const { return length_.back(); }
  // The arc length of a corner.
  double length_to(std::size_t corner) const { return length_[corner]; }
  const std::vector<Eigen::Vector2d>& corners() const { return corners_; }
  Eigen::Vector2d at(double s) const;
  // The mean of the places from five metres before to five metres after.
  Eigen::Vector2d rounded_at(double s) const;
  // The direction as a unit vector. Corners are rounded off over ten metres.
  Eigen::Vector2d forward(double s) const { return (at(s + 5) - at(s - 5)).normalized(); }

 private:
  std::vector<Eigen::Vector2d> corners_;
  std::vector<double> length_;
};

// The rotation ground -> rig of a level rig (x right, y down, z forward) that drives along `forward`.
Eigen::Quaterniond level_rotation(const Eigen::Vector2d& forward);

}  // namespace megablock
