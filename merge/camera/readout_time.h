// Estimates the readout time of a camera with a rolling shutter from a sample of its images.
//
// A correction is proportional to the readout time T (adjust/problem/rolling_shutter_correction.h), so that the cost of
// the adjusted sample is a parabola in T. Three adjustments of the same observations at T - d, T and T + d give its
// minimum and the sigma of T,
//
//     F' = (F+ - F-) / 2d,   F'' = (F+ - 2 F0 + F-) / d^2,   T <- T - F' / F'',   sigma^2 = s0^2 / F'',
//
// with F half the sum of the squared weighted residuals and s0^2 = 2 F0 / degrees of freedom. This is the least-squares
// estimate with T as an unknown beside all others. It is repeated, because a better T keeps more observations.
#pragma once

#include <string>

#include "adjust/tile/tile_adjustment.h"

namespace megablock {

struct ReadoutEstimate {
  double time_s = 0;
  double sigma_s = 0;   // 0: the images do not determine it
  std::string failure;  // why not; empty otherwise
};

// `state` is oriented for the frames of the sample alone, and `tracks` has observations in these frames. `readout_s`
// [cameras of the block]: readout times, that of `camera` to begin with. Throws ComputeError when the sample cannot be
// adjusted. Deterministic.
ReadoutEstimate estimate_readout(const Block& block, const BlockState& state, const TrackSet& tracks,
                                 IndexedVector<CameraIndex, double> readout_s, CameraIndex camera,
                                 const AdjustOptions& options);

// The readout time with which a camera is corrected, and why.
struct ReadoutChoice {
  double time_s = 0;
  std::string reason;
};

// What the images say counts if it is three sigmas from zero. It must also confirm what a table of cameras says
// (`expected_s`; 0: nothing is expected) to a half: a drone that stops for each image has the shutter of the table,
// but not the motion that its path tells.
ReadoutChoice choose_readout(const ReadoutEstimate& found, double expected_s);

}  // namespace megablock
