// A camera turned about a point: the rotations of a panorama and the cameras and points of the published simulations
// (Cannelle 2013, 2.3.3).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "geometry/camera/intrinsics.h"

namespace megablock {

// Simulated cameras of the thesis, all of the model ign-radial. Its table prints b of the third with a minus and sy of
// the fourth as 3709; neither agrees with the edge corrections it prints.
struct PublishedCamera {
  const char* name;
  int width, height;  // px
  Intrinsics truth;
  double edge_px;  // published edge correction
};
const std::vector<PublishedCamera>& published_cameras();

// Rotations ground -> camera that cover the sphere's girdle: three rows, pitched by half of the vertical field of view,
// each with the images evenly around the circle, or, when these are too few to close it, at steps of `step` of the
// horizontal field of view.
std::vector<Eigen::Quaterniond> panorama_rotations(double horizontal_rad, double vertical_rad, std::int64_t images,
                                                   double step = 0.4);

// Vertices of the icosahedron subdivided `times` times, unit vectors: 10 * 4^times + 2.
std::vector<Eigen::Vector3d> geodesic_sphere(int times);

}  // namespace megablock
