// `megablock merge --monolithic`: compares a finished job with one monolithic adjustment of the same observations.
//
// Poses, kept observations and priors of the job's result are read as one tile:
//
// * max_pose_difference_sigmas: largest component of the undamped Newton step of one monolithic problem at the job's
//   solution (Jacobian and gradient by Ceres' automatic derivatives) over its posterior sigma. For more than 2 500
//   frames the sigma is that of the job, because the covariance of the monolithic problem is dense (2 GiB for so many);
// * relative_cost_difference: how far Ceres lowers the cost from there with all tolerances 1e-16;
// * single_tile_pose_difference_sigmas: the single tile adjusted by our own merge from a start that is off by a tenth
//   of the sigmas, to a decrement of 1e-6; largest difference of a pose to the job's over its sigma. Not for blocks
//   with a free datum, which depends on the start.
//
// Measured control points are taken as kept where the result has a finite residual of at most 4 sigmas.
#pragma once

#include <string>

#include "adjust/problem/tile_problem.h"
#include "io/store/job/job_store.h"

namespace megablock {

// One line of JSON: the figures above, counts of images, tiles, points and observations, the Newton decrement and the
// dimension of a free datum. InputError when the job has no result.
std::string compare_with_monolithic(const JobStore& store);

// Of the tie points and priors of a job, as its project gives them.
ObservationOptions observation_options(const JobStore& store);

}  // namespace megablock
