// Describes cameras that read the rows of an image one after the other while they move (rolling shutter).
//
// The readout takes T seconds from the first row to the last, and the pose of an image is that in the middle of it. Row
// y of an image of the height H is read at the time
//
//     t = (y / H - 1/2) T,
//
// when the frame, which moves with the velocity v and turns with the angular velocity W (both in ground axes), has the
// pose
//
//     C(t) = C + t v,   R(t) = R Exp(-t W).
//
// A moving camera thus sees a point where it would see it from there. Conversely, a ray measured in row y leaves the
// camera at C(t); together with the distance of its point it gives the pixel in which a still camera would see this
// point. T is negative where the last row is read first. The motion is taken as constant during the readout, which
// takes some hundredths of a second (Vautherin et al., "Photogrammetric accuracy and modeling of rolling shutter
// cameras", ISPRS Annals III-3, 2016).
#pragma once

#include "geometry/camera/intrinsics.h"
#include "geometry/transform/pose.h"

namespace megablock {

struct Motion {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // metres per second, ground axes
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();      // radians per second about it, right-handed, ground axes
};

// The pose of a frame t seconds later.
Pose moved(const Pose& frame, const Motion& motion, double t);

struct Readout {
  double time_s = 0;  // of all rows; negative: from the last row to the first
  double height_px = 1;
  double time_of_row(double y) const { return (y / height_px - 0.5) * time_s; }  // from the middle of the readout
};

// An image of a moving rig.
struct MovingView {
  const Intrinsics& camera;
  const Pose& frame;
  const Pose& mount;
  const Motion& motion;
  Readout readout;
};

// The pixel in which the moving camera sees a ground point. NaN where it does not see it, or where it moves so fast
// that no single row shows it.
Eigen::Vector2d moving_pixel(const MovingView& view, const Eigen::Vector3d& point);

// By how much motion moves the pixel of a ground point: moving_pixel() minus the pixel of the camera at rest. NaN where
// there is no such pixel.
Eigen::Vector2d rolling_shift(const MovingView& view, const Eigen::Vector3d& point);

// The pixel in which the camera at rest would see a point of which only the distance is known: `pixel` is where the
// moving camera sees it, so far (metres) from its centre at that row. NaN where the camera has no ray for the pixel, or
// no pixel for the point.
Eigen::Vector2d still_pixel(const MovingView& view, const Eigen::Vector2d& pixel, double distance);

}  // namespace megablock
