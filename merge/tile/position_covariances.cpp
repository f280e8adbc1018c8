#include "merge/tile/position_covariances.h"

#include <algorithm>
#include <array>

#include "adjust/terms/terms.h"
#include "merge/plan/unknowns.h"

namespace megablock {

namespace {

// The unknown of a block of the position's Jacobian; -1: it is held, or no observation of the tile touches it.
std::int64_t unknown_of(const LinearTerm::Block& block, const TilePlan& plan) {
  const auto row = static_cast<std::size_t>(block.row);
  return block.by == LinearTerm::By::kFrame ? plan.unknown_of_frame[row] : plan.unknown_of_mount[row];
}

}  // namespace

PositionCovariances::PositionCovariances(const TileProblem& problem, const TilePlan& plan, const TileState& state,
                                         TileCovariance& result)
    : problem_(problem), plan_(plan), state_(state), result_(result) {
  result_.positions.assign(problem.positions.size(), Eigen::Matrix3d::Zero());
  result_.positions_aside.assign(problem.positions_aside.size(), Eigen::Matrix3d::Zero());
  const auto add = [this](std::int64_t unknown, std::size_t row) {
    if (unknown >= 0) uses_.push_back({unknown, row});
  };
  for (std::size_t row = 0; row < problem.positions.size() + problem.positions_aside.size(); ++row) {
    const TileProblem::PositionTerm& position = term(row);
    add(plan.unknown_of_frame[at(position.frame.value)], row);
    for (const std::int32_t mount : {position.receiver, position.group})
      if (mount >= 0) add(plan.unknown_of_mount[at(mount)], row);
  }
  std::ranges::sort(uses_);
}

const TileProblem::PositionTerm& PositionCovariances::term(std::size_t row) const {
  const std::size_t used = problem_.positions.size();
  return row < used ? problem_.positions[row] : problem_.positions_aside[row - used];
}

void PositionCovariances::take(const CovarianceMatrix& covariance, const UnknownList& list) {
  for (const Unknown& u : list)
    for (const Use& use : std::ranges::equal_range(uses_, find_unknown(plan_.unknowns, u.id), {}, &Use::unknown))
      take_position(covariance, use.row);
}

void PositionCovariances::take_position(const CovarianceMatrix& covariance, std::size_t row) {
  const LinearTerm position = linearise_position(term(row), state_);
  const auto is_held = [&](const LinearTerm::Block& block) {
    return block.by == LinearTerm::By::kMount && problem_.mount_free[at(block.row)] == 0;
  };
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int i = 0; i < position.block_count; ++i) {
    for (int j = 0; j < position.block_count; ++j) {
      const LinearTerm::Block &a = position.blocks[at(i)], &b = position.blocks[at(j)];
      if (is_held(a) || is_held(b)) continue;
      const std::int64_t of_a = unknown_of(a, plan_), of_b = unknown_of(b, plan_);
      if (of_a < 0 || of_b < 0) return;
      Eigen::Matrix<double, 6, 6> block;
      if (!covariance.block(plan_.unknowns[at(of_a)].id, plan_.unknowns[at(of_b)].id, block.data())) return;
      sum += a.jacobian * block * b.jacobian.transpose();
    }
  }
  const std::size_t used = problem_.positions.size();
  (row < used ? result_.positions[row] : result_.positions_aside[row - used]) = sum;
}

}  // namespace megablock
