// Recommends a camera model for the images of a block (Cannelle 2013, 2.2: "the right one is the smallest whose
// residual field has no structure").
//
// Models of growing order are adjusted in turn to one set of observations with equal weights. Each trial adjusts poses,
// points, free mounts and cameras in least squares without a robust loss. The observations are chosen before, with the
// richest model, so that no trial chooses its own data. All cameras of the block get the model of the trial, and
// the residuals of each camera are tested separately (residual_structure.h). Among the models without structure in the
// residuals, the one with fewest parameters is recommended. The RMS cannot decide, because the largest model always has
// the lowest.
#pragma once

#include <string>
#include <vector>

#include "adjust/calibration/block_sample.h"
#include "adjust/calibration/residual_structure.h"
#include "adjust/tile/tile_adjustment.h"

namespace megablock {

// A camera model of whose radial terms only the first ones are estimated.
struct ModelCandidate {
  CameraModel model;
  ParameterMask free = 0;
  std::string name;  // "brown", "ign-radial/2": with two radial terms (and no decentring)
  int parameters() const { return count_of(free); }
};

// Throws InputError for a name that is no model or asks for more radial terms than the model has.
ModelCandidate find_candidate(const std::string& name);
// Candidates for a camera of this kind in the order of their parameters: fisheyes for fisheyes, else pinhole, radial
// corrections of one to three terms and more, Brown's model and parts of it, polynomials, Legendre polynomials, Fourier
// series, fisheye. Throws InputError for a stitched panorama, which has no lens.
std::vector<ModelCandidate> default_candidates(const CameraModel& given);

struct ModelComparisonOptions {
  AdjustOptions adjustment;
  BlockSampleOptions sample;
  double probability = 0.01;  // a field has structure when noise produces as much with a smaller probability
  int max_iterations = 60;    // of a trial
  void check() const;         // throws InputError
};

// One camera in a trial.
struct ModelFigures {
  Intrinsics camera;
  double rms_px = 0;  // of the lengths of the residuals
  ResidualStructure structure;
};

struct ModelTrial {
  ModelCandidate candidate;
  std::string failure;  // why there are no figures; empty: there are figures
  std::int64_t degrees_of_freedom = 0;
  double rms_px = 0, sigma_px = 0;    // of all cameras; sigma: per axis, from squares over degrees of freedom
  std::vector<ModelFigures> cameras;  // [ModelComparison::cameras]
};

struct ModelComparison {
  std::vector<CameraIndex> cameras;  // of the sample
  std::vector<ModelTrial> trials;    // by number of parameters
  // [cameras] The row of the recommended trial: the smallest model without structure. Where every model leaves
  // structure, it is the smallest model whose structure is within a tenth of the least.
  std::vector<int> recommended;
  std::vector<std::uint8_t> without_structure;  // [cameras] 0: every model leaves structure
  double probability = 0;
  std::int64_t frames = 0, images = 0, points = 0, observations = 0;
};

// `state` has the poses to start from. Outliers among the observations of `tracks` are screened out. Throws InputError
// when there is nothing to compare, ComputeError when no model can be adjusted.
ModelComparison compare_models(const Block& block, const BlockState& state, const TrackSet& tracks,
                               const std::vector<ModelCandidate>& candidates, const ModelComparisonOptions& options);

// One line per model: parameters, RMS, degrees of freedom, structure.
std::string comparison_table(const ModelComparison& comparison, std::size_t camera);
// A page with the table and the residual vectors over the sensor.
std::string comparison_page(const ModelComparison& comparison, const Block& block, const std::string& source);

}  // namespace megablock
