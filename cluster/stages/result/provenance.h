// What a result says of its origin besides the adjustment itself.
#pragma once

#include <functional>
#include <string>

#include "cluster/job/job.h"
#include "merge/plan/unknowns.h"

namespace megablock {

// Program, arithmetic level and the options in force.
Provenance provenance_of(const Job& job);

// Size, features and matches of every image, from the job's files; empty when the block was given by tie points.
IndexedVector<ImageIndex, ImageRecord> image_records(const Job& job);

// Unknowns as the user calls them: "image 'a.jpg'", "frame 'f12'" (of a rig), "camera 'left'", "mount 2 of rig 'car'".
std::function<std::string(const UnknownId&)> names_of(const Block& block);

}  // namespace megablock
