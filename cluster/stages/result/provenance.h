// Gives the provenance of a result: program, options and images.
#pragma once

#include <functional>
#include <string>

#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "merge/plan/unknowns.h"

namespace megablock {

// The program, the arithmetic level and the options in force.
Provenance provenance_of(const Job& job);

// Size, features and matches of every image, from the files of the job; empty for a block of given tie points.
IndexedVector<ImageIndex, ImageRecord> image_records(const Job& job, const JobRecord& record);

// The name of an unknown for users: "image 'a.jpg'", "frame 'f12'" (of a rig), "camera 'left'", "mount 2 of rig 'car'".
std::function<std::string(const UnknownId&)> names_of(const Block& block);

}  // namespace megablock
