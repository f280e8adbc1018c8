// Eccentricity of keypoints: the image of a patch's centre is not the centre of the patch's image.
//
// A keypoint is where the image correlates best with a round kernel, so it stands for a neighbourhood, and a camera
// maps neighbourhoods unevenly: away from the axis of a perspective image they are stretched outwards. Two cameras of a
// rig that look in different directions shift the same keypoint towards opposite sides of their images; all their
// intersections are then too near, and a rig whose mounts are held gives the block a wrong scale (measured on rendered
// pictures with f = 467 px: 0.02 px of parallax, 0.09 % of scale).
#pragma once

#include <Eigen/Core>

#include "geometry/camera/intrinsics.h"
#include "io/block/features.h"

namespace megablock {

// How far the keypoint with this diameter lies from the image of its direction, px; to be subtracted. Zero where the
// camera gives the pixel no ray.
Eigen::Vector2d eccentricity_px(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel, double diameter_px);

// Position of a keypoint without it, 2^-10 px, with the camera as given.
struct FixedPixel {
  std::int32_t x, y;
};
FixedPixel without_eccentricity(const Intrinsics& intrinsics, const Keypoint& keypoint);

}  // namespace megablock
