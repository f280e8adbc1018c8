#include "io/simulate/streets/bridge.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace megablock {

double Bridge::rise(double x) const {
  const double r = std::abs(x - centre_.x());
  if (r >= half_length_) return 0;
  if (r <= kFlat) return kHeight;
  return 0.5 * kHeight * (1 + std::cos(std::numbers::pi * (r - kFlat) / (half_length_ - kFlat)));
}

// The height of the walls, which are lower where the ramp meets the road.
double Bridge::wall(double x) const { return kWall * std::min(1.0, rise(x) / 2); }

bool Bridge::upon(const Eigen::Vector3d& p) const { return carries(p.x(), p.y()) && p.z() > rise(p.x()) - 0.5 * kSlab; }

bool Bridge::hides(const Eigen::Vector3d& eye, const Eigen::Vector3d& place) const {
  // Both tests look at the straight line p(t) = eye + t (place - eye), 0 < t < 1, in heights above the ground.
  const Eigen::Vector3d sight = place - eye;
  const bool from = upon(eye), to = upon(place);
  // Intersect the line with the planes of the walls, y = centre +- kHalfWidth.
  for (const int side : {-1, 1}) {
    if (sight.y() == 0) break;
    const double t = (centre_.y() + side * kHalfWidth - eye.y()) / sight.y();
    if (t <= 0 || t >= 1) continue;
    const Eigen::Vector3d cut = eye + t * sight;
    if (std::abs(cut.x() - centre_.x()) > half_length_) continue;
    const double deck = rise(cut.x());
    if (cut.z() >= deck + wall(cut.x())) continue;
    // Below the deck the walls have an opening, through which the street below sees both ways. A line that begins or
    // ends on the bridge does not go through it.
    const bool under = std::abs(cut.x() - centre_.x()) <= kOpening && cut.z() < deck - kSlab;
    if (!under || from || to) return true;
  }
  // Test the deck and the slab below it: the line must not pass from above the deck to below it.
  constexpr int kSteps = 16;
  bool above = false, below = false;
  for (int i = 0; i <= kSteps; ++i) {
    const Eigen::Vector3d p = eye + sight * (static_cast<double>(i) / kSteps);
    if (!carries(p.x(), p.y())) continue;
    const double deck = rise(p.x());
    if (p.z() >= deck - 0.3) {  // a road point lies on the deck
      above = true;
    } else if (p.z() > deck - kSlab || std::abs(p.x() - centre_.x()) > kOpening) {
      return true;
    } else {
      below = true;
    }
  }
  return above && below;
}

}  // namespace megablock
