// Gives smooth terrain for simulated blocks, a sum of four plane waves.
//
//     z(x, y) = sum of a_i sin(w_i . (x, y) + phase_i),  |w_i| = 2 pi / (l_i scale),  l = 6, 4, 2.5, 1.5,
//     a = relief / 2 times 0.4, 0.3, 0.2, 0.1; the directions of w_i and the phases are random.
//
// A closed formula needs no grid, has no border, and is known at every place in constant time.
// Internal to io/: it is not installed.
#pragma once

#include <array>
#include <cmath>
#include <numbers>

#include "io/simulate/scene/random.h"

namespace megablock {

class Terrain {
 public:
  // Heights are within +-relief_m / 2. The shortest wave is 1.5 times `scale_m` long.
  Terrain(std::uint64_t seed, double relief_m, double scale_m) {
    Random random(seed, Random::Purpose::kTerrain);
    constexpr std::array<double, 4> kShare = {0.4, 0.3, 0.2, 0.1}, kLength = {6, 4, 2.5, 1.5};
    for (std::size_t i = 0; i < waves_.size(); ++i) {
      const double direction = random.uniform(0, 2 * std::numbers::pi);
      const double number = 2 * std::numbers::pi / (kLength[i] * scale_m);
      waves_[i] = {number * std::cos(direction), number * std::sin(direction), random.uniform(0, 2 * std::numbers::pi),
                   kShare[i] * relief_m / 2};
    }
  }
  double height(double x, double y) const {
    double z = 0;
    for (const Wave& w : waves_) z += w.amplitude * std::sin(w.x * x + w.y * y + w.phase);
    return z;
  }

 private:
  struct Wave {
    double x, y, phase, amplitude;
  };
  std::array<Wave, 4> waves_;
};

}  // namespace megablock
