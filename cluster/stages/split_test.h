// Adjusts a finished job from two halves of its observations and compares the results: a proof of the sigmas that needs
// no truth (adjust/problem/half.h, io/evaluation/halves.h).
//
// Each half is a job of its own in the folder "halves" of the job. It shares the files of all stages before the
// adjustment by hard links, so that only adjustment and merge run, over the same tiles and tree as in the job. The
// folder is removed afterwards. For the camera, halves of the images are adjusted in the same way.
#pragma once

#include <cstdint>
#include <string>

#include "cluster/job/job.h"
#include "io/evaluation/halves.h"

namespace megablock {

struct SplitTestOptions {
  // Divisions of the tie points, each with two adjustments. The figures are those of all of them together. 0: 16 for up
  // to 50 images, where one division leaves much to chance, else 4.
  std::int64_t divisions = 0;
  bool quiet = false;  // no line for each half
  void check() const;  // throws InputError
};

// Collective. `options.directory` is the finished job. Returns the comparison on the first rank. Throws InputError.
HalvesComparison run_split_test(const RunOptions& options, const SplitTestOptions& test, Communicator& ranks);

}  // namespace megablock
