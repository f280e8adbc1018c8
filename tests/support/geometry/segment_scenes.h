// Simulates segments of parallel edges, and clutter, in a simulated image with 3008 x 2000 pixels and a focal length of
// 3000 pixels.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "geometry/numbers/angles.h"
#include "geometry/vanishing/vanishing_points.h"

namespace megablock::fixture {

struct SegmentScene {
  int width = 3008, height = 2000;
  PerspectiveCentre camera{{1504, 1000}, 3000};
  double sigma_px = 0.3;
  std::vector<std::array<Eigen::Vector2d, 2>> segments;
  std::vector<int> family;            // of each segment; -1: clutter
  std::vector<Eigen::Vector3d> axes;  // of the families, in camera axes
  std::mt19937_64 random;

  explicit SegmentScene(std::uint64_t seed = 1, double sigma = 0.3) : sigma_px(sigma), random(seed) {}

  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); }
  Eigen::Vector2d noise() {
    std::normal_distribution<double> normal(0, 1);
    const double x = normal(random), y = normal(random);
    return sigma_px * Eigen::Vector2d(x, y);
  }
  void add(const Eigen::Vector2d& middle, const Eigen::Vector2d& along, double length, int of) {
    const Eigen::Vector2d half = 0.5 * length * along.normalized();
    const Eigen::Vector2d a = middle - half + noise(), b = middle + half + noise();
    segments.push_back({a, b});
    family.push_back(of);
  }
  Eigen::Vector2d place() {
    const double x = uniform(0, width), y = uniform(0, height);
    return {x, y};
  }
  void add_family(const Eigen::Vector3d& axis, int count, double shortest = 60, double longest = 400) {
    const Eigen::Vector3d point(camera.distance * axis.x() + camera.centre.x() * axis.z(),
                                camera.distance * axis.y() + camera.centre.y() * axis.z(), axis.z());
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2d middle = place();
      add(middle, point.head<2>() - point.z() * middle, uniform(shortest, longest), static_cast<int>(axes.size()));
    }
    axes.push_back(axis.normalized());
  }
  void add_clutter(int count, double shortest = 60, double longest = 400) {
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector2d middle = place();
      const double angle = uniform(0, 2 * EIGEN_PI);
      add(middle, {std::cos(angle), std::sin(angle)}, uniform(shortest, longest), -1);
    }
  }

  std::vector<ImageLine> lines() const {
    std::vector<ImageLine> result;
    for (const auto& ends : segments) result.push_back(*fit_image_line(ends, sigma_px));
    return result;
  }
  std::vector<InterpretationPlane> planes(const PerspectiveCentre& from) const {
    std::vector<InterpretationPlane> result;
    for (const ImageLine& line : lines()) result.push_back(interpretation_plane(line, from));
    return result;
  }
  std::vector<InterpretationPlane> planes() const { return planes(camera); }
};

inline double axis_error_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), std::abs(a.dot(b))) * kDegreesPerRadian;
}

// The attitude in which a camera is held. The columns of the matrix are its x, y and z axes in a ground frame with z
// down, so the transpose turns the vertical of the ground into camera axes.
struct Held {
  double roll = 0, pitch = 0;                                  // radians
  int quarter_turns = 0;                                       // of the camera about its view, clockwise
  Eigen::Vector3d seen(const Eigen::Vector3d& ground) const {  // ground: x ahead's right, y down, z ahead
    const Eigen::AngleAxisd about_view(roll + quarter_turns * EIGEN_PI / 2, Eigen::Vector3d::UnitZ());
    const Eigen::AngleAxisd about_right(pitch, Eigen::Vector3d::UnitX());
    return about_view * (about_right * ground);
  }
  Eigen::Vector3d vertical() const { return seen(Eigen::Vector3d::UnitY()); }
  Eigen::Vector3d horizontal(double azimuth) const { return seen({std::sin(azimuth), 0, std::cos(azimuth)}); }
};

// A street: the vertical, `horizontals` families of lines at least 15 degrees of azimuth apart, and 10 to 50 % clutter.
inline SegmentScene urban_scene(std::uint64_t seed, const Held& held, int horizontals, double sigma_px = 0.3) {
  SegmentScene scene(seed, sigma_px);
  scene.add_family(held.vertical(), static_cast<int>(scene.uniform(40, 120)));
  std::vector<double> azimuths;
  while (static_cast<int>(azimuths.size()) < horizontals) {
    const double azimuth = scene.uniform(0, EIGEN_PI);
    bool apart = true;
    for (const double other : azimuths) apart = apart && std::abs(std::sin(azimuth - other)) > std::sin(15 * kDegree);
    if (!apart) continue;
    azimuths.push_back(azimuth);
    scene.add_family(held.horizontal(azimuth), static_cast<int>(scene.uniform(25, 80)));
  }
  const double share = scene.uniform(0.1, 0.5);
  scene.add_clutter(static_cast<int>(static_cast<double>(scene.segments.size()) * share / (1 - share)));
  return scene;
}

}  // namespace megablock::fixture
