// Tests each observed position and control point against the block without it, and finds the gross errors among them
// that bend the block.
//
// A robust loss gives little weight to an observation that is far off the block. It does not notice a wrong control
// point at the end of a strip: the block bends to it, and the residual stays small. The test therefore compares the
// observation with the block as it would be without this observation (W. Baarda, "A testing procedure for use in
// geodetic networks", 1968: data snooping). Residual and covariance at the solution tell this without another
// adjustment.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "adjust/problem/tile_problem.h"
#include "adjust/tile/prior_scales.h"

namespace megablock {

// An observed position or a control point of the block.
struct PriorId {
  std::int64_t row = -1;        // of Block::frames, or of Block::control_points
  std::int64_t is_control = 0;  // 1: control point, 0: position
  friend auto operator<=>(const PriorId&, const PriorId&) = default;
};

struct PriorTest {
  PriorId prior;
  int axes = 0;       // directions that were tested
  double sigmas = 0;  // distance of the observation from the block without it, in the sigmas of this distance
  double pull = 0;    // how far the observation pulls the block at its place, in sigmas of the block there
};

// The tests of one tile, or the sum of those of several tiles.
struct PriorTests {
  LengthCounts positions, control;  // PriorTest::sigmas over their median for correct observations
  std::vector<PriorTest> far_off;   // observations that may be gross errors and pull the block
  std::vector<PriorTest> aside;     // observations that are set aside
  void add(const PriorTests& other);
};

// The test of one observation with the residual `r` in sigmas. `covariance` is that of the block in the directions of
// r, in sigmas squared; `weight` is rho' of the loss, by which the observation took part, and 0 where it took none.
// Nothing is tested in directions in which nothing else determines the block.
PriorTest test_prior(const Eigen::Vector3d& r, const Eigen::Matrix3d& covariance, double weight);

// Covariances of the rows of a problem's tables at the solution, in a datum that is not free. Zero: unknown.
struct PriorCovariances {
  std::span<const Eigen::Matrix3d> positions, positions_aside;  // of the residuals, in sigmas squared
  std::span<const Eigen::Matrix3d> points;                      // metres squared
};
// Tests the observations that the tile owns, but not those that are held.
PriorTests test_priors(const TileProblem& problem, const TileState& state, const PriorCovariances& covariances);

// What was decided on observations that seemed wrong.
struct PriorVerdicts {
  std::vector<PriorId> aside;    // take no part
  std::vector<PriorId> cleared;  // were set aside and taken back; they are not tried again
};

// The change of the verdicts that the tests ask for. Another adjustment follows each change.
//
// An observation is set aside that contradicts the rest of the block and pulls it; of several only those near the
// worst, and few at a time, because a gross error makes its neighbours look wrong too. An observation that is set
// aside comes back where it agrees with the block that was adjusted without it; one that cannot be tested stays aside.
// At most a fifth of a kind is set aside, and none of fewer than five. `scaled`: positions, control points, whose
// sigmas are multiplied by factors from their own residuals, and less well known.
PriorVerdicts change_verdicts(const PriorTests& tests, const PriorVerdicts& now, std::array<bool, 2> scaled);

// Takes these observations out of the problem, or back into it. A control point without its coordinates is a check
// point.
void set_aside(const std::vector<PriorId>& priors, TileProblem& problem);
void take_back(const std::vector<PriorId>& priors, TileProblem& problem);

}  // namespace megablock
