#include "io/simulate/streets/street_scene.h"

#include <algorithm>
#include <cmath>

namespace megablock {

namespace {

constexpr double kFacadeHeight = 12;  // metres
constexpr double kRange = 40;         // metres

}  // namespace

double StreetScene::range_m() const { return kRange; }

std::optional<SurfacePoint> StreetScene::sample(const Pose& frame, Random& random) const {
  const bool street_along_x = off_axis(frame.centre.y(), spacing_) < off_axis(frame.centre.x(), spacing_);
  const int along = street_along_x ? 0 : 1, across = 1 - along;
  const std::int64_t street = nearest_axis(frame.centre[across], spacing_);
  const double axis = spacing_ * static_cast<double>(street);
  const double place = frame.centre[along] + random.uniform(-0.6, 0.6) * kRange;
  const int side = random.uniform() < 0.5 ? -1 : 1;
  const bool road = random.uniform() < 0.3;
  SurfacePoint point;
  point.position[along] = place;
  point.normal.setZero();
  if (road) {
    point.position[across] = axis + side * random.uniform(3.5, kFacade - kFacadeDepth);
    point.normal.z() = 1;
  } else {
    if (off_axis(place, spacing_) < kFacade + kFacadeDepth) return std::nullopt;  // a crossing
    point.position[across] = axis + side * facade_distance(seed_, street_along_x, street, side, place);
    point.normal[across] = -side;
  }
  point.position.z() = ground(point.position.x(), point.position.y());
  if (!road) point.position.z() += random.uniform(0, kFacadeHeight);
  return point;
}

bool StreetScene::visible(const Eigen::Vector3d& eye, const SurfacePoint& point) const {
  const Eigen::Vector3d sight = point.position - eye;
  const double distance = sight.norm();
  // 0.12 is the sine of 7 degrees between surface and line of sight.
  if (distance > kRange || distance < 2 || -sight.dot(point.normal) < 0.12 * distance) return false;
  for (const int across : {0, 1})  // whether both ends are in one street
    if (nearest_axis(eye[across], spacing_) == nearest_axis(point.position[across], spacing_) &&
        std::max(off_axis(eye[across], spacing_), off_axis(point.position[across], spacing_)) <= kFacade + kFacadeDepth)
      return true;
  // Otherwise the ends are in two streets, and the line must stay over one of them at every step, that is turn at their
  // crossing.
  constexpr int kSteps = 12;
  for (int i = 1; i < kSteps; ++i) {
    const Eigen::Vector3d place = eye + sight * (static_cast<double>(i) / kSteps);
    if (std::min(off_axis(place.x(), spacing_), off_axis(place.y(), spacing_)) > kFacade + kFacadeDepth) return false;
  }
  return true;
}

}  // namespace megablock
