#include "io/simulate/images/texture.h"

#include <algorithm>
#include <cmath>

#include "io/simulate/scene/random.h"

namespace megablock {

namespace {

// The floor of a number. std::floor() is a slow call with the baseline instruction set.
std::int64_t whole(double x) {
  const auto i = static_cast<std::int64_t>(x);
  return i - (x < static_cast<double>(i));
}

// Smoothstep: its derivative is zero at both ends, so the noise has no kinks at the lattice.
float smooth(double t) { return static_cast<float>(t * t * (3 - 2 * t)); }

std::uint32_t hash(std::int64_t i, std::int64_t j, std::uint32_t surface) {
  auto h =
      static_cast<std::uint32_t>(i) * 0x9e3779b1u ^ static_cast<std::uint32_t>(j) * 0x85ebca77u ^ surface * 0xc2b2ae3du;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return h ^ (h >> 15);
}

}  // namespace

Texture::Texture(std::uint64_t seed, double finest_m) : finest_m_(finest_m), tile_(kTile * kTile) {
  Random random(seed, Random::Purpose::kImage, ~std::uint64_t{0});
  for (float& value : tile_) value = static_cast<float>(random.uniform(-1, 1));
}

float Texture::noise(double x, double y) const {
  const std::int64_t i = whole(x), j = whole(y);
  const float a = smooth(x - static_cast<double>(i)), b = smooth(y - static_cast<double>(j));
  constexpr std::int64_t kMask = kTile - 1;
  const std::int64_t i0 = i & kMask, i1 = (i + 1) & kMask, j0 = (j & kMask) * kTile, j1 = ((j + 1) & kMask) * kTile;
  const auto at = [&](std::int64_t k) { return tile_[static_cast<std::size_t>(k)]; };
  const float top = at(j0 + i0) + a * (at(j0 + i1) - at(j0 + i0));
  const float bottom = at(j1 + i0) + a * (at(j1 + i1) - at(j1 + i0));
  return top + b * (bottom - top);
}

// Each square of the lattice has one disc, which lies completely inside it.
float Texture::discs(double u, double v, double size_m, std::uint32_t surface) const {
  const double x = u / size_m, y = v / size_m;
  const std::int64_t i = whole(x), j = whole(y);
  const std::uint32_t h = hash(i, j, surface);
  const double radius = 0.1 + 0.15 * (h & 255) / 255.0;
  const double cx = 0.5 + (0.5 - radius) * ((h >> 8 & 255) / 127.5 - 1);
  const double cy = 0.5 + (0.5 - radius) * ((h >> 16 & 255) / 127.5 - 1);
  const double dx = x - static_cast<double>(i) - cx, dy = y - static_cast<double>(j) - cy;
  const double inside = (radius * radius - dx * dx - dy * dy) / (radius * radius);
  if (inside <= 0) return 0;
  const auto brightness = static_cast<float>((h >> 24) / 127.5 - 1);
  return brightness * static_cast<float>(std::min(1.0, 3 * inside));
}

float Texture::detail(double u, double v, std::uint32_t surface, double footprint_m) const {
  // Cosine and sine of the angle between successive octaves (about 37 degrees).
  constexpr double kCos = 0.8, kSin = 0.6;
  // Surfaces share one noise tile, each at a place of its own.
  const double shift = static_cast<double>(surface % 1021) * 17.3;
  double x = u + shift, y = v - shift, wave = finest_m_;
  float sum = 0, amplitude = 0.34f;
  for (int octave = 0; octave < kOctaves; ++octave) {
    // An octave appears above 1.5 pixels per wave, and is complete at 2.5. Waves shorter than 2 pixels would alias.
    const double sharpness = std::clamp(wave / footprint_m - 1.5, 0.0, 1.0);
    if (sharpness > 0) sum += static_cast<float>(sharpness) * amplitude * noise(x / wave, y / wave);
    const double turned = kCos * x - kSin * y;
    y = kSin * x + kCos * y;
    x = turned;
    wave *= 2;
    amplitude *= 1.02f;
  }
  // Discs give the corners and blobs that feature detectors look for, in two sizes.
  for (const double size : {8.0, 37.0}) {
    const double sharpness = std::clamp(0.2 * size * finest_m_ / footprint_m - 0.5, 0.0, 1.0);
    if (sharpness > 0) sum += 0.45f * static_cast<float>(sharpness) * discs(u, v, size * finest_m_, surface);
  }
  return sum;
}

float Texture::cell(double u, double v, double size_m, std::uint32_t surface) {
  return static_cast<float>(hash(whole(u / size_m), whole(v / size_m), surface) >> 8) * 0x1p-24f;
}

}  // namespace megablock
