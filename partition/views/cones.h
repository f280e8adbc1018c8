// Viewing cones of images whose place and attitude are known: whether two of them can see the same things (CN-11).
#pragma once

#include <vector>

#include "io/block/block.h"

namespace megablock {

class ViewingCones {
 public:
  // Of images of rigs of several cameras with given pose, or position and attitude prior. `range_m`: how far they see.
  ViewingCones(const Block& block, double range_m);

  bool has(ImageIndex image) const { return cones_[image].known; }
  const Eigen::Vector3d& centre(ImageIndex image) const { return cones_[image].camera.centre; }

  // 0 to 1; 0: the cones do not intersect. Of sample points of either cone, near ones and far ones alike, those that
  // the other image sees count the more the less the two directions differ; from 60 degrees on they do not count.
  double overlap(ImageIndex a, ImageIndex b) const;

 private:
  struct Cone {
    bool known = false;
    Pose camera;  // ground -> camera
    CameraIndex of;
  };
  struct Shape {
    std::vector<Eigen::Vector3d> samples;  // camera axes, metres
    bool wide = false;                     // fisheye, panorama: limited by its angle, else by the image's sides
    double cosine = 0;                     // of half the opening angle
    Eigen::Vector2d low, high;             // of X/Z, Y/Z
  };
  bool sees(const Cone& cone, const Eigen::Vector3d& point) const;
  double seen_share(const Cone& from, const Cone& by) const;

  double range_m_;
  IndexedVector<ImageIndex, Cone> cones_;
  IndexedVector<CameraIndex, Shape> shapes_;
};

}  // namespace megablock
