// Writes the output of `register`: register/poses.csv, register/start.csv (the trajectory before),
// register/registrations.csv, and register/block.yaml with register/block.h5, a project that `run` adjusts.
#pragma once

#include "cluster/stages/registration/registration.h"

namespace megablock {

// The smallest weight in the joint adjustment at which a registration, or a position of the trajectory, counts as an
// inlier.
inline constexpr double kHolds = 0.25;

// The block for the following adjustment. Its given poses are the registered ones. Positions of the trajectory that the
// joint adjustment rejected are left out. The other positions, and the attitudes, get the sigmas of the joint
// adjustment, which allow for the correlation of errors over many frames. Registrations do not become relative poses of
// the block, because they come from the same tie points.
Block registered_block(const Block& block, const RegisteredTrajectory& registered, const JointOptions& joint);

// Call it on rank 0. `start`: [frames]; `tie_points`: file of given tracks, or empty.
void write_registration_outputs(const Job& job, const std::vector<Pose>& start,
                                const std::vector<RegisteredPlace>& rows, const RegisteredTrajectory& registered,
                                const JointOptions& joint, const std::string& tie_points);

}  // namespace megablock
