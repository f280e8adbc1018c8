// Finds the covariance of each observed position's residual, from which the position is tested (adjust/checks/
// prior_test.h).
//
// The residual depends on the frame and, where the block estimates them, on the receiver and on the shift of the
// position's group (io/block/observed_poses.h). Its covariance in sigmas squared is
//
//     Q = sum_ab J_a C_ab J_b',     a, b: frame, receiver, shift.
//
// A shift and the frames of its group have nearly the same error, which leaves little of it in Q: the parts C_ab
// between them are as large as those on the diagonal.
#pragma once

#include <cstdint>
#include <vector>

#include "merge/tile/condense.h"

namespace megablock {

class PositionCovariances {
 public:
  // All arguments outlive the object. It fills `result.positions` and `result.positions_aside`.
  PositionCovariances(const TileProblem& problem, const TilePlan& plan, const TileState& state, TileCovariance& result);

  // Takes the positions that depend on one of the listed unknowns, and whose other unknowns are in `covariance` as
  // well. They are all in the front in which the first of them is eliminated (merge/plan/tile_plan.cpp). A position of
  // which the tile's own observations do not touch an unknown stays zero. Threads may call this for different fronts.
  void take(const CovarianceMatrix& covariance, const UnknownList& list);

 private:
  struct Use {
    std::int64_t unknown = -1;  // in TilePlan::unknowns
    std::size_t row = 0;        // of the positions, followed by those that are set aside
    friend auto operator<=>(const Use&, const Use&) = default;
  };
  const TileProblem::PositionTerm& term(std::size_t row) const;
  void take_position(const CovarianceMatrix& covariance, std::size_t row);

  const TileProblem& problem_;
  const TilePlan& plan_;
  const TileState& state_;
  TileCovariance& result_;
  std::vector<Use> uses_;  // ascending
};

}  // namespace megablock
