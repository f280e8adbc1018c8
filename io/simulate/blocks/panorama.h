// Gives the rotations of a panorama, and the points of the published simulations of a camera that turns about a point
// (Cannelle 2013, 2.3.3).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "io/simulate/scene/layout.h"

namespace megablock {

// Rotations ground -> camera that cover the sphere around the horizon in three rows, whose pitches differ by half of
// the vertical field of view. The images of a row are evenly distributed over the circle. If they are too few to close
// it, they follow each other at `step` times the horizontal field of view.
std::vector<Eigen::Quaterniond> panorama_rotations(double horizontal_rad, double vertical_rad, std::int64_t images,
                                                   double step = 0.4);

// The vertices of an icosahedron that was subdivided `times` times: 10 * 4^times + 2 unit vectors.
// Each division replaces a triangle by four, whose new corners are the middles of its edges, moved to the sphere.
std::vector<Eigen::Vector3d> geodesic_sphere(int times);

Layout make_panorama_layout(const SimulationOptions& options);

}  // namespace megablock
