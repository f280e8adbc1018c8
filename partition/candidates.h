// Candidate pairs of images and the spatial cells in which they are matched.
#pragma once

#include <array>
#include <vector>

#include "io/block.h"
#include "io/image_graph.h"

namespace megablock {

struct CandidateOptions {
  int neighbours = 14;             // nearest images by ground distance (footprint centres where known) per image
  double max_pair_distance_m = 0;  // farther images are no candidates; 0 = no limit. CN-11: 30
  int order_neighbours = 2;        // neighbours before and after in the order of acquisition (time, else name)
  int descriptor_neighbours = 20;  // for images without position
  int exhaustive_below = 300;      // blocks without any position: all pairs when there are fewer images
  int cell_pairs = 400;            // pairs per cell, the unit of matching
  void check() const;              // throws InputError
};

// global_descriptors: one unit vector per image (zero: none). GPS outliers do not tear the graph: order of acquisition
// always links, and an image whose position is far off its acquisition neighbours is also linked by descriptors.
// Images of one frame (a rig) are paired by overlap of their viewing cones, never by distance.
CandidateGraph candidate_pairs(const Block& block,
                               const IndexedVector<ImageIndex, std::array<float, 128>>& global_descriptors,
                               const CandidateOptions& options);

}  // namespace megablock
