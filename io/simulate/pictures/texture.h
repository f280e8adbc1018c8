// Procedural texture of the rendered scenes: a colour for each place of a surface, the same from every view.
//
// Sum of octaves of value noise (random numbers on a lattice, smoothly interpolated) from three ground pixels up, each
// octave turned against the others, and discs of random size and brightness. Octaves finer than the pixel's footprint
// fade out, so that distant surfaces do not alias.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace megablock {

class Texture {
 public:
  // `finest_m`: length of the shortest noise wave, metres.
  Texture(std::uint64_t seed, double finest_m);

  // Grey value about 0, mostly within +-1, at a place (u, v) [metres] of surface number `surface`. `footprint_m`: size
  // of the pixel on the surface.
  float detail(double u, double v, std::uint32_t surface, double footprint_m) const;

  // One random number in [0, 1) per square of `size_m`: patches, windows.
  static float cell(double u, double v, double size_m, std::uint32_t surface);

 private:
  static constexpr int kTile = 512, kOctaves = 8;  // numbers of the noise lattice per side (repeated); octaves
  float noise(double x, double y) const;
  float discs(double u, double v, double size_m, std::uint32_t surface) const;

  double finest_m_;
  std::vector<float> tile_;  // [kTile * kTile], -1 to 1
};

}  // namespace megablock
