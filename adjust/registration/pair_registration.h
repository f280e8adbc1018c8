// Gives the relative pose of two passes from two successive frames of each, A and B of one and C and D of the other,
// and from the points that all four see: the 2x2 registration of Cannelle 2013.
//
// Everything is expressed in the axes of A. The unknowns are the poses of B, C and D and the points; A is held. Each
// pair is tied by the trusted relative pose of the trajectory,
//
//     Log(R_B R_AB') / s_r, (C_B - T_AB) / s_t        and likewise D from C,
//
// or held by it (s = 0), as published. Residuals are in pixels (geometry/resection/rig_ray.h). Points are eliminated
// (Schur complement). Twenty iterations have a threshold that falls geometrically to its last value; observations
// within it have Cauchy weights with half of it as scale.
//
// The published start is the pose of the trajectory with a threshold of 200 px. Here A and B intersect the points
// first, RANSAC resects the rig of C and D from them (adjust/resection/rig_resection.h, with the covariances of the
// points in the weights), and the threshold begins at `robust_threshold_px`. Where that fails, the published start is
// taken.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "geometry/resection/rig_ray.h"
#include "io/block/registration.h"

namespace megablock {

// A point seen in the frames 0..3 = A, B, C, D; a frame may see it in two cameras.
struct FourFrameTrack {
  struct View {
    std::int32_t frame = 0;
    RigRay ray;
  };
  std::vector<View> views;
};

// Iterations, first and last threshold, four frames for every point and "more than 20" observations are the values of
// Cannelle 2013.
struct PairRegistrationOptions {
  int iterations = 20;
  double first_threshold_px = 200;  // with the trajectory as start
  double last_threshold_px = 3;
  bool robust_start = true;               // by resection; false: the published start
  double robust_threshold_px = 20;        // first threshold after a robust start
  int samples = 300;                      // samples of three points
  double image_sigma_px = 0.5;            // per axis
  double pair_position_sigma_m = 0.005;   // of the relative pose of successive frames, per axis; 0: held
  double pair_rotation_sigma_deg = 0.01;  // 0: held
  int min_frames = 4;                     // number of the four frames that must see a point, 3 or 4
  int min_tracks = 6;                     // tracks that so many frames must see
  int min_measurements = 21;              // observations that must remain ("more than 20")
  double min_kept_share = 0.3;            // share of the observations that must remain
  double max_position_sigma_m = 0.02;     // of the relative pose, length; a larger one is refused
  double max_rotation_sigma_deg = 0.02;
  double max_shift_m = 10;  // from the relative pose of the trajectory; a larger one is refused
  double max_turn_deg = 5;
  void check() const;  // throws InputError
};

// `frames` holds approximate poses (ground -> rig) of A, B, C and D; B relative to A and D relative to C are trusted.
// Tracks that fewer than `min_frames` of the frames see are not used. Deterministic: random samples depend on `seed`
// alone.
PairRegistration register_pair(const std::array<Pose, 4>& frames, const std::vector<FourFrameTrack>& tracks,
                               const PairRegistrationOptions& options, std::uint64_t seed);

// The registration of points on points of Cannelle 2013, for comparison: the rigid transformation between the points
// that A and B intersect and those that C and D intersect. Returns the relative pose A -> C, or nothing with fewer than
// three points. It is not usable where the points are far away compared with the base.
std::optional<Pose> register_3d_3d(const std::array<Pose, 4>& frames, const std::vector<FourFrameTrack>& tracks,
                                   std::uint64_t seed);

}  // namespace megablock
