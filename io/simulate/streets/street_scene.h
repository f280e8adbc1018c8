// Gives the surfaces of the street scene: roads and facades (street_grid.h).
//
// Seen from a street, the scene is a channel: the road z = ground(x, y) up to the facades, and vertical facades up to
// 12 m. A line of sight that leaves the streets in plan is blocked by houses, whatever their height.
// Internal to io/: it is not installed.
#pragma once

#include "io/simulate/scene/scene.h"
#include "io/simulate/streets/street_grid.h"

namespace megablock {

class StreetScene : public Scene {
 public:
  StreetScene(const SimulationOptions& options, const Terrain& terrain)
      : spacing_(options.street_spacing_m), seed_(options.seed), terrain_(terrain) {}

  double ground(double x, double y) const { return terrain_.height(x, y); }
  double spacing() const { return spacing_; }
  // The direction of the street at a place: 0 along x, 1 along y. At a crossing, the street with the nearer axis
  // counts.
  int direction_at(const Eigen::Vector3d& place) const {
    return off_axis(place.y(), spacing_) < off_axis(place.x(), spacing_) ? 0 : 1;
  }

  // A random place on the road or on a facade of the frame's street.
  std::optional<SurfacePoint> sample(const Pose& frame, Random& random) const override;
  // Whether the point is within the range, not seen at too flat an angle, and the line of sight stays over the streets.
  bool visible(const Eigen::Vector3d& eye, const SurfacePoint& point) const override;
  double range_m() const override;
  bool along_passes() const override { return true; }

 private:
  double spacing_;
  std::uint64_t seed_;
  Terrain terrain_;
};

}  // namespace megablock
