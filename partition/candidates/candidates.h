// Candidate pairs of images and the spatial cells in which they are matched.
#pragma once

#include <array>
#include <vector>

#include "io/block/block.h"
#include "io/block/image_graph.h"

namespace megablock {

struct CandidateOptions {
  int neighbours = 14;              // nearest images by ground distance (footprint centres where known) per image
  double max_pair_distance_m = -1;  // farther images are no candidates; 0 = no limit, -1 = 30 for rigs whose poses are
                                    // known (CN-11), else no limit
  double max_view_angle_deg = 75;   // between viewing directions, where known; 180 = no limit
  int order_neighbours = 2;         // neighbours before and after in the order of acquisition (time, else name)
  int descriptor_neighbours = 20;   // for images without position
  int exhaustive_below = 300;       // blocks without any position: all pairs when there are fewer images
  int cell_pairs = 100;             // pairs per cell, the unit of matching (about 10 s of work)
  void check() const;               // throws InputError
};

// One unit vector per image (zero: none), or empty: no descriptors.
using GlobalDescriptors = IndexedVector<ImageIndex, std::array<float, 128>>;

// GPS outliers do not tear the graph: order of acquisition always links, and an image whose position is far off its
// acquisition neighbours is also linked by descriptors and as if it stood between those neighbours. Images of one frame
// (a rig) are paired by overlap of their viewing cones, never by distance.
//
// Images of rigs of several cameras with known poses are paired camera by camera (CN-11): with those within
// max_pair_distance_m whose viewing cones intersect, `neighbours` of them, the most overlapping of each visit to the
// place in turn. Neither the order of acquisition nor max_view_angle_deg plays a part among them.
//
// max_pair_distance_m limits the horizontal distance of projection centres of pairs found by position; pairs from the
// order of acquisition and from descriptors are kept, since they are there for positions that are wrong or missing.
//
// Pairs and cells do not depend on the order in which images are listed (ties are broken by name); cells are fixed
// squares of the ground frame, halved where they hold too many pairs, so that they do not move with the block's extent.
CandidateGraph candidate_pairs(const Block& block, const GlobalDescriptors& global_descriptors,
                               const CandidateOptions& options);

// Adds images to a block that has candidates: the first `first_new_image` images are those of `previous`, whose pairs
// and cells stay as they are (in the same order); pairs with a new image form new cells after them. A pair of former
// images that would no longer be chosen stays.
CandidateGraph extend_candidates(const CandidateGraph& previous, const Block& block,
                                 const GlobalDescriptors& global_descriptors, const CandidateOptions& options,
                                 ImageIndex first_new_image);

}  // namespace megablock
