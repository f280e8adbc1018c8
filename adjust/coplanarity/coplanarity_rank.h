// Tells how far the equations of the determinant method (coplanarity_adjustment.h) determine their parameters.
#pragma once

#include <cstdint>
#include <vector>

#include "adjust/coplanarity/coplanarity_network.h"

namespace megablock {

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
  std::int64_t angle_rank() const;  // of A
  double angle_condition() const;   // infinite where A is singular; 1 without free angles
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

}  // namespace megablock
