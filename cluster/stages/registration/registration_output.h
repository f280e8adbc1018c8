// What `register` leaves for people and for other commands: register/poses.csv, register/start.csv (the trajectory as
// it was), register/registrations.csv, and register/block.yaml with register/block.h5, a project that `run` adjusts.
#pragma once

#include "cluster/stages/registration/registration.h"

namespace megablock {

// Weight of the joint adjustment from which a registration, or a position of the trajectory, counts as right.
inline constexpr double kHolds = 0.25;

// The block as it is adjusted from here: given poses are the registered ones. Positions of the trajectory that the
// joint adjustment found wrong are left out; the others, and its attitudes, get the sigmas with which they took part
// there (errors change over many frames, so that each counts for a part). Registrations are not among the relative
// poses: they were made of the same tie points.
Block registered_block(const Block& block, const RegisteredTrajectory& registered, const JointOptions& joint);

// By rank 0. `start`: [frames]; `tie_points`: file of given tracks, or empty.
void write_registration_outputs(const Job& job, const std::vector<Pose>& start,
                                const std::vector<RegisteredPlace>& rows, const RegisteredTrajectory& registered,
                                const JointOptions& joint, const std::string& tie_points);

}  // namespace megablock
