// Divides the observations of a block into two halves with independent errors. Two adjustments of them differ by their
// errors alone, so that the difference over its sigma shows whether the sigmas are true (a split test).
//
// Tie points are divided by the middle image of their tracks: of two images that follow each other, the tracks of the
// one are in the first half, those of the other in the second half; a hash says which. Divisions of even and odd number
// pair the images differently, 0 with 1 or 1 with 2. Tracks of one image often have errors in common, neighbours most
// of all. Divided track by track or by fields of the images, both halves would have these errors, and their difference
// would not show them. Divided by their first image, one half would lack the first image of the block, and the halves
// of a small block would differ much in size: a third of all tracks of 11 images begins in the first.
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
// One division leaves much to chance in a block of few images. Further divisions, with other hashes, tell more.
//
// For the camera the images can be divided instead: the first and the second half of the frames of each rig, in the
// order of the block. Neighbours then stay together.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <vector>

#include "adjust/problem/tile_problem.h"

namespace megablock {

// Whether a track with this middle image is in the half. Always true without a half and with halves of images.
bool takes_track(const HalfChoice& choice, ImageIndex middle);
// Whether a line or a vertical with these numbers is.
bool takes_row(const HalfChoice& choice, std::initializer_list<std::int64_t> numbers);
// [frames] 1: in the half. Empty where no images are divided.
std::vector<std::uint8_t> frames_of_half(const Block& block, Half half);

// Gives the priors of a problem, and the image measurements of its control points, the errors of the half. The numbers
// that are drawn depend on the observation and on its frame, camera, mount or control point alone.
void divide_priors(const HalfChoice& choice, TileProblem& problem);

}  // namespace megablock
