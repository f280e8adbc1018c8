// Gives the options of all stages. They are read from the sections of the project file and hashed into the fingerprints
// of the units.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "adjust/orientation/orientation.h"
#include "adjust/problem/environment_correction.h"
#include "adjust/tile/tile_adjustment.h"
#include "cluster/job/option_section.h"
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

// The options of the merge that a project file can set.
struct MergeSettings {
  int max_iterations = 50;   // iterations of the global adjustment between two screenings
  double decrement = 1e-4;   // Newton decrement at which the block is adjusted (no unit)
  int screening_rounds = 2;  // tests of all observations after convergence, each followed by an adjustment
  // Estimates the sigmas of positions, attitudes and relative poses from their residuals (adjust/tile/sigma_scales.h),
  // in at most ten adjustments.
  bool estimate_sigmas = false;
  // Multiplies the sigmas of positions and control points that the block contradicts by a factor of three and more
  // (adjust/tile/prior_scales.h).
  bool scale_contradicted_sigmas = true;
  bool scale_sigma = false;  // posterior sigmas multiplied by the a-posteriori sigma
  // Also computes the empirical sigmas (merge/tile/cluster_scores.h), in one further sweep up and down.
  bool empirical_sigmas = true;
  void check() const;  // throws InputError
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
  DiagnosticsOptions diagnostics;         // only for the report: no unit depends on them
  std::map<std::string, double> numbers;  // "section.key": of a stage that describes its own (option_section.h)
};

// The sections, for the table of the stages (cluster/job/stage.h).
extern const OptionSection kFeatureSection, kCandidateSection, kMatchingSection, kTileSection, kOrientationSection,
    kEnvironmentSection, kAdjustmentSection, kMergeSection, kDiagnosticsSection;

// The defaults with the values of the project file. Throws InputError with file:line for unknown keys and bad values.
JobOptions read_options(const StageSettings& settings);
// The options of the last run of a job.
JobOptions options_of_job(const JobStore& store);

// One option with its present value; lists of them are in the order of the stages.
struct OptionValue {
  std::string section, key, value;
};
std::vector<OptionValue> option_values(const JobOptions& options);

// Hashes the values that influence the results of a stage.
void add_to_hash(Hasher& hasher, const FeatureOptions& options);
void add_to_hash(Hasher& hasher, const CandidateOptions& options);
void add_to_hash(Hasher& hasher, const MatchOptions& options);
void add_to_hash(Hasher& hasher, const TileOptions& options);
void add_to_hash(Hasher& hasher, const OrientationOptions& options);
void add_to_hash(Hasher& hasher, const EnvironmentOptions& options);
void add_to_hash(Hasher& hasher, const AdjustOptions& options);
void add_to_hash(Hasher& hasher, const MergeSettings& options);

}  // namespace megablock
