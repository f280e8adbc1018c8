// Adjusts angles and image coordinates by the coplanarity of rays alone, with known positions and without ground
// points. It is the determinant method of Barrier and Martin, "Bundle adjustment with known positions", for comparison
// and for screening; the adjustment of ground points with priors (tile_adjustment.h) is better in every case.
//
// For every point and every pair of the cameras that see it, F = det(d_1 | d_2 | C_2 - C_1) = 0 (coplanarity.h). With A
// = dF/d(angles) and B = dF/d(image coordinates), a step solves in least squares
//
//     (A B) (da, dx) = -F,          with forcing also   lambda_a / sigma_a da = 0,   lambda_x / sigma_x dx = 0.
//
// Without forcing, angles and image coordinates together are never determined. K concurrent rays have 2K - 3 conditions
// (K - 1 where the cameras lie on one line), whatever the number of pairs. So (A B) of N points has the rank N (2K -
// 3), and 3N + 3K directions are free. LSQR then gives the solution of least norm, which need not be nearer to the
// truth; such solutions are marked. When angles are held that are wrong, image coordinates alone move away from the
// truth. The chi-square of the corrections shows this, and such solutions are marked too.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "adjust/coplanarity/coplanarity_rank.h"
#include "geometry/numbers/lsqr.h"

namespace megablock {

// The method as published makes one step. Further steps bring F to zero without coming nearer to the truth. Without
// forcing, LSQR finds the solution of least norm, in which radians and pixels count alike: 1e-6 rad costs nothing in
// this norm and moves a point of a satellite image by a pixel, so that the noise of the pixels goes into the angles.
struct CoplanarityOptions {
  enum class Solver : std::uint8_t {
    kLsqr,   // as published: it ends at twice the number of unknowns
    kDirect  // sparse QR; refuses a system that has no unique solution
  };
  Solver solver = Solver::kLsqr;
  LsqrOptions lsqr;
  double forcing_angles = 0, forcing_images = 0;  // lambda_a, lambda_x; 0: unforced. Published: 0.02
  double angle_sigma_rad = 1e-5, image_sigma_px = 0.1;
  int steps = 1;  // linearisations
  bool forced() const { return forcing_angles > 0 || forcing_images > 0; }
  void check() const;  // throws InputError
};

struct CoplanaritySolution {
  CoplanarityNetwork network;              // with corrected angles and image coordinates; held ones have the same bits
  double mean_before = 0, mean_after = 0;  // of |F|
  double rounding = 0;                     // largest change of this mean that rounding alone may cause
  std::int64_t iterations = 0;             // of LSQR, in all steps
  CoplanarityDiagnosis diagnosis;
  std::int64_t open_directions = 0;          // directions of the parameters that are neither determined nor forced
  bool rank_deficient = false;               // there are open directions: the solution is one of many
  bool held_contradicted = false;            // with held angles, the corrections are larger than the sigmas allow
  double chi2_per_freedom = 0;               // of the corrections, with the stated sigmas
  std::vector<std::string> remarks() const;  // one line each
};
// Throws InputError for a network or options that make no sense, and ComputeError when kDirect is asked for a system
// without a unique solution.
CoplanaritySolution adjust_by_coplanarity(const CoplanarityNetwork& network, const CoplanarityOptions& options);

}  // namespace megablock
