// Draws random numbers with the same bits on every machine; those of the standard library differ between
// implementations.
//
// The generator is SplitMix64 (Steele, Lea, Flood 2014). Seed and stream select a generator, so every frame can draw
// from its own stream, and no result depends on the order in which frames are processed.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace megablock {

// Finaliser of SplitMix64: a bijection that spreads every input bit over the whole word.
inline std::uint64_t mix_bits(std::uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

class Random {
 public:
  // The purpose of a stream. Streams with different purposes are independent.
  enum class Purpose : std::uint64_t {
    kCamera = 1,
    kTerrain,
    kFrame,
    kTracks,
    kNoise,
    kPriors,
    kControl,
    kImage,
    kTrajectory,
    kChain
  };

  // Items of one purpose that must not share a stream need different numbers: the users of kCamera take 0, 1, ... for
  // cameras, from 1000 for the mounts of the street rig, and from 2000 for those of the vehicle.
  Random(std::uint64_t seed, Purpose purpose, std::uint64_t item = 0)
      : state_(mix_bits(mix_bits(mix_bits(seed + kStep) + static_cast<std::uint64_t>(purpose) * kStep) + item)) {}

  std::uint64_t next() { return mix_bits(state_ += kStep); }
  // The upper 53 bits, which a double holds exactly; so 1 cannot occur.
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }  // [0, 1)
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  // 0 to n - 1. The bias of the multiplication is below n / 2^53.
  std::int64_t below(std::int64_t n) { return static_cast<std::int64_t>(uniform() * static_cast<double>(n)); }

  // A standard normal deviate (Box-Muller). The second deviate of the pair is dropped, so that there is no hidden
  // state.
  double normal() {
    // 1 - uniform() lies in (0, 1], so the logarithm is finite.
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * std::numbers::pi * uniform());
  }
  Eigen::Vector3d normal3() {
    // One after the other: C++ does not fix the order in which the arguments of a call are evaluated.
    const double x = normal(), y = normal(), z = normal();
    return {x, y, z};
  }
  // A Poisson deviate by Knuth's method: it counts the uniform factors until their product falls to exp(-mean). The
  // time grows with the mean, so it is for means up to a few tens.
  int poisson(double mean) {
    double product = uniform();
    const double limit = std::exp(-mean);
    int n = 0;
    for (; product > limit; ++n) product *= uniform();
    return n;
  }

 private:
  static constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15ULL;
  std::uint64_t state_;
};

}  // namespace megablock
