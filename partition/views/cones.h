// Gives the viewing cones of images with known position and attitude. They tell whether two images can see the same
// objects (Cannelle 2013).
#pragma once

#include <vector>

#include "io/block/block.h"

namespace megablock {

class ViewingCones {
 public:
  // Makes the cones of images of rigs with several cameras whose frames have a given pose, or a position and an
  // attitude prior. `range_m` is how far the cameras see.
  ViewingCones(const Block& block, double range_m);

  bool has(ImageIndex image) const { return cones_[image].known; }
  const Eigen::Vector3d& centre(ImageIndex image) const { return cones_[image].camera.centre; }

  // The overlap of two cones, 0 to 1; 0 where they do not intersect or one is unknown. Sample points of each cone, near
  // and far, are projected into the other image. A point that it sees counts 1 - (angle between the two
  // directions) / 60 degrees, at least 0.
  double overlap(ImageIndex a, ImageIndex b) const;

 private:
  struct Cone {
    bool known = false;
    Pose camera;  // ground -> camera
    CameraIndex of;
  };
  // The shape of the cone of a camera.
  struct Shape {
    std::vector<Eigen::Vector3d> samples;  // sample points, camera axes, metres
    bool wide = false;          // fisheye, panorama: limited by the opening angle, others by the sides of the image
    double cosine = 0;          // of half the opening angle
    Eigen::Vector2d low, high;  // limits of X/Z and Y/Z
  };
  bool sees(const Cone& cone, const Eigen::Vector3d& point) const;
  double seen_share(const Cone& from, const Cone& by) const;

  double range_m_;
  IndexedVector<ImageIndex, Cone> cones_;
  IndexedVector<CameraIndex, Shape> shapes_;
};

}  // namespace megablock
