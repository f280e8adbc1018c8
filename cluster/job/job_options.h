// The options of all stages: read from the project file's sections, hashed into the fingerprints of the units.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "adjust/orientation/orientation.h"
#include "adjust/problem/environment_correction.h"
#include "adjust/tile/tile_adjustment.h"
#include "io/base/hash.h"
#include "io/block/block_diagnostics.h"
#include "io/project/project.h"
#include "io/store/job/job_store.h"
#include "match/features/features.h"
#include "match/pairs/pair_matching.h"
#include "match/tracks/tracks.h"
#include "partition/candidates/candidates.h"
#include "partition/tiles/tiles.h"

namespace megablock {

// Options of the merge that a project file can set.
struct MergeSettings {
  int max_iterations = 50;   // global Levenberg-Marquardt steps per round
  double decrement = 1e-4;   // Newton decrement at which the block is adjusted
  int screening_rounds = 2;  // re-tests of kept/rejected after convergence
  // Sigmas of positions, attitudes and relative poses from their residuals (adjust/tile/sigma_scales.h), in at most ten
  // rounds.
  bool estimate_sigmas = false;
  bool scale_sigma = false;  // posterior sigmas multiplied by the a-posteriori sigma
  void check() const;        // throws InputError
};

struct JobOptions {
  FeatureOptions features;
  CandidateOptions candidates;
  MatchOptions matching;
  TrackOptions tracks;
  TileOptions tiles;
  OrientationOptions orientation;
  EnvironmentOptions environment;
  AdjustOptions adjustment;
  MergeSettings merge;
  DiagnosticsOptions diagnostics;  // of the report alone: no unit depends on them
};

// Defaults, overridden by the project file; InputError with file:line for unknown keys and bad values.
JobOptions read_options(const StageSettings& settings);
// Those that a job was last run with.
JobOptions options_of_job(const JobStore& store);

// The values in force, in the order of the docs.
struct OptionValue {
  std::string section, key, value;
};
std::vector<OptionValue> option_values(const JobOptions& options);

// The values that matter to a stage's results.
void add_to_hash(Hasher& hasher, const FeatureOptions& options);
void add_to_hash(Hasher& hasher, const CandidateOptions& options);
void add_to_hash(Hasher& hasher, const MatchOptions& options);
void add_to_hash(Hasher& hasher, const TileOptions& options);
void add_to_hash(Hasher& hasher, const OrientationOptions& options);
void add_to_hash(Hasher& hasher, const EnvironmentOptions& options);
void add_to_hash(Hasher& hasher, const AdjustOptions& options);
void add_to_hash(Hasher& hasher, const MergeSettings& options);

}  // namespace megablock
