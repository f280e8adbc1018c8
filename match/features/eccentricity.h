// Corrects keypoints for their eccentricity: the image of the centre of a patch is not the centre of the patch's image.
//
// A keypoint lies where the image correlates best with a round kernel, so it stands for a whole neighbourhood. A camera
// maps neighbourhoods unevenly: away from the axis of a perspective image they are stretched outwards. Two cameras of a
// rig that look in different directions shift the same keypoint towards opposite sides of their images. All their
// intersections are then too near, and a rig with fixed mounts gives the block a wrong scale. (Measured on rendered
// images with f = 467 px: 0.02 px of parallax, 0.09 % of scale.)
#pragma once

#include <Eigen/Core>

#include "geometry/camera/intrinsics.h"
#include "io/block/features.h"

namespace megablock {

// Returns the offset (pixels) of a keypoint of this diameter from the image of its direction; subtract it. Zero where
// the camera has no ray for the pixel.
Eigen::Vector2d eccentricity_px(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel, double diameter_px);

// The corrected position of a keypoint in units of 2^-10 px, for the given camera.
struct FixedPixel {
  std::int32_t x, y;
};
FixedPixel without_eccentricity(const Intrinsics& intrinsics, const Keypoint& keypoint);

}  // namespace megablock
