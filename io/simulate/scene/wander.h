// Gives a smooth random deviation from a straight path: a sum of two oscillations per axis, with periods of about 20 to
// 40 seconds, as a vehicle under control has. Its rms is 1 on each axis.
// Internal to io/: it is not installed.
#pragma once

#include <array>

#include "io/simulate/scene/random.h"

namespace megablock {

class Wander {
 public:
  explicit Wander(Random& random) {
    for (Axis& axis : axes_)
      for (Oscillation& o : axis)
        o = {2 * std::numbers::pi / random.uniform(20, 40), random.uniform(0, 2 * std::numbers::pi)};
  }
  // After t seconds; without a unit.
  Eigen::Vector3d at(double t) const {
    return sum([t](const Oscillation& o) { return std::sin(o.frequency * t + o.phase); });
  }
  Eigen::Vector3d rate(double t) const {  // per second
    return sum([t](const Oscillation& o) { return o.frequency * std::cos(o.frequency * t + o.phase); });
  }

 private:
  struct Oscillation {
    double frequency = 0, phase = 0;  // radians per second, radians
  };
  using Axis = std::array<Oscillation, 2>;

  // Two oscillations of the amplitude 1 have the variance 1.
  template <typename Value>
  Eigen::Vector3d sum(Value value) const {
    Eigen::Vector3d total;
    for (int i = 0; i < 3; ++i) total[i] = value(axes_[i][0]) + value(axes_[i][1]);
    return total;
  }

  std::array<Axis, 3> axes_;
};

}  // namespace megablock
