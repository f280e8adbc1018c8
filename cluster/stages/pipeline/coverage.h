// Runs the stage of coverage. It makes coverage/<tile>.txt, the cover of each image of a tile by its tie points, and
// result/coverage.csv, the sum for every image of the block. An image whose tie points lie in one corner is badly
// determined; the table names it before anything is adjusted.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "cluster/job/option_section.h"
#include "cluster/job/stage.h"
#include "io/block/block.h"
#include "io/block/tracks.h"

namespace megablock {

// coverage.min_share: a note names the images with a smaller covered_share().
extern const OptionSection kCoverageSection;

// The tie points of an image.
struct ImageCoverage {
  std::int64_t observations = 0;
  std::int64_t images_of_points = 0;  // sum over the observations: the images that see the tie point, this one included
  std::uint16_t cells = 0;            // of a grid of 4 x 4 over the image: a bit for each cell with an observation

  double covered_share() const;  // cells with an observation / all cells
  void add(const ImageCoverage& other);
};

// Of the images that the tracks name.
std::map<ImageIndex, ImageCoverage> coverage_of(const TrackSet& tracks, const Block& block);

// The note on images with tie points in too small a share of their area; empty: there are none. `names`: of all images.
std::string coverage_note(const IndexedVector<ImageIndex, ImageCoverage>& coverage, const NameTable<ImageIndex>& names,
                          double min_share);

// Throws StoreError or InputError where the job has coverage of its tiles, but its table is missing, is no table, or is
// not that of the images of the block.
void check_coverage(const JobStore& store);

// Collective. `tracks`: units by tile.
void run_coverage(const Stage& stage, const Job& job, JobRecord& record, const std::vector<std::string>& tracks);

}  // namespace megablock
