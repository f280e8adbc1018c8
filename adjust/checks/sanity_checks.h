// Checks a solved block against facts that the adjustment did not use (Barrier and Martin): the images of one overpass
// lie on a line at even distances, and a scene known to be flat lies on one level.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace megablock {

// Checks three or more centres in the order of their acquisition. With fewer, all values are zero. They are infinite
// when a centre is not finite, or when all centres are the same.
struct StripCheck {
  static constexpr double kLimit = 0.05;  // share of the mean spacing
  double off_line = 0;                    // largest distance from their line, over the mean spacing
  double uneven = 0;                      // largest deviation of a spacing from the mean, over the mean
  bool sound() const { return off_line <= kLimit && uneven <= kLimit; }
};
StripCheck check_strip(const std::vector<Eigen::Vector3d>& centres);

// Checks the points of a scene that is known to be almost flat, whether it is level or not. There are two levels when
// the distances from the plane of the larger level fall into two groups that are farther apart than four times the
// scatter within them, and the smaller group has a twentieth of the points at least. Evenly spread distances (3.5) and
// normally distributed ones (2.6) stay below this limit.
struct LevelCheck {
  static constexpr double kLimit = 4;
  double separation = 0;  // distance of the groups' means, over the rms of their scatters
  double step = 0;        // distance of the groups' means, in the unit of the coordinates
  double smaller_share = 0;
  bool sound() const;
};
// Points that are not finite are left out. With fewer than ten others, all values are zero. Deterministic.
LevelCheck check_one_level(const std::vector<Eigen::Vector3d>& points);

}  // namespace megablock
