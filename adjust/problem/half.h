// Divides the observations of a block into two halves with independent errors. Two adjustments of them differ by their
// errors alone, so that the difference over its sigma shows whether the sigmas are true (a split test).
//
// Tie points are divided by fields of the images: tracks that begin in the same field of the same image are in the same
// half, which a hash of image and field says. Neighbours often have errors in common, and a keypoint may be there
// several times; divided track by track, both halves would have these errors, and their difference would not show them.
//
// All other observations are few, and the datum and many unknowns rest on them, so that each stays in both halves with
// an error of its own there. With
// the observation y of the sigma s, and u a random number of mean 0 and variance 1, the halves get
//
//     y_1 = y + s u,   y_2 = y - s u,   both with the sigma s sqrt 2.
//
// The two are independent if y is normal with the sigma s, and their mean is y (Rasines and Young 2022, "Splitting
// strategies for post-selection inference"; Leiner, Duan, Wasserman, Ramdas 2023, "Data fission"). Both halves
// together hold the information of y, no more and no less. Held values stay as they are. Lines and verticals are many,
// and are divided as tie points are.
//
// For the camera the images can be divided instead: the first and the second half of the frames of each rig, in the
// order of the block. Neighbours then stay together.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Whether a track that begins at this pixel of this image is in the half. `side`: the longer side of the image, px; an
// image has 12 fields along it. Always with Half::kNone and halves of images.
bool takes_track(Half half, ImageIndex image, double x, double y, double side);
// Whether a line or a vertical with these numbers is.
bool takes_row(Half half, std::initializer_list<std::int64_t> numbers);
// [frames] 1: in the half. Empty where no images are divided.
std::vector<std::uint8_t> frames_of_half(const Block& block, Half half);

// Gives the priors of a problem, and the image measurements of its control points, the errors of the half. The numbers
// that are drawn depend on the observation and on its frame, camera, mount or control point alone.
void divide_priors(Half half, TileProblem& problem);

}  // namespace megablock
