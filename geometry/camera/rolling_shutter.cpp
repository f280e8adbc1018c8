#include "geometry/camera/rolling_shutter.h"

#include <cmath>
#include <limits>

#include "geometry/camera/camera.h"

namespace megablock {

Pose moved(const Pose& frame, const Motion& motion, double t) {
  return {rotation_update(frame.rotation, -t * motion.turn), frame.centre + t * motion.velocity};
}

namespace {

Eigen::Vector2d pixel_at(const MovingView& view, double t, const Eigen::Vector3d& point) {
  return project(view.camera, to_camera(moved(view.frame, view.motion, t), view.mount, point));
}

}  // namespace

// Fixed-point iteration on the row. It contracts by the rows that the image moves while one row is read, which is far
// below 1 for anything but a camera that is overtaken by what it sees.
Eigen::Vector2d moving_pixel(const MovingView& view, const Eigen::Vector3d& point) {
  constexpr int kMostSteps = 50;
  constexpr double kEnoughPx = 1e-9;
  Eigen::Vector2d pixel = pixel_at(view, 0, point);
  for (int step = 0; step < kMostSteps && pixel.allFinite(); ++step) {
    const Eigen::Vector2d next = pixel_at(view, view.readout.time_of_row(pixel.y()), point);
    const bool enough = (next - pixel).norm() < kEnoughPx;
    pixel = next;
    if (enough) return pixel;
  }
  return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
}

Eigen::Vector2d rolling_shift(const MovingView& view, const Eigen::Vector3d& point) {
  return moving_pixel(view, point) - pixel_at(view, 0, point);
}

Eigen::Vector2d still_pixel(const MovingView& view, const Eigen::Vector2d& pixel, double distance) {
  const std::optional<Eigen::Vector3d> ray = viewing_ray(view.camera, pixel);
  if (!ray) return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  const Pose then = camera_pose(moved(view.frame, view.motion, view.readout.time_of_row(pixel.y())), view.mount);
  const Eigen::Vector3d point = then.centre + distance * (then.rotation.conjugate() * ray->normalized());
  return pixel_at(view, 0, point);
}

}  // namespace megablock
