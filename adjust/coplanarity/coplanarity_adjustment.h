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

#include "geometry/numbers/lsqr.h"
#include "geometry/two_view/coplanarity.h"

namespace megablock {

// Cameras of one focal length (px) without distortion. Image coordinates are relative to the principal point.
// Observations of point j are rows [begin[j], begin[j + 1]); the cameras of a point are distinct.
struct CoplanarityNetwork {
  double focal_px = 0;
  std::vector<Eigen::Vector3d> centres;  // [cameras] ground frame, m
  std::vector<XyzAngles> angles;         // [cameras]
  std::vector<std::int64_t> begin{0};    // [points + 1]
  std::vector<std::int32_t> camera;      // [observations]
  std::vector<Eigen::Vector2d> image;    // [observations] px
  // 1 = held. Empty: all free.
  std::vector<std::uint8_t> angles_held;  // [3 x cameras]
  std::vector<std::uint8_t> images_held;  // [2 x observations]

  std::int64_t point_count() const { return static_cast<std::int64_t>(begin.size()) - 1; }
  void check() const;  // throws InputError
};

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

// The rank and the condition of the equations of the free angles and image coordinates. They are evaluated at rays that
// were made to meet, because noise would raise the ranks. Points whose rays do not meet in front of their cameras are
// left out.
struct CoplanarityDiagnosis {
  std::int64_t rows = 0, columns = 0, rank = 0;  // of (A B)
  std::int64_t image_rank = 0;                   // of B
  // Whether the cameras of every point that three or more see lie on one line (straight_line.h); false without such
  // points.
  bool collinear = false;
  std::vector<double> angle_values;  // singular values of A (free angles), descending
  std::int64_t nullity() const { return columns - rank; }
  double angle_condition() const;  // infinite where A is singular; 1 without free angles
};
CoplanarityDiagnosis diagnose(const CoplanarityNetwork& network);

// The singular values above zero of A, B and (A B), m px^2 per radian and per pixel, descending, for the free
// parameters at the rays that meet. Their numbers are the ranks; their squares are the values that the report plots for
// A'A, B'B and M'M. The computation is dense, for the scenes of the report: it takes seconds for 1 000 parameters, and
// grows with the third power of their number.
struct CoplanaritySpectrum {
  std::vector<double> angles, images, both;
};
CoplanaritySpectrum spectrum(const CoplanarityNetwork& network);

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
