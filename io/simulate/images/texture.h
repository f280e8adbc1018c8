// Computes the texture of the rendered scenes: a grey value for each place of a surface, the same in every image.
//
// The texture is a sum of octaves of value noise (random numbers on a lattice, smoothly interpolated) with waves from
// three ground pixels up, each octave turned against the others, and of discs with random size and brightness. Octaves
// that are finer than the footprint of the pixel fade out, so distant surfaces do not alias.
// Internal to io/: it is not installed.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace megablock {

class Texture {
 public:
  // `finest_m` is the length of the shortest noise wave, metres.
  Texture(std::uint64_t seed, double finest_m);

  // The grey value, about 0 and mostly within +-1, at the place (u, v) (metres) of surface number `surface`.
  // `footprint_m` is the size of the pixel on the surface.
  float detail(double u, double v, std::uint32_t surface, double footprint_m) const;

  // A random number in [0, 1) for each square of side `size_m`: for patches and windows.
  static float cell(double u, double v, double size_m, std::uint32_t surface);

 private:
  static constexpr int kTile = 512, kOctaves = 8;  // numbers of the noise lattice per side (repeated); octaves
  float noise(double x, double y) const;
  float discs(double u, double v, double size_m, std::uint32_t surface) const;

  double finest_m_;
  std::vector<float> tile_;  // [kTile * kTile], -1 to 1
};

}  // namespace megablock
