// Runs a whole job, from the project file to the merged block.
#pragma once

#include <string>
#include <vector>

#include "cluster/job/job.h"
#include "cluster/mpi/communicator.h"
#include "cluster/stages/pipeline/calibration.h"
#include "cluster/stages/registration/registration.h"

namespace megablock {

// Collective. Brings the job up to date as far as options.last_stage, and returns the exit code (kExitDone or
// kExitFailedUnits). Throws the errors of the project, the same on every rank.
int run_job(const RunOptions& options, Communicator& ranks);

// Collective. Opens the same kind of job, brings its tracks up to date and registers its trajectory
// (registration/registration.h).
int register_job(const RunOptions& options, const RegistrationSettings& settings, Communicator& ranks);

// Collective. Opens the same kind of job, brings its tracks and poses up to date and calibrates its rigs
// (pipeline/calibration.h).
int calibrate_job(const RunOptions& options, const CalibrationSettings& settings, Communicator& ranks);

}  // namespace megablock
