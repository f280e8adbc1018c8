// Registers a trajectory, in four stages of a job: register/rig.h5 (one unit, where cameras or mounts are free),
// register/places.h5 (one unit), register/pairs/<n>.h5 (some hundred places each, claimed by the ranks), and
// register/trajectory.h5 (one unit).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "adjust/registration/pair_registration.h"
#include "adjust/registration/rig_estimate.h"
#include "adjust/registration/trajectory.h"
#include "cluster/job/job.h"
#include "cluster/job/job_record.h"
#include "io/block/tracks.h"
#include "partition/candidates/places.h"

namespace megablock {

struct RegistrationSettings {
  bool estimate_rig = true;  // first estimates free cameras and mounts from the tracks along the passes
  RigEstimateOptions rig;
  PlaceOptions places;
  PairRegistrationOptions pairs{.min_frames = 3};
  TrajectoryOptions trajectory;
  JointOptions joint;
  bool use_registrations = true;  // false: only relative poses of successive frames and absolute observations
  bool use_resections = false;    // uses resections of frames that see three control points or more
  int units_places = 250;         // places in a unit
  void check() const;             // throws InputError
};

// The tracks of the block, which are read when they are first needed. `fingerprint` is that of all tracks.
struct TrackSource {
  std::string file;  // file of given tracks; empty: tracks of the job
  std::uint64_t fingerprint = 0;
  std::function<TrackSet()> read;
  // Units of the verified pairs from which the tracks were built; empty for given tracks.
  std::vector<std::string> matches;
};

struct RegistrationSummary {
  std::int64_t frames = 0, chain = 0, places = 0, accepted = 0, different = 0, used = 0, resections = 0, points = 0;
  std::string rig;  // the outcome for cameras and mounts, in words
  // The first of the reasons that differ in their numbers alone, and how many there are.
  using Reasons = std::vector<std::pair<std::string, std::int64_t>>;
  Reasons refusals, not_resected;
  double median_move_m = 0, largest_move_m = 0;  // movements of frames from the start
  std::vector<std::string> check_points;         // one line each
  double check_rms_m = 0;                        // of check points adjusted as tie points; 0: there are none
  std::vector<std::string> notes;                // on the trajectory: gaps, copies
  std::uint64_t digest = 0;                      // hash of the bits of the trajectory
};

// Collective. `block`: that of the job; a rig that is estimated goes into it. Rank 0 also writes register/poses.csv,
// register/registrations.csv, and register/block.yaml with register/block.h5 (registration_output.h).
RegistrationSummary run_registration(const Job& job, JobRecord& record, Block& block, const TrackSource& tracks,
                                     const RegistrationSettings& settings);

std::string to_text(const RegistrationSummary& summary);

}  // namespace megablock
