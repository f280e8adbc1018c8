// Checks a solved block against facts that the adjustment did not use (Barrier and Martin): the images of one overpass
// lie on a line at even distances, and a scene known to be flat lies on one level.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace megablock {

// Centres in the order of their acquisition, three or more (fewer: nothing to check, all zero). Infinite where one is
// not finite, or all are one.
struct StripCheck {
  static constexpr double kLimit = 0.05;  // of the mean spacing
  double off_line = 0;                    // largest distance from their line, over the mean spacing
  double uneven = 0;                      // largest deviation of a spacing from the mean, over it
  bool sound() const { return off_line <= kLimit && uneven <= kLimit; }
};
StripCheck check_strip(const std::vector<Eigen::Vector3d>& centres);

// Points of a scene that is known to be almost flat, level or not. Two levels: distances from the plane of the larger
// level fall into two groups, farther apart than four times the scatter within, of which the smaller has a twentieth of
// the points at least. Evenly spread distances (3.5) and a normal distribution (2.6) do not.
struct LevelCheck {
  static constexpr double kLimit = 4;
  double separation = 0;  // of the groups' means, over the rms of their scatters
  double step = 0;        // between the groups' means, as the coordinates
  double smaller_share = 0;
  bool sound() const;
};
// Points that are not finite are left out; fewer than ten others: nothing to check, all zero. Deterministic.
LevelCheck check_one_level(const std::vector<Eigen::Vector3d>& points);

}  // namespace megablock
