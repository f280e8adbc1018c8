// Models a bridge with ramps, on which one street crosses another.
//
// The street along x through y = centre.y is raised between its neighbouring crossings. It is flat over the street
// along y and descends to the ground on both sides as a raised cosine. Walls stand on both sides; beside the opening
// they reach down to the ground. Because of the walls, the bridge and the street below do not see each other within the
// range of the street scene.
//
// With r = |x - centre.x|, the deck rises above the ground by
//
//     rise = kHeight                                                          for r <= kFlat,
//     rise = kHeight / 2 (1 + cos(pi (r - kFlat) / (half_length - kFlat)))    up to half_length, then 0,
//
// which meets the road and the flat part without a kink.
// Internal to io/: it is not installed.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace megablock {

class Bridge {
 public:
  static constexpr double kHeight = 7;      // of the deck above the street below, metres
  static constexpr double kHalfWidth = 5;   // of the deck, from axis to wall
  static constexpr double kWall = 3.5;      // height of the walls above the deck
  static constexpr double kSlab = 1;        // thickness of the deck
  static constexpr double kFlat = 12;       // half length of the flat part
  static constexpr double kOpening = 10.5;  // half width of the opening for the street below

  // `half_length` is the distance from the crossing to the end of a ramp, metres.
  Bridge(const Eigen::Vector2d& centre, double half_length) : centre_(centre), half_length_(half_length) {}

  const Eigen::Vector2d& centre() const { return centre_; }
  double half_length() const { return half_length_; }
  // The height of the deck above the ground, and of the walls above the deck.
  double rise(double x) const;
  double wall(double x) const;
  // Whether a place in plan is between the walls, ramps included.
  bool carries(double x, double y) const {
    return std::abs(x - centre_.x()) <= half_length_ && std::abs(y - centre_.y()) < kHalfWidth;
  }
  // Whether the bridge or its walls hide one place from another. Heights are above the ground.
  bool hides(const Eigen::Vector3d& eye, const Eigen::Vector3d& place) const;

 private:
  bool upon(const Eigen::Vector3d& p) const;
  Eigen::Vector2d centre_;
  double half_length_;
};

}  // namespace megablock
