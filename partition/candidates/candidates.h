// Selects the candidate pairs of images, which are matched, and the cells in which they are matched.
//
// To match all pairs costs the square of the number of images. Candidates are the pairs that may overlap, according to
// positions, attitudes, order of acquisition, and similarity of the images; their number grows linearly.
#pragma once

#include <array>
#include <vector>

#include "io/block/block.h"
#include "io/block/image_graph.h"

namespace megablock {

struct CandidateOptions {
  int neighbours = 14;  // nearest images per image, by distance on the ground (footprint centres where known)
  // Images farther apart are no candidates, metres; 0 = no limit, -1 = 30 for rigs with known poses (Cannelle 2013),
  // else no limit.
  double max_pair_distance_m = -1;
  double max_view_angle_deg = 75;  // between viewing directions, where known, degrees; 180 = no limit
  int order_neighbours = 2;        // images before and after in the order of acquisition (time, else name)
  int descriptor_neighbours = 20;  // for images without a position
  int exhaustive_below = 300;      // a block without any position takes all pairs if it has fewer images
  int cell_pairs = 100;            // pairs per cell, the unit of work of matching (about 10 s)
  void check() const;              // throws InputError
};

// One unit vector per image (zero for an image without one), or an empty list: no descriptors.
using GlobalDescriptors = IndexedVector<ImageIndex, std::array<float, 128>>;

// Returns the candidate pairs of a block and their cells, by these rules:
//
// * Each image is paired with its nearest images on the ground and with its neighbours in the order of acquisition. The
//   latter always count, so that wrong GPS positions do not tear the graph. An image whose position is far off those
//   neighbours is also paired by its descriptor, and as if it stood between them.
// * Images of one frame of a rig are paired where their viewing cones overlap, never by distance.
// * Images of rigs of several cameras with known poses are paired camera by camera (Cannelle 2013): with images within
//   max_pair_distance_m whose viewing cones intersect. `neighbours` of them are taken, the most overlapping of each
//   visit to the place in turn. Among these images neither the order of acquisition nor max_view_angle_deg counts.
// * max_pair_distance_m limits the horizontal distance of the projection centres of pairs found by position. Pairs from
//   the order of acquisition and from descriptors have no limit, because they serve where positions are wrong or
//   missing.
//
// Pairs and cells do not depend on the order of the images in the block; ties are broken by name. Cells are fixed
// squares of the ground frame, halved where they hold too many pairs, so they do not move when the block grows. Throws
// InputError for impossible options, and ComputeError for a wrong number of descriptors.
CandidateGraph candidate_pairs(const Block& block, const GlobalDescriptors& global_descriptors,
                               const CandidateOptions& options);

// Adds the candidates of new images to a block that has candidates. The first `first_new_image` images are those of
// `previous`; its pairs and cells remain as they are, in the same order. Pairs with a new image form new cells after
// them. A pair of earlier images remains even if it would no longer be chosen.
CandidateGraph extend_candidates(const CandidateGraph& previous, const Block& block,
                                 const GlobalDescriptors& global_descriptors, const CandidateOptions& options,
                                 ImageIndex first_new_image);

}  // namespace megablock
