// Runs `megablock merge --monolithic`, which compares a finished job with one monolithic adjustment of the same
// observations.
//
// It reads poses, kept observations and priors of the job's result as one tile, and gives:
//
//  * max_pose_difference_sigmas: the largest component of the undamped Newton step of one monolithic problem at the
//    job's solution, over its posterior sigma. Jacobian and gradient come from the automatic derivatives of Ceres. For
//    more than 2 500 frames the sigma is that of the job, because the covariance of the monolithic problem is dense (2
//    GiB for so many);
//  * relative_cost_difference: how far Ceres lowers the cost from there with all tolerances 1e-16;
//  * single_tile_pose_difference_sigmas: the single tile is adjusted by the project's own merge, from a start that is
//    off by a tenth of the sigmas, to a decrement of 1e-6. The figure is the largest difference of a pose from that of
//    the job, over its sigma. It is not computed for blocks with a free datum, because that depends on the start.
//
// Measured control points count as kept where the result has a finite residual of at most 4 sigmas.
#pragma once

#include <string>

#include "adjust/problem/tile_problem.h"
#include "io/store/job/job_store.h"

namespace megablock {

// One line of JSON: the figures above, counts of images, tiles, points and observations, the Newton decrement and the
// dimension of a free datum. Throws InputError when the job has no result.
std::string compare_with_monolithic(const JobStore& store);

// The options of tie points and priors, as the project of a job gives them.
ObservationOptions observation_options(const JobStore& store);

}  // namespace megablock
