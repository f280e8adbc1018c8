#include "io/simulate/images/same_facade.h"

#include <algorithm>
#include <cmath>

namespace megablock {

namespace {

constexpr double kBay = 2.0, kLevel = 3.2, kPlinth = 0.7;  // metres: from window to window, storey to storey; plinth
constexpr double kFar = 512;                               // keeps coordinates positive, metres
constexpr std::uint32_t kCommon = 40001;                   // number of the common surface; sides follow it

// The part of [0, 1) in which x lies, and 0 outside of (low, high).
double window_part(double x, double low, double high) { return x > low && x < high ? (x - low) / (high - low) : 0; }

}  // namespace

int facade_side(const Eigen::Vector3d& normal) {
  if (std::abs(normal.x()) > std::abs(normal.y())) return normal.x() > 0 ? 0 : 2;
  return normal.y() > 0 ? 1 : 3;
}

double along_facade(const Eigen::Vector3d& normal, const Eigen::Vector3d& point) {
  // One who looks at the wall has -normal ahead and (-normal) x up at the right.
  return (-normal).cross(Eigen::Vector3d::UnitZ()).dot(point);
}

Eigen::Vector3f same_facade_colour(const Texture& texture, const FacadeSpot& spot, double own) {
  const std::uint32_t common = kCommon, other = kCommon + 1 + static_cast<std::uint32_t>(spot.side);
  const double u = spot.along + kFar, v = spot.up;
  const auto share = static_cast<float>(own);
  float detail = (1 - share) * texture.detail(u, v, common, spot.footprint_m) +
                 share * texture.detail(u, v, other, spot.footprint_m);
  Eigen::Vector3f base(168, 150, 122);
  if (v < kPlinth) base = Eigen::Vector3f(116, 110, 104);
  // Windows with a frame, a cross and panes.
  const double bay = u / kBay - std::floor(u / kBay), level = (v - kPlinth) / kLevel;
  const double x = window_part(bay, 0.24, 0.76), y = window_part(level - std::floor(level), 0.22, 0.80);
  if (v > kPlinth && x > 0 && y > 0) {
    const double storey = std::floor(level);
    // A window of its own is one whose random number is below the share.
    const bool different =
        Texture::cell(u, storey + 0.5, kBay, other * 16 + static_cast<std::uint32_t>(storey)) < share;
    const std::uint32_t look = (different ? other : common) * 16 + static_cast<std::uint32_t>(storey) + 8;
    const float shade = Texture::cell(u, 0.5, kBay, look), curtain = Texture::cell(u, 0.5, kBay, look + 977);
    const bool frame = x < 0.09 || x > 0.91 || y < 0.06 || y > 0.94 || std::abs(x - 0.5) < 0.04;
    if (frame)
      base = Eigen::Vector3f(205, 205, 198);
    else
      base = (y > 1 - 0.9 * static_cast<double>(curtain) ? 1.9f : 1.0f) * (30 + 60 * shade) *
             Eigen::Vector3f(1, 1.04f, 1.1f);
    detail *= 0.35f;
  }
  // The door and ten stains of this side.
  const double door = -8 + 16 * static_cast<double>(Texture::cell(0.5, 0.5, 1, other * 7));
  if (std::abs(spot.along - door) < 0.6 && v < 2.3) {
    const float tone = Texture::cell(1.5, 0.5, 1, other * 7);
    base = (1 - share) * base + share * Eigen::Vector3f(60 + 90 * tone, 50, 120 - 90 * tone);
  }
  for (int k = 0; k < 10; ++k) {
    const double q = k + 0.5;
    const double du = spot.along + 11 - 22 * static_cast<double>(Texture::cell(q, 0.5, 1, other * 7 + 1));
    const double dv = v - 10 * static_cast<double>(Texture::cell(q, 0.5, 1, other * 7 + 2));
    const double radius = 0.2 + 0.7 * static_cast<double>(Texture::cell(q, 0.5, 1, other * 7 + 3));
    const double depth = 1 - (du * du + dv * dv) / (radius * radius);
    if (depth > 0) detail -= 1.4f * share * static_cast<float>(std::min(1.0, 3 * depth));
  }
  return base * std::max(0.1f, 1 + 0.5f * detail);
}

}  // namespace megablock
